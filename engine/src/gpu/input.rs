//! The input of a [`GpuDetector`]: a configuration once, spheres at every call.

use std::ops::Range;

use lazygrid_kernels::kernel::GROUP;
use lazygrid_kernels::layout::Call;
use lazygrid_kernels::{Algorithm, Interactions, Space};

use super::Crossover;
#[cfg(doc)]
use super::{GpuDetector, Outcome};
use crate::Error;

/// The configuration of a [`GpuDetector`].
#[derive(Clone, Debug)]
pub struct GpuConfig {
    pub(crate) algorithm: Algorithm,
    pub(crate) crossover: Crossover,
    pub(crate) pair_capacity: u32,
    pub(crate) raster_ratio: f32,
    pub(crate) tau: u32,
    pub(crate) radix_from: u32,
    pub(crate) interactions: Option<Interactions>,
    pub(crate) space: Space,
    pub(crate) consumer_group: u32,
    pub(crate) sorted_pairs: bool,
    pub(crate) subgroups: bool,
    pub(crate) timed: bool,
}

impl GpuConfig {
    /// `Auto` or one of [`Algorithm::GPU`]. Default: `Auto`, decided by the number of spheres that a call may have.
    pub fn algorithm(self, algorithm: Algorithm) -> Self {
        Self { algorithm, ..self }
    }

    /// The number of spheres below which `Auto` tests all pairs; see [`calibrate`](super::calibrate). Radii that are on the
    /// GPU count as one size class. Default: [`Crossover::HARDWARE`].
    pub fn crossover(self, crossover: Crossover) -> Self {
        Self { crossover, ..self }
    }

    /// Pairs that the output buffer holds. Default: 2²⁰ (8 MiB). More are counted but not written.
    pub fn pair_capacity(self, pair_capacity: u32) -> Self {
        Self { pair_capacity, ..self }
    }

    /// Cell size as a multiple of the largest diameter, 1.5 to 16. Default: [`GpuConfig::RASTER_RATIO`].
    pub fn raster_ratio(self, raster_ratio: f32) -> Self {
        Self { raster_ratio, ..self }
    }

    /// τ: in LazyGrid the smaller spheres of a cell go to a finer level only if they are more than this (Stroobant
    /// et al., section 3.2). Default: [`GpuConfig::TAU`].
    pub fn tau(self, tau: u32) -> Self {
        Self { tau, ..self }
    }

    /// The number of spheres at or above which a cell list is sorted by radix instead of by counting. Default:
    /// [`GpuConfig::RADIX_FROM`]; [`calibrate`](super::calibrate) measures it.
    pub fn radix_from(self, radix_from: u32) -> Self {
        Self { radix_from, ..self }
    }

    /// The species that pair, with their distances, which are rounded to `f32` as all numbers on the GPU. Default: none, all
    /// spheres that touch are pairs.
    pub fn interactions(self, interactions: impl Into<Option<Interactions>>) -> Self {
        Self { interactions: interactions.into(), ..self }
    }

    /// The space of the spheres, which is not [sheared](Space::sheared). Its lengths are rounded to `f32`. Default:
    /// [`Space::UNBOUNDED`]. In a periodic space spheres are first copied to their nearest images, which takes 16 bytes for
    /// each; pairs within 5 ulp of exact tangency, relative to the squared reach, may fall either way. In unbounded space
    /// it is 4 ulp.
    pub fn space(self, space: Space) -> Self {
        Self { space, ..self }
    }

    /// Threads per workgroup of the consumer that is dispatched indirectly. Default: 256.
    pub fn consumer_group(self, consumer_group: u32) -> Self {
        Self { consumer_group, ..self }
    }

    /// Sets whether pairs of the cell list hold positions in the order of its cells ([`GpuSorted`](super::GpuSorted))
    /// instead of indices of the spheres as given, for consumers that work on the sorted spheres.
    /// [`Outcome::is_sorted`] tells which, as other algorithms have no such order. Windows always go by the indices
    /// given. A [`GpuSession`](super::GpuSession) does without. Default: no.
    pub fn sorted_pairs(self, sorted_pairs: bool) -> Self {
        Self { sorted_pairs, ..self }
    }

