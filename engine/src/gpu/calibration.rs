//! The numbers of spheres from which on a grid is faster than all pairs, sorting by radix than counting and the device than the CPU,
//! and what it costs to keep candidates, measured on the device.

mod host;
mod skin;
mod sort;

use std::time::{Duration, Instant};

use lazygrid_kernels::{Algorithm, Sphere, Spheres};

pub use skin::SkinCosts;

use super::GpuSession;
use super::adapter::{AdapterSummary, GpuDevice};
use super::input::GpuConfig;
use crate::Error;
use crate::choice::GRID;

/// The numbers of spheres that are tried, until the grid is clearly faster.
const SIZES: [u32; 10] = [256, 512, 1024, 2048, 4096, 8192, 16_384, 32_768, 65_536, 131_072];
/// Rounds of which the fastest counts: whatever else a machine does only ever adds time.
const ROUNDS: usize = 7;
/// The grid is clearly faster when it takes less than this part of the time.
const CLEARLY: f64 = 0.7;
/// The size classes of the scenes that are measured: equal radii, and as in the paper's figure 3b.
const CLASSES: [usize; 2] = [1, 5];
/// The part of space that is filled.
const DENSITY: f32 = 0.05;

/// Below how many spheres testing all pairs is faster than a grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Crossover {
    /// For equal radii.
    pub naive_below: u32,
    /// The number of further spheres for every further size class (radii of another binary exponent).
    pub per_class: u32,
}

impl Crossover {
    /// Creates the crossover of a device on which testing all pairs is faster below `naive_below` spheres of equal radii, and
    /// `per_class` more for every further size class.
    pub const fn new(naive_below: u32, per_class: u32) -> Self {
        Self { naive_below, per_class }
    }

    /// Assumed of a GPU that was not measured: the paper's, about 10⁴ on its card (section 4).
    pub const HARDWARE: Self = Self { naive_below: 10_000, per_class: 0 };
    /// Assumed of a software adapter that was not measured: what `lazygrid calibrate` says of Mesa's llvmpipe on two
    /// cores, rounded.
    pub const SOFTWARE: Self = Self { naive_below: 300, per_class: 0 };

    /// Assumed of an adapter that was not measured.
    pub const fn assumed(is_hardware: bool) -> Self {
        if is_hardware { Self::HARDWARE } else { Self::SOFTWARE }
    }

    /// The most that can be measured: twice the most spheres that [`calibrate`] tries.
    pub const MOST: u32 = 2 * SIZES[SIZES.len() - 1];

    /// The crossover for spheres of this number of size classes; at most [`Crossover::MOST`], as all pairs of many more take minutes.
    pub fn of(self, classes: usize) -> u32 {
        let further = u32::try_from(classes.saturating_sub(1)).unwrap_or(u32::MAX);
        self.naive_below.saturating_add(self.per_class.saturating_mul(further)).min(Self::MOST)
    }
}

/// The measurements by which `Auto` chooses, valid for one adapter, one driver and one version of this library. To be kept by the
/// application and given to [`Config::calibration`](crate::Config::calibration); the library itself writes no file.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Calibration {
    /// The adapter's name.
    pub adapter: String,
    /// Its driver and the driver's version.
    pub driver: String,
    /// The version of this library.
    pub version: String,
    /// The number of spheres at which all pairs and the cell list cost the same.
    pub crossover: Crossover,
    /// From how many spheres on a cell list is sorted by radix; see [`GpuConfig::radix_from`].
    pub radix_from: u32,
    /// The costs of calls with and without a candidate list.
    pub skin: SkinCosts,
    /// The number of spheres in the host's memory from which on this device answers earlier than the CPU, with as many threads as
    /// there are processors; [`u32::MAX`] if it never does. [`Backend::Auto`](crate::Backend::Auto) chooses by it.
    pub device_from: u32,
}

