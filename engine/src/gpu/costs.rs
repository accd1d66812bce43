use lazygrid_host::SkinCosts;

use super::device::AdapterSummary;

/// The number of spheres below which all pairs are faster than a grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Crossover {
    /// Number for equal radii.
    pub naive_below: u32,
    /// Increase per further size class (radii of another binary exponent).
    pub per_class: u32,
}

impl Crossover {
    /// Creates a crossover.
    pub const fn new(naive_below: u32, per_class: u32) -> Self {
        Self { naive_below, per_class }
    }

    /// Assumed for an unmeasured GPU. On an H200 the cell list is faster at every size: 36 against 67 µs of GPU time
    /// for 100 spheres, 64 against 91 µs for 8000.
    pub const HARDWARE: Self = Self { naive_below: 64, per_class: 0 };
    /// Assumed for a software adapter: `lazygrid calibrate` for Mesa's llvmpipe on two cores, rounded.
    pub const SOFTWARE: Self = Self { naive_below: 300, per_class: 0 };

    /// Returns the crossover of an unmeasured adapter.
    pub const fn assumed(is_hardware: bool) -> Self {
        if is_hardware { Self::HARDWARE } else { Self::SOFTWARE }
    }

    /// Largest measurable crossover: twice the spheres of the largest scene of [`calibrate`](super::calibrate).
    pub const MAX: u32 = 1 << 18;

    /// Returns the crossover for `classes` size classes, at most [`Crossover::MAX`].
    pub fn for_classes(self, classes: usize) -> u32 {
        let further = u32::try_from(classes.saturating_sub(1)).unwrap_or(u32::MAX);
        self.naive_below.saturating_add(self.per_class.saturating_mul(further)).min(Self::MAX)
    }
}

/// Measurements by which `Auto` chooses ([`Config::calibration`](crate::Config::calibration)), valid for one adapter,
/// driver and library version. Assumed crossovers of discrete GPUs agree with an H100 and an H200; integrated GPUs were
/// not measured.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Calibration {
    /// Adapter's name.
    pub adapter: String,
    /// Driver and its version.
    pub driver: String,
    /// Version of this library.
    pub version: String,
    /// Crossover between all pairs and the cell list.
    pub crossover: Crossover,
    /// Number of spheres at or above which a cell list is sorted by radix.
    pub radix_sort_from: u32,
    /// Costs of calls with and without a candidate list.
    pub skin: SkinCosts,
    /// Spheres in host memory at or above which this device beats the CPU with all threads; [`u32::MAX`] if never.
    pub device_from: u32,
    /// Distance tests per second of the slowest search, which limit a dispatch to 200 ms.
    pub tests_per_second: f64,
}

impl Calibration {
    /// Assumed for a discrete GPU: the memory-bound rate of candidate tests, a twelfth of the 3.1·10¹¹ of an H100 and
    /// an H200.
    pub const TESTS_PER_SECOND: f64 = 2.5e10;
    /// Assumed for an integrated GPU.
    pub const INTEGRATED_TESTS_PER_SECOND: f64 = 2.5e9;
    /// Assumed for a software adapter.
    pub const SOFTWARE_TESTS_PER_SECOND: f64 = 5e8;

    /// Assumed for a discrete GPU: a round trip takes about 0.15 ms, in which a CPU thread finds the pairs of some 4000
    /// spheres. `lazygrid calibrate` measured 4850 on an H100 and 4067 on an H200, compared with 16 cores.
    pub const DEVICE_FROM: u32 = 4096;
    /// Assumed for an integrated GPU, which has a tenth of the arithmetic.
    pub const INTEGRATED_DEVICE_FROM: u32 = 1 << 16;

    /// Assumed for a GPU: more counters do not fit the caches of large GPUs. `lazygrid calibrate` measured 650,000 on
    /// an H100 and 820,000 on an H200; with CUDA on an H200 both sorts are equal at a million spheres.
    pub const RADIX_SORT_FROM: u32 = 1 << 19;
    /// Assumed for a software adapter: on llvmpipe with two cores counting is faster at a million spheres (`cargo bench
    /// -p lazygrid-bench --bench gpu_hard_scenes -- --radix-from 0,4000000000`).
    pub const SOFTWARE_RADIX_SORT_FROM: u32 = 1 << 20;

    /// Creates a calibration. `driver` includes its version; `version` is the library's.
    pub fn new(
        [adapter, driver, version]: [String; 3],
        crossover: Crossover,
        radix_sort_from: u32,
        skin: SkinCosts,
        device_from: u32,
    ) -> Self {
        let tests_per_second = Self::TESTS_PER_SECOND;
        Self { adapter, driver, version, crossover, radix_sort_from, skin, device_from, tests_per_second }
    }