    /// Sets whether subgroup operations are used if the device was made with them. Default: yes.
    pub fn subgroups(self, subgroups: bool) -> Self {
        Self { subgroups, ..self }
    }

    /// Sets whether phases are timed if the device was made with timestamp queries. Each phase then has a pass of its
    /// own, which costs some microseconds. Default: no.
    pub fn timed(self, timed: bool) -> Self {
        Self { timed, ..self }
    }
}

impl GpuConfig {
    /// τ by default. On Mesa's software driver, 100 000 spheres of five sizes take the same time from 32 on, and a burst
    /// of ten sizes the least about 128 (`cargo bench -p lazygrid-bench --bench parameter_sweep -- --backend gpu --what tau`); other
    /// devices may differ.
    pub const TAU: u32 = 64;
    /// From how many spheres on a cell list is sorted by radix: where counters no longer fit the caches of large GPUs. Not
    /// measured through this library; with CUDA on an H200 both are even at a million, and counting is 2.6 times as
    /// fast at a hundred thousand.
    pub const RADIX_FROM: u32 = 1 << 19;
    /// The same for a software adapter, whose caches hide less: on Mesa's llvmpipe on two cores counting is the faster at a
    /// million (`cargo bench -p lazygrid-bench --bench gpu_hard_scenes -- --radix-from 0,4000000000`).
    pub const SOFTWARE_RADIX_FROM: u32 = 1 << 20;
    /// Raster ratio by default: on the same driver the best for five sizes, where 3 is better for equal ones by a tenth.
    pub const RASTER_RATIO: f32 = 2.0;
    /// The smallest raster ratio with which no sphere overlaps more than two cells per axis.
    pub const MIN_RASTER_RATIO: f32 = 1.5;
    /// The largest raster ratio.
    pub const MAX_RASTER_RATIO: f32 = 16.0;
}

impl GpuConfig {
    /// The parameters of a call of up to `spheres` spheres that all kernels read, for any algorithm.
    pub(super) fn call(&self, spheres: u32, input: &GpuSpheres<'_>) -> Call {
        let call = Call {
            spheres,
            pair_capacity: self.pair_capacity,
            species: self.interactions.as_ref().map_or(0, Interactions::species),
            consumer_group: self.consumer_group,
            window_begin: input.window.start,
            window_end: input.window.end,
            split: input.split,
            tau: self.tau,
            sorted_pairs: u32::from(self.sorted_pairs),
            ..Call::default()
        };
        call.in_space(self.space)
    }
}

impl Default for GpuConfig {
    fn default() -> Self {
        Self {
            algorithm: Algorithm::Auto,
            crossover: Crossover::HARDWARE,
            pair_capacity: 1 << 20,
            raster_ratio: Self::RASTER_RATIO,
            tau: Self::TAU,
            radix_from: Self::RADIX_FROM,
            interactions: None,
            space: Space::UNBOUNDED,
            consumer_group: GROUP,
            sorted_pairs: false,
            subgroups: true,
            timed: false,
        }
    }
}

/// The number of spheres of a call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Count<'a> {
    /// Known to the host.
    Host(u32),
    /// The first `u32` of a buffer with `STORAGE` usage, read on the GPU.
    Buffer {
        /// The buffer.
        buffer: &'a wgpu::Buffer,
        /// The most it may say; more set [`Outcome::SPHERES`] in the overflow flag.
        at_most: u32,
    },
}

impl From<u32> for Count<'_> {
    fn from(count: u32) -> Self {
        Self::Host(count)
    }
}

/// Spheres that are on the GPU already.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct GpuSpheres<'a> {
    /// `x, y, z, r` as four `f32` per sphere; `STORAGE` usage.
    pub(super) spheres: &'a wgpu::Buffer,
    /// The number of spheres.
    pub(super) count: Count<'a>,
    /// A `u32` species id per sphere, where the settings have interactions; `STORAGE` usage.
    pub(super) species: Option<&'a wgpu::Buffer>,
    /// Only pairs whose smaller index lies in here are counted and written.
    pub(super) window: Range<u32>,
    /// The number of spheres of the first of two sets, before those of the second; 0 for one set.
    pub(super) split: u32,
}

