mod host;
mod measure;
mod skin;
mod sort;

use std::time::{Duration, Instant};

use lazygrid_kernels::{Algorithm, Sphere};

use super::config::GpuConfig;
use super::costs::{Calibration, Crossover};
use super::device::GpuDevice;
use super::session::GpuSession;
use crate::Error;
use crate::gpu::choice::LARGE_INPUT_ALGORITHM;
use measure::{ROUNDS, SIZES, compare_times, crossing, time};

/// Equal radii, and the classes of the paper's figure 3b.
const CLASSES: [usize; 2] = [1, 5];

/// Minimum and maximum spheres in a crowded cell.
const COINCIDENT_SPHERES: [u32; 2] = [2048, 1 << 18];
const MAX_CROWDED_TIME: Duration = Duration::from_millis(50);
const CROWDED_ROUNDS: usize = 3;

/// The fastest of several calls, with upload and readback.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct CrossoverSample {
    /// Number of size classes of the radii.
    pub classes: usize,
    /// Number of spheres.
    pub spheres: u32,
    /// Time of all pairs.
    pub naive: Duration,
    /// Time of the cell list.
    pub grid: Duration,
}

/// Time in which an idle GPU raises its clock: an H100 copied 0.40 TB/s when idle, 0.80 TB/s after work.
const WARM_UP: Duration = Duration::from_secs(1);

/// Measures the [`Calibration`] of this device within seconds. `seen` receives each crossover sample.
///
/// # Errors
/// Fails if the device fails.
pub fn calibrate(gpu: &GpuDevice, mut seen: impl FnMut(&CrossoverSample)) -> Result<Calibration, Error> {
    if gpu.adapter.is_hardware {
        warm_up(gpu)?;
    }
    let [one, five] = CLASSES.map(|classes| -> Result<Vec<(u32, [Duration; 2])>, Error> {
        let [mut naive, mut grid] = [session(gpu, Algorithm::Naive)?, session(gpu, LARGE_INPUT_ALGORITHM)?];
        let times = |scene: &[Sphere]| Ok([time(&mut naive, scene)?, time(&mut grid, scene)?]);
        let continues = |spheres, [naive, grid]: [Duration; 2]| {
            seen(&CrossoverSample { classes, spheres, naive, grid });
            true
        };
        compare_times(&SIZES, classes, ROUNDS, times, continues)
    });
    let (one, five) = (one?, five?);
    let naive = one.first().zip(one.last()).and_then(|ends| rate(ends.into(), |times| times[0]));
    let tests_per_second = slowest_rate(gpu, naive)?;
    let [one, five] = [one, five].map(|samples| crossing(&samples, Crossover::MAX));
    let radix_sort_from = sort::radix_sort_from(gpu)?;
    let per_class = five.saturating_sub(one) / (CLASSES[1] - CLASSES[0]) as u32;
    let crossover = Crossover { naive_below: one, per_class };
    Ok(Calibration {
        adapter: gpu.adapter.name.clone(),
        driver: gpu.adapter.driver.clone(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        crossover,
        radix_sort_from,
        skin: skin::measure(gpu)?,
        device_from: host::device_from(gpu, crossover, radix_sort_from)?,
        tests_per_second,
    })
}

fn session(gpu: &GpuDevice, algorithm: Algorithm) -> Result<GpuSession, Error> {
    GpuSession::new(gpu.clone(), GpuConfig::default().algorithm(algorithm).timestamps(true))
}

fn warm_up(gpu: &GpuDevice) -> Result<(), Error> {
    let scene = vec![Sphere::new([0.0; 3], 1.0); COINCIDENT_SPHERES[0] as usize];
    let mut session = session(gpu, Algorithm::Naive)?;
    let start = Instant::now();
    while start.elapsed() < WARM_UP {
        time(&mut session, &scene)?;
    }
    Ok(())
}

/// Returns the lower rate of a crowded cell and of all pairs (`naive`) in tests per second; the assumed rate if neither
/// is measurable.
fn slowest_rate(gpu: &GpuDevice, naive: Option<f64>) -> Result<f64, Error> {
    let mut grid = session(gpu, LARGE_INPUT_ALGORITHM)?;
    let crowded = crowded_rate(|spheres| {
        let coincident = vec![Sphere::new([0.0; 3], 1.0); spheres as usize];
        let times =
            (0..CROWDED_ROUNDS).map(|_| time(&mut grid, &coincident)).collect::<Result<Vec<_>, _>>()?;
        Ok(times.into_iter().min().unwrap_or_default())
    })?;
    log::debug!("distance tests per second of all pairs {naive:?}, in a crowded cell {crowded:?}");
    let assumed = Calibration::assumed_tests_per_second(gpu.adapter.is_hardware, gpu.adapter.is_integrated);
    Ok([naive, crowded].into_iter().flatten().reduce(f64::min).unwrap_or(assumed))
}

/// Doubles the number of coincident spheres until a search takes [`MAX_CROWDED_TIME`]. A size derived from the rate of
/// few spheres could take minutes: noise can make that rate far too high.
fn crowded_rate(mut time: impl FnMut(u32) -> Result<Duration, Error>) -> Result<Option<f64>, Error> {
    let mut samples = [(COINCIDENT_SPHERES[0], time(COINCIDENT_SPHERES[0])?); 2];
    while samples[1].0 < COINCIDENT_SPHERES[1] {
        let spheres = 2 * samples[1].0;
        samples[1] = (spheres, time(spheres)?);
        if samples[1].1 >= MAX_CROWDED_TIME {
            break;
        }
    }
    Ok(rate(samples.each_ref(), |time| time))
}

/// Returns the rate of `n²/2` tests; `None` if the submission cost hides it.
fn rate<T: Copy>([first, last]: [&(u32, T); 2], time: impl Fn(T) -> Duration) -> Option<f64> {
    let tests = |(spheres, _): &(u32, T)| f64::from(*spheres).powi(2) / 2.0;
    let seconds = time(last.1).saturating_sub(time(first.1)).as_secs_f64();
    let rate = (tests(last) - tests(first)) / seconds;
    (rate.is_finite() && rate > 0.0).then_some(rate)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crowds_grow_no_further_than_their_time() {
        for (tests_per_second, most) in
            [(1e7, 2 * COINCIDENT_SPHERES[0]), (2e9, 16_384), (1e15, COINCIDENT_SPHERES[1])]
        {
            let mut spheres = Vec::new();
            let found = crowded_rate(|coincident| {
                spheres.push(coincident);
                Ok(Duration::from_secs_f64(1e-3 + f64::from(coincident).powi(2) / 2.0 / tests_per_second))
            });
            assert_eq!(spheres.last(), Some(&most), "{spheres:?}");
            let found = found.expect("no device fails").expect("times differ");
            assert!((found / tests_per_second - 1.0).abs() < 0.1, "{found}");
        }
    }

    #[test]
    fn rate_is_free_of_the_cost_of_a_submission() {
        let sample = |spheres: u32, micros| (spheres, Duration::from_micros(micros));
        let rate_of = |first, last| rate([&first, &last], |time| time);
        let found = rate_of(sample(1000, 1050), sample(2000, 1200)).expect("times differ");
        assert!((found / 1e10 - 1.0).abs() < 1e-9, "{found}");
        for last in [sample(1000, 50), sample(2000, 50)] {
            assert_eq!(rate_of(sample(1000, 50), last), None);
        }
    }
}
