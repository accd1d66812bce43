use std::time::{Duration, Instant};

use lazygrid_host::{HostDetector, Settings, Skin};
use lazygrid_kernels::{Sphere, Spheres};

use super::measure::{ROUNDS, SIZES, compare_times, crossing, time};
use crate::Error;
use crate::gpu::config::GpuConfig;
use crate::gpu::costs::Crossover;
use crate::gpu::device::GpuDevice;
use crate::gpu::session::GpuSession;

/// Device time of a sample after which larger scenes are not measured.
const MAX_SAMPLE_TIME: Duration = Duration::from_millis(50);

pub(super) fn device_from(gpu: &GpuDevice, crossover: Crossover, radix_sort_from: u32) -> Result<u32, Error> {
    let config = GpuConfig::default().crossover(crossover).radix_sort_from(radix_sort_from).timestamps(true);
    let mut session = GpuSession::new(gpu.clone(), config)?;
    let mut host = HostDetector::new(Settings { skin: Skin::Off, ..Settings::default() })?;
    let times = |scene: &[Sphere]| Ok([time_on_host(&mut host, scene)?, time(&mut session, scene)?]);
    let continues = |spheres, least: [Duration; 2]| {
        log::debug!("{spheres} spheres on the CPU and on the device: {least:?}");
        least[1] <= MAX_SAMPLE_TIME
    };
    let samples = compare_times(&SIZES, 1, ROUNDS, times, continues)?;
    Ok(match &samples[..] {
        [.., from, to @ (_, [on_host, on_device])] if on_host < on_device => crossing_beyond(from, to),
        [(_, [on_host, on_device])] if on_host < on_device => u32::MAX,
        _ => crossing(&samples, u32::MAX),
    })
}

/// Returns the spheres at which the device overtakes the CPU if both times grow linearly; [`u32::MAX`] if never.
fn crossing_beyond(from: &(u32, [Duration; 2]), to: &(u32, [Duration; 2])) -> u32 {
    let lag =
        |(_, [on_host, on_device]): &(u32, [Duration; 2])| on_device.as_secs_f64() - on_host.as_secs_f64();
    let (before, after) = (lag(from), lag(to));
    if before <= after {
        return u32::MAX;
    }
    // `as` saturates.
    (f64::from(to.0) + f64::from(to.0 - from.0) * after / (before - after)) as u32
}

fn time_on_host(host: &mut HostDetector, spheres: &[Sphere]) -> Result<Duration, Error> {
    let start = Instant::now();
    host.count(Spheres::from(spheres))?;
    Ok(start.elapsed())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn device_overtakes_the_cpu_beyond_the_samples_if_it_catches_up() {
        let sample = |spheres, micros: [u64; 2]| (spheres, micros.map(Duration::from_micros));
        let crossing = |from, to| crossing_beyond(&from, &to);
        assert_eq!(crossing(sample(65_536, [600, 800]), sample(131_072, [1200, 1300])), 196_608);
        for after in [1400, 1500] {
            assert_eq!(crossing(sample(65_536, [600, 800]), sample(131_072, [1200, after])), u32::MAX);
        }
    }
}
