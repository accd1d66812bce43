#![allow(dead_code, unused_imports, reason = "each test binary uses its part")]

#[path = "../../../tests/src/adapter.rs"]
mod adapter;
#[path = "../../../tests/src/limited_device.rs"]
mod limited_device;
pub(crate) mod periodic;
pub(crate) mod scenes;

use adapter::or_skip;
pub(crate) use adapter::skip::skip;
use bytemuck::Pod;
use lazygrid::gpu::{GpuDevice, GpuSession, SoftwareAdapter, Ticket, wgpu};
use lazygrid::{Backend, Config, Detector, Interaction, Pair, Sphere, Spheres};
pub(crate) use lazygrid_check::Random;
use lazygrid_check::{SpeciesSetup, device};
use lazygrid_kernels::kernel::{Kernel, Variant};
pub(crate) use limited_device::limited;

/// Shared, as it keeps compiled kernels.
pub(crate) fn device() -> Option<GpuDevice> {
    or_skip(GpuDevice::shared(SoftwareAdapter::Allow))
}

/// A device that a test may destroy.
pub(crate) fn new_device() -> Option<GpuDevice> {
    or_skip(GpuDevice::open(SoftwareAdapter::Allow))
}

/// Multiples of 1/64, so that results agree exactly.
pub(crate) fn exact_cloud(
    random: &mut Random,
    n: usize,
    extent: u32,
    radius: impl Fn(&mut Random) -> f32,
) -> Vec<Sphere> {
    let mut sphere = || {
        let center = [0; 3].map(|_| (random.word() % (extent * 64)) as f32 / 64.0);
        Sphere::new(center, radius(random))
    };
    (0..n).map(|_| sphere()).collect()
}

pub(crate) fn detector(config: Config) -> Detector {
    Detector::new(config).expect("an adapter, and settings in range")
}

pub(crate) fn gpu_detector(config: Config) -> Detector {
    detector(config.backend(Backend::Gpu))
}

pub(crate) fn cpu_pairs(spheres: &[Sphere]) -> Vec<Pair> {
    let mut detector = detector(Config::default().backend(Backend::Cpu));
    detector.pairs(spheres).expect("valid").to_vec()
}

pub(crate) fn finished(session: &mut GpuSession, ticket: Ticket) -> Vec<Pair> {
    let mut pairs = session.finish(ticket, u64::MAX).expect("found").to_vec();
    pairs.sort_unstable();
    pairs
}

pub(crate) fn session_pairs<'a>(session: &mut GpuSession, spheres: impl Into<Spheres<'a>>) -> Vec<Pair> {
    let ticket = session.begin(spheres.into()).expect("begun");
    finished(session, ticket)
}

pub(crate) fn session_count(session: &mut GpuSession, spheres: &[Sphere]) -> u64 {
    let ticket = session.begin(Spheres::from(spheres)).expect("begun");
    session.finish_count(ticket).expect("counted")
}

pub(crate) fn four_species(species: Vec<u32>) -> SpeciesSetup {
    use Interaction::{Never, Touch, Within};
    let rows = vec![vec![Never], vec![Within(0.7), Never], vec![Never, Within(0.01), Touch], vec![Never; 4]];
    SpeciesSetup { species, rows }
}

pub(crate) fn upload<T: Pod>(gpu: &GpuDevice, data: &[T]) -> wgpu::Buffer {
    device::upload(gpu, data).expect("uploaded")
}

pub(crate) fn download<T: Pod>(gpu: &GpuDevice, buffer: &wgpu::Buffer, count: usize) -> Vec<T> {
    device::download(gpu, buffer, count).expect("downloaded")
}

pub(crate) fn submit<R>(gpu: &GpuDevice, record: impl FnOnce(&mut wgpu::CommandEncoder) -> R) -> R {
    device::submit(gpu, |encoder| Ok(record(encoder))).expect("submitted")
}

pub(crate) fn run(
    gpu: &GpuDevice,
    kernel: &'static Kernel,
    variant: Variant,
    groups: u32,
    buffers: &[(&str, &wgpu::Buffer)],
) {
    device::run(gpu, kernel, variant, groups, buffers).expect("run");
}