impl<'a> GpuSpheres<'a> {
    /// The first `count` spheres of a buffer, a number or a [`Count`]: all their pairs, for any species.
    pub fn new(spheres: &'a wgpu::Buffer, count: impl Into<Count<'a>>) -> Self {
        Self { spheres, count: count.into(), species: None, window: Self::ALL, split: 0 }
    }

    /// Adds a `u32` species id per sphere, needed if the settings have interactions; `STORAGE` usage.
    pub fn with_species(self, species: &'a wgpu::Buffer) -> Self {
        Self { species: Some(species), ..self }
    }

    /// Asks for pairs whose smaller index is in `window` only, so that a result larger than the output can be taken in
    /// parts. Default: [`ALL`](Self::ALL).
    pub fn in_window(self, window: Range<u32>) -> Self {
        Self { window, ..self }
    }

    /// Asks for pairs of one of the first `first` spheres and one of the others only.
    pub fn across(self, first: u32) -> Self {
        match first {
            // In a call 0 stands for one set.
            0 => Self { window: 0..0, split: 0, ..self },
            split => Self { split, ..self },
        }
    }

    /// The window that every pair is in.
    pub const ALL: Range<u32> = 0..u32::MAX;

    /// Refuses buffers that are too short or cannot be bound, and species if there is no table, or none if there is.
    /// Returns how many spheres there may be.
    pub(super) fn check(&self, has_table: bool) -> Result<u32, Error> {
        let spheres = match self.count {
            Count::Host(count) => count,
            Count::Buffer { buffer, at_most } => {
                check_buffer("count", buffer, 4)?;
                at_most
            }
        };
        check_buffer("spheres", self.spheres, u64::from(spheres.max(1)) * 16)?;
        if let Some(species) = self.species {
            check_buffer("species", species, u64::from(spheres.max(1)) * 4)?;
        }
        match self.species.is_some() == has_table {
            true => Ok(spheres),
            false => Err(Error::SpeciesBuffer),
        }
    }
}

/// Refuses settings out of range.
pub(super) fn check(settings: &GpuConfig) -> Result<(), Error> {
    if settings.space.shear().is_some() {
        let range =
            "what stays on the GPU has edges along the axes only: choose `Detector`, which takes any edges";
        return Err(Error::Setting { name: "space", value: "sheared".into(), range });
    }
    if !(GpuConfig::MIN_RASTER_RATIO..=GpuConfig::MAX_RASTER_RATIO).contains(&settings.raster_ratio) {
        let value = settings.raster_ratio.to_string();
        let range = "on the GPU choose between 1.5 and 16";
        return Err(Error::Setting { name: "raster_ratio", value, range });
    }
    if settings.consumer_group == 0 {
        let range = "choose the consumer's workgroup size";
        return Err(Error::Setting { name: "consumer_group", value: "0".into(), range });
    }
    check_algorithm(settings.algorithm)
}

/// Refuses what has no kernels.
pub(super) fn check_algorithm(algorithm: Algorithm) -> Result<(), Error> {
    match algorithm {
        Algorithm::Auto => Ok(()),
        named if Algorithm::GPU.contains(&named) => Ok(()),
        other => Err(Error::NotOnBackend { algorithm: other, backend: crate::Backend::Gpu }),
    }
}

/// Refuses a buffer that is too short or cannot be bound.
pub(super) fn check_buffer(what: &'static str, buffer: &wgpu::Buffer, needed: u64) -> Result<(), Error> {
    let storage = buffer.usage().contains(wgpu::BufferUsages::STORAGE);
    if buffer.size() < needed || !storage {
        let usage = if storage { "" } else { ", with STORAGE usage" };
        return Err(Error::Buffer { what, size: buffer.size(), needed, usage });
    }
    Ok(())
}