impl Calibration {
    /// Assumed of a GPU with memory of its own that was not measured: a round trip with spheres from the host takes about
    /// 0.15 ms, in which a thread of the CPU finds the pairs of some 4000 spheres. No GPU has confirmed it.
    pub const DEVICE_FROM: u32 = 4096;
    /// Assumed of a GPU that shares the memory of the CPU and was not measured: it has a tenth of the arithmetic of others. No
    /// GPU has confirmed it.
    pub const INTEGRATED_DEVICE_FROM: u32 = 1 << 16;

    /// Creates the calibration of an adapter, as an application has kept it. `driver` is the driver with its version,
    /// `version` that of this library.
    pub fn new(
        [adapter, driver, version]: [String; 3],
        crossover: Crossover,
        radix_from: u32,
        skin: SkinCosts,
        device_from: u32,
    ) -> Self {
        Self { adapter, driver, version, crossover, radix_from, skin, device_from }
    }

    /// Returns `true` if it was measured on this adapter, with this driver and by this version.
    pub fn is_of(&self, adapter: &AdapterSummary) -> bool {
        let own = (adapter.name.as_str(), adapter.driver.as_str(), env!("CARGO_PKG_VERSION"));
        (self.adapter.as_str(), self.driver.as_str(), self.version.as_str()) == own
    }
}

/// What a calibration rests on: the fastest of some calls, spheres uploaded and the number of pairs read back.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Sample {
    /// The number of size classes of the radii.
    pub classes: usize,
    /// The number of spheres.
    pub spheres: u32,
    /// Time of all pairs.
    pub naive: Duration,
    /// Time of the grid that `Auto` takes for many spheres.
    pub grid: Duration,
}

