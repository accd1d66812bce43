//! Errors of a build without the feature `gpu`.
#![cfg(not(feature = "gpu"))]

use lazygrid::{Algorithm, Backend, Config, Detector, Error, Sphere};

#[test]
fn auto_is_the_cpu_and_says_why() -> Result<(), Error> {
    let mut detector = Detector::new(Config::default())?;
    assert_eq!(detector.count(&[Sphere::new([0.0; 3], 1.0); 2])?, 1);
    let report = detector.report();
    assert_eq!(report.backend, Backend::Cpu);
    assert!(report.reason.contains("without its feature `gpu`"), "{}", report.reason);
    Ok(())
}

#[test]
fn the_gpu_by_name_is_refused() {
    let refused = |config: Config| Detector::new(config).expect_err("there is no GPU path");
    let gpu = refused(Config::default().backend(Backend::Gpu));
    assert!(matches!(&gpu, Error::GpuUnavailable { reason } if reason.contains("feature `gpu`")), "{gpu}");
    let lazy = refused(Config::default().algorithm(Algorithm::LazyGrid));
    assert!(matches!(lazy, Error::GpuUnavailable { .. }), "{lazy}");
    let algorithm = Algorithm::LazyGrid;
    let on_cpu = refused(Config::default().backend(Backend::Cpu).algorithm(algorithm));
    assert_eq!(on_cpu, Error::NotOnBackend { algorithm, backend: Backend::Cpu });
}
