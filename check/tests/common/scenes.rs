use lazygrid::gpu::{GpuConfig, GpuDetector, GpuDevice, GpuSpheres, Outcome};
use lazygrid::{Algorithm, Pair, Sphere};
pub(crate) use lazygrid_check::scenes::{cloud, scenes};
use lazygrid_check::{TestInput, Tolerance, difference};

use super::{download, submit, upload};

pub(crate) fn settings(algorithm: Algorithm, subgroups: bool) -> GpuConfig {
    GpuConfig::default().algorithm(algorithm).subgroups(subgroups)
}

pub(crate) struct Found {
    pub(crate) outcome: Outcome,
    pub(crate) pairs: Vec<Pair>,
}

pub(crate) fn detect_with(gpu: &GpuDevice, detector: &mut GpuDetector, input: &GpuSpheres<'_>) -> Found {
    let output = submit(gpu, |encoder| detector.encode(encoder, input)).expect("recorded");
    let outcome = download::<Outcome>(gpu, &output.outcome, 1)[0];
    let written = outcome.found().min(output.capacity.into()) as usize;
    let mut pairs: Vec<Pair> = download(gpu, &output.pairs, written);
    pairs.sort_unstable();
    Found { outcome, pairs }
}

pub(crate) fn detect(gpu: &GpuDevice, detector: &mut GpuDetector, spheres: &[Sphere]) -> Found {
    detect_with(gpu, detector, &GpuSpheres::new(&upload(gpu, spheres), spheres.len() as u32))
}

#[track_caller]
pub(crate) fn verify(case: &str, input: &TestInput, pairs: &[Pair]) {
    difference(input, pairs, &input.oracle_of_valid(), Tolerance::Tangent)
        .unwrap_or_else(|text| panic!("{case}: {text}"));
}

pub(crate) fn touching(spheres: &[Sphere]) -> TestInput {
    spheres.to_vec().into()
}
