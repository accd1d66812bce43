use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use lazygrid_kernels::{Algorithm, Backend, Interactions, Space};

use crate::{Error, Simd};

/// The order of a result.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Order {
    /// By `i`, then `j`.
    #[default]
    Canonical,
    /// Whatever the detector finds first; saves the ordering. The same from run to run and for any number of
    /// threads, except for streamed chunks, which arrive as threads finish them.
    Unordered,
}

/// What the CPU path is asked to do. Made once, kept for the life of a detector.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Which detector; `Auto` chooses per call.
    pub algorithm: Algorithm,
    /// The order of results.
    pub order: Order,
    /// The widest vector code to use, where the processor has it.
    pub simd: Simd,
    /// Threads of a pool of the detector's own; `None` runs in the rayon pool of the caller.
    pub threads: Option<usize>,
    /// A cell of the recursive grid is split when it holds more smaller spheres than this.
    pub tau: u32,
    /// Cell edge of the paper's grids as a multiple of the largest diameter. Between 0.5 and 16.
    pub raster_ratio: f32,
    /// The most pairs a list may hold (8 bytes each, and as much again while they are ordered).
    pub max_pairs: u64,
    /// Which species pair, and at which distance; `None`: all that touch.
    pub interactions: Option<Interactions>,
    /// Along which axes space is periodic.
    pub space: Space,
    /// While this is true searches end with [`Error::Stopped`].
    pub stop: Option<Arc<AtomicBool>>,
}

impl Settings {
    /// τ by default. A vector compares 16 spheres at once, so that comparing a few hundred with each other costs less
    /// than a split; less makes crowded scenes slower, more changes little until cells hold thousands.
    pub const TAU: u32 = 512;
    /// Raster ratio by default. Smaller cells mean more entries per sphere, larger ones more comparisons: uniform
    /// scenes are fastest between 4 and 8, crowded ones in the array grid between 1 and 1.5.
    pub const RASTER_RATIO: f32 = 4.0;
    /// 2²⁹ pairs, a list of 4 GiB.
    pub const MAX_PAIRS: u64 = 1 << 29;

    /// Refuses settings outside their range.
    pub(crate) fn check(&self) -> Result<(), Error> {
        if !(0.5..=16.0).contains(&self.raster_ratio) {
            let value = self.raster_ratio.to_string();
            return Err(Error::Setting { name: "raster_ratio", value, range: "choose between 0.5 and 16" });
        }
        if self.threads == Some(0) {
            let range = "choose at least one, or leave it unset";
            return Err(Error::Setting { name: "threads", value: "0".into(), range });
        }
        match self.algorithm {
            Algorithm::EagerGrid | Algorithm::LazyGrid => {
                Err(Error::NotOnBackend { algorithm: self.algorithm, backend: Backend::Cpu })
            }
            _ => Ok(()),
        }
    }
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            algorithm: Algorithm::Auto,
            order: Order::Canonical,
            simd: Simd::detect(),
            threads: None,
            tau: Self::TAU,
            raster_ratio: Self::RASTER_RATIO,
            max_pairs: Self::MAX_PAIRS,
            interactions: None,
            space: Space::UNBOUNDED,
            stop: None,
        }
    }
}
