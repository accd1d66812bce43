//! Calibration of a device: the numbers of spheres at which the grid overtakes all pairs, the radix sort overtakes
//! counting and the device overtakes the CPU, and the costs of candidate lists.

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
use crate::choice::LARGE_INPUT_ALGORITHM;
use measure::{ROUNDS, SIZES, crossing, race, time};

/// The size classes of the scenes that are measured: equal radii, and as in the paper's figure 3b.
const CLASSES: [usize; 2] = [1, 5];

/// A measurement of the crossover: the fastest of some calls, upload and readback of the count included.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct CrossoverSample {
    /// The number of size classes of the radii.
    pub classes: usize,
    /// The number of spheres.
    pub spheres: u32,
    /// Time of all pairs.
    pub naive: Duration,
    /// Time of the grid that `Auto` takes for many spheres.
    pub grid: Duration,
}

/// Measures the crossovers and the costs of candidate lists on this device, in some seconds at most. `seen` gets each
/// sample of the crossover of all pairs and the grid.
///
/// # Errors
/// Fails if the device fails.
pub fn calibrate(gpu: &GpuDevice, mut seen: impl FnMut(&CrossoverSample)) -> Result<Calibration, Error> {
    let [one, five] = CLASSES.map(|classes| -> Result<u32, Error> {
        let [mut naive, mut grid] = [session(gpu, Algorithm::Naive)?, session(gpu, LARGE_INPUT_ALGORITHM)?];
        let times = |scene: &[Sphere]| Ok([time(&mut naive, scene)?, time(&mut grid, scene)?]);
        let goes_on = |spheres, [naive, grid]: [Duration; 2]| {
            seen(&CrossoverSample { classes, spheres, naive, grid });
            true
        };
        Ok(crossing(&race((&SIZES, classes), ROUNDS, times, goes_on)?, Crossover::MOST))
    });
    let (one, five) = (one?, five?);
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
    })
}

fn session(gpu: &GpuDevice, algorithm: Algorithm) -> Result<GpuSession, Error> {
    // Timed, as the calls of a `Detector` are.
    GpuSession::new(gpu.clone(), GpuConfig::default().algorithm(algorithm).timestamps(true))
}
