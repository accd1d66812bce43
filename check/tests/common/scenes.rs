use lazygrid::gpu::{GpuConfig, GpuDetector, GpuDevice, GpuSpheres, Outcome};
use lazygrid::{Algorithm, Pair, Sphere};
pub(crate) use lazygrid_check::scenes::{cloud, scenes};

use super::{download, submit, upload};

pub(crate) fn settings(algorithm: Algorithm, subgroups: bool) -> GpuConfig {
    GpuConfig::default().algorithm(algorithm).subgroups(subgroups)
}

pub(crate) struct Found {
    pub(crate) outcome: Outcome,
    pub(crate) pairs: Vec<Pair>,
}

pub(crate) fn detect_with(own: &GpuDevice, detector: &mut GpuDetector, input: &GpuSpheres<'_>) -> Found {
    let output = submit(own, |encoder| detector.encode(encoder, input)).expect("recorded");
    let outcome = download::<Outcome>(own, &output.outcome, 1)[0];
    let written = outcome.found().min(output.capacity.into()) as usize;
    let mut pairs: Vec<Pair> = download(own, &output.pairs, written);
    pairs.sort_unstable();
    Found { outcome, pairs }
}

pub(crate) fn detect(own: &GpuDevice, detector: &mut GpuDetector, spheres: &[Sphere]) -> Found {
    detect_with(own, detector, &GpuSpheres::new(&upload(own, spheres), spheres.len() as u32))
}

fn squares(a: &Sphere, b: &Sphere, reach: f64) -> (f64, f64) {
    let square = |axis: usize| (f64::from(a.center[axis]) - f64::from(b.center[axis])).powi(2);
    (square(0) + square(1) + square(2), reach * reach)
}

/// Each pair occurs once, and only pairs within four ulp of tangency may be missing or extra. `reach` returns the
/// cutoff, or `None` if the spheres never pair.
pub(crate) fn verify(
    scene: &str,
    spheres: &[Sphere],
    pairs: &[Pair],
    reach: impl Fn(usize, usize) -> Option<f64>,
) {
    assert!(pairs.windows(2).all(|two| two[0] < two[1]), "{scene}: a pair twice");
    let mut given = pairs.iter().copied().peekable();
    for i in 0..spheres.len() {
        for j in i + 1..spheres.len() {
            let pair = Pair { i: i as u32, j: j as u32 };
            let found = given.next_if_eq(&pair).is_some();
            let (wanted, tangent) = reach(i, j).map_or((false, false), |reach| {
                let (distance, limit) = squares(&spheres[i], &spheres[j], reach);
                let tolerance = 4.0 * f64::from(f32::EPSILON) * limit;
                (distance <= limit, (distance - limit).abs() <= tolerance && limit > 0.0)
            });
            assert!(
                found == wanted || tangent,
                "{scene}: {pair:?} {} {}",
                spheres[i].radius,
                spheres[j].radius
            );
        }
    }
    assert_eq!(given.next(), None, "{scene}: not a pair i < j below n");
}

pub(crate) fn touching(spheres: &[Sphere]) -> impl Fn(usize, usize) -> Option<f64> {
    |i, j| Some(f64::from(spheres[i].radius) + f64::from(spheres[j].radius))
}
