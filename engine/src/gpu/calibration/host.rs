use std::time::{Duration, Instant};

use lazygrid_host::{HostDetector, Settings, Skin};
use lazygrid_kernels::{Sphere, Spheres};

use super::measure::{ROUNDS, SIZES, crossing, race, time};
use crate::Error;
use crate::gpu::config::GpuConfig;
use crate::gpu::costs::Crossover;
use crate::gpu::device::GpuDevice;
use crate::gpu::session::GpuSession;

const LONG: Duration = Duration::from_millis(50);

pub(super) fn device_from(gpu: &GpuDevice, crossover: Crossover, radix_sort_from: u32) -> Result<u32, Error> {
    let config = GpuConfig::default().crossover(crossover).radix_sort_from(radix_sort_from).timestamps(true);
    let mut session = GpuSession::new(gpu.clone(), config)?;
    let mut host = HostDetector::new(Settings { skin: Skin::Off, ..Settings::default() })?;
    let times = |scene: &[Sphere]| Ok([time_on_host(&mut host, scene)?, time(&mut session, scene)?]);
    let goes_on = |spheres, least: [Duration; 2]| {
        log::debug!("{spheres} spheres on the CPU and on the device: {least:?}");
        least[1] <= LONG
    };
    let samples = race(&SIZES, 1, ROUNDS, times, goes_on)?;
    let is_slower = samples.last().is_some_and(|(_, [on_host, on_device])| on_host < on_device);
    Ok(if is_slower { u32::MAX } else { crossing(&samples, u32::MAX) })
}

fn time_on_host(host: &mut HostDetector, spheres: &[Sphere]) -> Result<Duration, Error> {
    let start = Instant::now();
    host.count(Spheres::from(spheres))?;
    Ok(start.elapsed())
}