    /// Sets the distance tests per second, a positive number.
    pub fn with_tests_per_second(self, tests_per_second: f64) -> Self {
        Self { tests_per_second, ..self }
    }

    pub(crate) const fn assumed_tests_per_second(is_hardware: bool, is_integrated: bool) -> f64 {
        match (is_hardware, is_integrated) {
            (false, _) => Self::SOFTWARE_TESTS_PER_SECOND,
            (true, true) => Self::INTEGRATED_TESTS_PER_SECOND,
            (true, false) => Self::TESTS_PER_SECOND,
        }
    }

    /// Returns `true` if this adapter, driver and library version were measured.
    pub fn is_of(&self, adapter: &AdapterSummary) -> bool {
        let current = (adapter.name.as_str(), adapter.driver.as_str(), env!("CARGO_PKG_VERSION"));
        (self.adapter.as_str(), self.driver.as_str(), self.version.as_str()) == current
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct AdapterProfile {
    pub(crate) crossover: Crossover,
    pub(crate) radix_sort_from: u32,
    pub(crate) skin: SkinCosts,
    pub(crate) device_from: u32,
    pub(crate) tests_per_second: f64,
    pub(crate) how: &'static str,
}

impl AdapterProfile {
    pub(crate) const fn assumed(adapter: &AdapterSummary) -> Self {
        let crossover = Crossover::assumed(adapter.is_hardware);
        let device_from = match adapter {
            AdapterSummary { is_hardware: false, .. } => u32::MAX,
            AdapterSummary { is_integrated: true, .. } => Calibration::INTEGRATED_DEVICE_FROM,
            _ => Calibration::DEVICE_FROM,
        };
        let (radix_sort_from, skin, how) = match adapter.is_hardware {
            true => (
                Calibration::RADIX_SORT_FROM,
                HARDWARE_SKIN_COSTS,
                "assumed of a GPU, not measured on this adapter",
            ),
            false => (
                Calibration::SOFTWARE_RADIX_SORT_FROM,
                SOFTWARE_SKIN_COSTS,
                "assumed of a software adapter, not measured on this one",
            ),
        };
        let tests_per_second =
            Calibration::assumed_tests_per_second(adapter.is_hardware, adapter.is_integrated);
        Self { crossover, radix_sort_from, skin, device_from, tests_per_second, how }
    }
}

pub(crate) fn profile_of(calibrations: &[Calibration], adapter: &AdapterSummary) -> AdapterProfile {
    let same = |known: &&Calibration| known.is_of(adapter);
    match calibrations.iter().rev().find(same) {
        Some(&Calibration { crossover, radix_sort_from, skin, device_from, tests_per_second, .. }) => {
            AdapterProfile {
                crossover,
                radix_sort_from,
                skin,
                device_from,
                tests_per_second,
                how: "measured on this adapter",
            }
        }
        None => AdapterProfile::assumed(adapter),
    }
}

/// Assumed for a GPU at 10¹² bytes/s: a search moves 210 bytes per sphere by its plan, and 100 more per pair. A call
/// with a list has six more dispatches of 2 µs, and fourteen indirect ones of 3 µs more; 38 to 75 µs were measured. By
/// these values lists begin at 310,000 spheres; on an H100 a list halves the step of a million spheres
/// (`bench/results/nvidia-h100-h200.md`).
pub(crate) const HARDWARE_SKIN_COSTS: SkinCosts = SkinCosts {
    search_ns: 0.21,
    levels_ns: 0.0,
    find_ns: 0.1,
    keep_ns: 0.048,
    measure_ns: 0.036,
    test_ns: 0.04,
    call_ns: 54_000.0,
};

/// Assumed for a software adapter: `lazygrid calibrate` for llvmpipe on two cores, rounded.
pub(crate) const SOFTWARE_SKIN_COSTS: SkinCosts = SkinCosts {
    search_ns: 900.0,
    levels_ns: 0.0,
    find_ns: 30.0,
    keep_ns: 200.0,
    measure_ns: 50.0,
    test_ns: 15.0,
    call_ns: 0.0,
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn skin_costs_out_of_range_are_invalid() {
        assert!(HARDWARE_SKIN_COSTS.is_valid() && SOFTWARE_SKIN_COSTS.is_valid());
        for bad in [f32::NAN, -1.0, f32::INFINITY] {
            assert!(!SkinCosts { test_ns: bad, ..SOFTWARE_SKIN_COSTS }.is_valid(), "{bad}");
            assert!(!SkinCosts { search_ns: bad, ..SOFTWARE_SKIN_COSTS }.is_valid(), "{bad}");
        }
        assert!(!SkinCosts { search_ns: 0.0, ..SOFTWARE_SKIN_COSTS }.is_valid());
    }
}