/// Measures on this device where a grid overtakes all pairs, where sorting by radix overtakes counting, where the device overtakes
/// the CPU, and what it costs to keep candidates, which takes some seconds at most. What is measured of the first is handed to
/// `seen` as it comes.
///
/// # Errors
/// Fails if the device fails.
pub fn calibrate(own: &GpuDevice, mut seen: impl FnMut(&Sample)) -> Result<Calibration, Error> {
    let [one, five] = CLASSES.map(|classes| -> Result<u32, Error> {
        let [mut naive, mut grid] = [session(own, Algorithm::Naive)?, session(own, GRID)?];
        let times = |scene: &[Sphere]| Ok([time(&mut naive, scene)?, time(&mut grid, scene)?]);
        let goes_on = |spheres, [naive, grid]: [Duration; 2]| {
            seen(&Sample { classes, spheres, naive, grid });
            true
        };
        Ok(crossing(&race((&SIZES, classes), ROUNDS, times, goes_on)?, Crossover::MOST))
    });
    let (one, five) = (one?, five?);
    let radix_from = sort::radix_from(own)?;
    let per_class = five.saturating_sub(one) / (CLASSES[1] - CLASSES[0]) as u32;
    let crossover = Crossover { naive_below: one, per_class };
    Ok(Calibration {
        adapter: own.adapter.name.clone(),
        driver: own.adapter.driver.clone(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        crossover,
        radix_from,
        skin: skin::measure(own)?,
        device_from: host::device_from(own, crossover, radix_from)?,
    })
}

fn session(own: &GpuDevice, algorithm: Algorithm) -> Result<GpuSession, Error> {
    // Timed, as the calls of a `Detector` are.
    GpuSession::new(own.clone(), GpuConfig::default().algorithm(algorithm).timed(true))
}

fn time(session: &mut GpuSession, spheres: &[Sphere]) -> Result<Duration, Error> {
    let start = Instant::now();
    let ticket = session.begin(Spheres::from(spheres))?;
    session.finish_count(ticket)?;
    Ok(start.elapsed())
}

/// The least times of two ways for scenes of each size, until the second way is clearly faster or `goes_on` returns `false`.
fn race(
    (sizes, classes): (&[u32], usize),
    rounds: usize,
    mut times: impl FnMut(&[Sphere]) -> Result<[Duration; 2], Error>,
    mut goes_on: impl FnMut(u32, [Duration; 2]) -> bool,
) -> Result<Vec<(u32, [Duration; 2])>, Error> {
    let mut samples = Vec::new();
    for &spheres in sizes {
        let scene = scene(spheres, classes, DENSITY);
        let mut least = [Duration::MAX; 2];
        for _ in 0..rounds {
            for (least, time) in least.iter_mut().zip(times(&scene)?) {
                *least = time.min(*least);
            }
        }
        samples.push((spheres, least));
        let [first, second] = least.map(|time| time.as_secs_f64());
        if !goes_on(spheres, least) || second < first * CLEARLY {
            break;
        }
    }
    Ok(samples)
}

/// The number of spheres from which on the second of two ways is the faster, between two that were measured by interpolation of
/// the logarithms; the first where it always is, twice the last, up to `most`, where it never is.
fn crossing(samples: &[(u32, [Duration; 2])], most: u32) -> u32 {
    // How far ahead the first way is; a power of the number of spheres between two samples.
    let lead = |(_, [first, second]): &(u32, [Duration; 2])| {
        (second.as_secs_f64().max(1e-9) / first.as_secs_f64().max(1e-9)).ln()
    };
    let Some(last) = samples.iter().rposition(|sample| lead(sample) > 0.0) else {
        return samples.first().map_or(0, |first| first.0);
    };
    let Some(next) = samples.get(last + 1) else {
        return (2 * samples[last].0).min(most);
    };
    let (here, there) = (lead(&samples[last]), lead(next));
    let [from, to] = [&samples[last], next].map(|sample| f64::from(sample.0).ln());
    // Both are finite and of opposite sign, or the second is zero.
    (from + (to - from) * here / (here - there)).exp().round() as u32
}

/// Spheres spread evenly over a cube of which they fill this part, of radii 1, 1/2, 1/4, … in turn.
fn scene(spheres: u32, classes: usize, density: f32) -> Vec<Sphere> {
    let radius = |k: usize| 0.5_f32.powi((k % classes) as i32);
    let volume = (0..spheres as usize).map(|k| 4.188_79 * radius(k).powi(3)).sum::<f32>();
    let edge = (volume / density).cbrt();
    // Additive recurrence by powers of the root of x⁴ = x + 1: evenly spread, and the same everywhere.
    const STEPS: [f64; 3] = [0.819_172_513_396_164_4, 0.671_043_606_703_789_2, 0.549_700_477_901_970_2];
    let place = |k: usize| STEPS.map(|step| (k as f64 * step).fract() as f32 * edge);
    (0..spheres as usize).map(|k| Sphere::new(place(k), radius(k))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_crossing_lies_where_times_are_equal() {
        for (times, expected) in [
            (&[][..], 0..=0),
            (&[(256, 20, 10)], 256..=256),
            (&[(256, 10, 20), (512, 10, 20)], 1024..=1024),
            (&[(1000, 100, 400), (2000, 400, 400)], 2000..=2000),
            // All pairs grow with the square: equal at the geometric mean.
            (&[(1000, 100, 200), (2000, 400, 200)], 1414..=1415),
            // One slip of the clock before the crossing does not count.
            (&[(1000, 300, 200), (2000, 100, 200), (4000, 400, 200)], 2828..=2829),
            (&[(1000, 0, 0), (2000, 0, 0)], 1000..=1000),
            (&[(70_000, 10, 20)], 100_000..=100_000),
        ] {
            let sample = |&(spheres, a, b): &(u32, u64, u64)| (spheres, [a, b].map(Duration::from_micros));
            let samples: Vec<_> = times.iter().map(sample).collect();
            let found = crossing(&samples, 100_000);
            assert!(expected.contains(&found), "{times:?}: {found}");
        }
    }

    #[test]
    fn scenes_fill_space_as_they_say() {
        for classes in CLASSES {
            let spheres = scene(10_000, classes, DENSITY);
            let edge = spheres.iter().map(|s| s.center.x).fold(0.0, f32::max);
            let volume: f32 = spheres.iter().map(|s| 4.188_79 * s.radius.powi(3)).sum();
            assert!((volume / edge.powi(3) - DENSITY).abs() < 0.01, "{classes} classes");
            let mut radii: Vec<u32> = spheres.iter().map(|s| s.radius.to_bits()).collect();
            radii.sort_unstable();
            radii.dedup();
            assert_eq!(radii.len(), classes);
        }
    }
}
