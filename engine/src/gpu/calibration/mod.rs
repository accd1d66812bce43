//! Measures the numbers of spheres at which the grid overtakes all pairs, the radix sort counting, and the device the
//! CPU; and the costs of candidate lists.

mod host;
mod measure;
mod skin;
mod sort;

use std::time::Duration;

use lazygrid_kernels::{Algorithm, Sphere};

use super::config::GpuConfig;
use super::costs::{Calibration, Crossover};
use super::device::GpuDevice;
use super::session::GpuSession;
use crate::Error;
use crate::gpu::choice::LARGE_INPUT_ALGORITHM;
use measure::{ROUNDS, SIZES, crossing, race, time};

/// Equal radii, and the classes of the paper's figure 3b.
const CLASSES: [usize; 2] = [1, 5];

/// The fastest of several calls, with upload and readback of the count.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct CrossoverSample {
    /// Number of size classes of the radii.
    pub classes: usize,
    /// Number of spheres.
    pub spheres: u32,
    /// Time of all pairs.
    pub naive: Duration,
    /// Time of the grid that `Auto` uses for many spheres.
    pub grid: Duration,
}

/// Measures the crossovers and the costs of candidate lists on this device, within seconds. `seen` receives each sample
/// of the crossover between all pairs and the grid.
///
/// # Errors
/// Fails if the device fails.
pub fn calibrate(gpu: &GpuDevice, mut seen: impl FnMut(&CrossoverSample)) -> Result<Calibration, Error> {
    let [one, five] = CLASSES.map(|classes| -> Result<Vec<(u32, [Duration; 2])>, Error> {
        let [mut naive, mut grid] = [session(gpu, Algorithm::Naive)?, session(gpu, LARGE_INPUT_ALGORITHM)?];
        let times = |scene: &[Sphere]| Ok([time(&mut naive, scene)?, time(&mut grid, scene)?]);
        let goes_on = |spheres, [naive, grid]: [Duration; 2]| {
            seen(&CrossoverSample { classes, spheres, naive, grid });
            true
        };
        race(&SIZES, classes, ROUNDS, times, goes_on)
    });
    let (one, five) = (one?, five?);
    let tests_per_second = naive_rate(&one)
        .unwrap_or(Calibration::assumed_tests_per_second(gpu.adapter.is_hardware, gpu.adapter.is_integrated));
    let [one, five] = [one, five].map(|samples| crossing(&samples, Crossover::MOST));
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

/// From the difference of the last and the first sample; `None` if the submission cost hides it.
fn naive_rate(samples: &[(u32, [Duration; 2])]) -> Option<f64> {
    let (first, last) = (samples.first()?, samples.last()?);
    let tests = |(spheres, _): &(u32, [Duration; 2])| f64::from(*spheres).powi(2) / 2.0;
    let time = last.1[0].saturating_sub(first.1[0]).as_secs_f64();
    let rate = (tests(last) - tests(first)) / time;
    (rate.is_finite() && rate > 0.0).then_some(rate)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn naive_rate_is_free_of_the_cost_of_a_submission() {
        let sample = |spheres: u32, micros| (spheres, [Duration::from_micros(micros), Duration::ZERO]);
        let rate = naive_rate(&[sample(1000, 1050), sample(2000, 1200)]).expect("times differ");
        assert!((rate / 1e10 - 1.0).abs() < 1e-9, "{rate}");
        for samples in [vec![], vec![sample(1000, 50)], vec![sample(1000, 50), sample(2000, 50)]] {
            assert_eq!(naive_rate(&samples), None);
        }
    }
}
