use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use lazygrid_kernels::{Algorithm, Interactions, Space};

use crate::Error;
use crate::compare::Simd;

/// The order of a result.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Order {
    /// Ascending by `i`, then `j`.
    #[default]
    Canonical,
    /// Unsorted. On the CPU, reproducible and independent of the number of threads, except for streamed chunks. On the
    /// GPU, the order may differ from call to call.
    Unordered,
}

/// The skin of the candidate list (Verlet list) that a detector keeps between calls. It never changes a result.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum Skin {
    /// Keeps no candidate list: every call searches.
    Off,
    /// Chooses the skin by observed displacements: on the CPU per species and size class, on a GPU for all. Keeps no
    /// list if searching is expected to be cheaper. Never reads a clock, so runs are reproducible.
    #[default]
    Auto,
    /// A fixed distance. Candidates are the pairs with gaps up to it, until a sphere has moved by half of it. Algorithms
    /// other than [`Auto`](Algorithm::Auto) and [`CellList`](Algorithm::CellList) keep no list and refuse it.
    Fixed(f64),
}

/// Valid distances of a fixed skin, so that the square of half a skin neither overflows nor underflows in `f32`.
pub const SKIN_RANGE: std::ops::RangeInclusive<f32> = 1e-14..=1e17;

#[derive(Clone, Debug)]
pub struct Settings {
    /// `Auto` chooses per call.
    pub algorithm: Algorithm,
    pub order: Order,
    pub simd: Simd,
    /// Size of the detector's own pool; `None` uses the caller's rayon pool.
    pub threads: Option<usize>,
    /// Threshold τ of the recursive grid: cells with more smaller spheres are split.
    pub tau: u32,
    /// Cell size of the paper's grids as a multiple of the largest diameter, 0.5 to 16.
    pub cell_ratio: f32,
    /// Maximum pairs of a list (8 bytes per pair, and 12 to 16 more while it is ordered).
    pub max_pairs: u64,
    /// `None` if all touching spheres pair.
    pub interactions: Option<Interactions>,
    pub space: Space,
    pub skin: Skin,
    /// Searches return [`Error::Cancelled`] while this flag is `true`.
    pub stop: Option<Arc<AtomicBool>>,
}

impl Settings {
    /// Default of τ. A vector compares up to 16 spheres at once, so comparing a few hundred costs less than a split.
    /// Smaller values make dense scenes slower; larger values change little until cells have thousands of spheres.
    pub const TAU: u32 = 512;
    /// Default cell ratio. Smaller cells mean more entries per sphere, larger ones more comparisons: uniform scenes are
    /// fastest between 4 and 8, dense ones in the array grid between 1 and 1.5.
    pub const CELL_RATIO: f32 = 4.0;
    /// Default limit of a list: 2²⁹ pairs, 4 GiB.
    pub const MAX_PAIRS: u64 = 1 << 29;

    pub(crate) fn check(&self) -> Result<(), Error> {
        if !(0.5..=16.0).contains(&self.cell_ratio) {
            let (value, range) = (self.cell_ratio.to_string(), "choose between 0.5 and 16");
            return Err(Error::InvalidSetting { name: "cell_ratio", value, range });
        }
        if self.threads == Some(0) {
            let range = "choose at least one, or leave it unset";
            return Err(Error::InvalidSetting { name: "threads", value: "0".into(), range });
        }
        self.check_skin()
    }

    fn check_skin_range(&self) -> Result<(), Error> {
        match self.skin {
            Skin::Fixed(distance) if !SKIN_RANGE.contains(&(distance as f32)) => {
                let range = "choose auto, off, or a distance from 1e-14 to 1e17";
                Err(Error::InvalidSetting { name: "skin", value: distance.to_string(), range })
            }
            _ => Ok(()),
        }
    }

    /// Refuses a fixed skin outside [`SKIN_RANGE`], or with an algorithm that keeps no candidates.
    ///
    /// # Errors
    /// [`Error::InvalidSetting`], with the given number.
    pub fn check_skin(&self) -> Result<(), Error> {
        self.check_skin_range()?;
        match self.skin {
            Skin::Fixed(distance) if !self.keeps_candidates() => {
                let range =
                    "only the algorithms auto and cell-list keep candidates: choose one of them, or no skin";
                Err(Error::InvalidSetting { name: "skin", value: distance.to_string(), range })
            }
            _ => Ok(()),
        }
    }

    /// Returns `true` if every call searches in a frame: in a triclinic space, or if `f32` does not hold a length
    /// exactly or a distance to half an ulp.
    pub fn is_framed(&self) -> bool {
        self.space.triclinic_cell().is_some() || !self.fits_f32()
    }

    /// Returns `true` if `f32` holds all lengths and distances, so that the frame of `f32` spheres needs no bounds.
    pub(crate) fn fits_f32(&self) -> bool {
        self.space.fits_f32() && self.interactions.as_ref().is_none_or(Interactions::fits_f32)
    }

    pub fn keeps_candidates(&self) -> bool {
        self.skin != Skin::Off && matches!(self.algorithm, Algorithm::Auto | Algorithm::CellList)
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
            cell_ratio: Self::CELL_RATIO,
            max_pairs: Self::MAX_PAIRS,
            interactions: None,
            space: Space::UNBOUNDED,
            skin: Skin::Auto,
            stop: None,
        }
    }
}
