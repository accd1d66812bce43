//! Measures from how many spheres on a device answers earlier than the CPU, for spheres in the host's memory.

use std::time::{Duration, Instant};

use lazygrid_host::{HostDetector, Settings, Skin};
use lazygrid_kernels::{Sphere, Spheres};

use super::{CLEARLY, Crossover, DENSITY, ROUNDS, SIZES, crossing, scene, time};
use crate::Error;
use crate::gpu::{GpuConfig, GpuDevice, GpuSession};

/// Larger scenes are not tried if a call takes longer than this.
const LONG: Duration = Duration::from_millis(50);

/// Measures it. [`u32::MAX`] if the device is never faster.
pub(super) fn device_from(own: &GpuDevice, crossover: Crossover, radix_from: u32) -> Result<u32, Error> {
    let config = GpuConfig::default().crossover(crossover).radix_from(radix_from).timed(true);
    let mut session = GpuSession::new(own.clone(), config)?;
    let mut host = HostDetector::new(Settings { skin: Skin::Off, ..Settings::default() })?;
    let mut samples = Vec::new();
    for spheres in SIZES {
        let scene = scene(spheres, 1, DENSITY);
        let [mut on_host, mut on_device] = [Duration::MAX; 2];
        for _ in 0..ROUNDS {
            on_host = on_host.min(time_on_host(&mut host, &scene)?);
            on_device = on_device.min(time(&mut session, &scene)?);
        }
        log::debug!("{spheres} spheres on the CPU in {on_host:?}, on the device in {on_device:?}");
        samples.push((spheres, [on_host, on_device]));
        if on_device.as_secs_f64() < on_host.as_secs_f64() * CLEARLY || on_device > LONG {
            break;
        }
    }
    let is_slower = samples.last().is_some_and(|(_, [on_host, on_device])| on_host < on_device);
    Ok(if is_slower { u32::MAX } else { crossing(&samples, u32::MAX) })
}

fn time_on_host(host: &mut HostDetector, spheres: &[Sphere]) -> Result<Duration, Error> {
    let start = Instant::now();
    host.count(Spheres::from(spheres))?;
    Ok(start.elapsed())
}
