use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use lazygrid_kernels::{Algorithm, Interactions, Space};

use crate::Error;
use crate::compare::Simd;

/// The order of a result.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Order {
    /// By `i`, then `j`.
    #[default]
    Canonical,
    /// The order in which the detector finds them; saves the ordering. The same from run to run and for any number of
    /// threads, except for streamed chunks, which arrive as threads finish them.
    Unordered,
}

/// Whether pairs that may soon overlap are kept from call to call, so that not every call has to search for them.
///
/// Whatever it is, the pairs of a call are those of the spheres that are given to it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum Skin {
    /// Every call searches anew.
    Off,
    /// As the motion makes it worth while: every size of sphere has a skin in proportion to how far spheres of that size
    /// move, on a GPU all the same one, and there is none where searching anew is expected to be cheaper. What is
    /// expected follows from the spheres given, never from a clock, so that a detector does the same from run to run. A
    /// detector that is called once keeps nothing.
    #[default]
    Auto,
    /// Candidates are the pairs whose spheres are up to this much too far apart to touch. They are kept until some
    /// sphere has moved by half of it.
    Fixed(f64),
}

/// Distances that a fixed skin may have: `f32` holds the square of half of it with room to spare.
pub const SKIN_RANGE: std::ops::RangeInclusive<f32> = 1e-14..=1e17;

/// The settings of a detector, on the CPU or for the host's part of a device.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Which detector; `Auto` chooses per call.
    pub algorithm: Algorithm,
    /// The order of results.
    pub order: Order,
    /// The widest vector code to use, where the processor has it.
    pub simd: Simd,
    /// Executor of a pool of the detector's own; `None` runs in the rayon pool of the caller.
    pub threads: Option<usize>,
    /// A cell of the recursive grid is split when it holds more smaller spheres than this.
    pub tau: u32,
    /// Cell edge of the paper's grids as a multiple of the largest diameter. Between 0.5 and 16.
    pub cell_ratio: f32,
    /// The most pairs a list may hold (8 bytes each, and 12 to 16 more while they are ordered).
    pub max_pairs: u64,
    /// Which species pair, and at which distance; `None`: all that touch.
    pub interactions: Option<Interactions>,
    /// Along which axes space is periodic.
    pub space: Space,
    /// `true` if candidates are kept from call to call.
    pub skin: Skin,
    /// While this is true searches end with [`Error::Cancelled`].
    pub stop: Option<Arc<AtomicBool>>,
}

impl Settings {
    /// τ by default. A vector compares 16 spheres at once, so that comparing a few hundred with each other costs less
    /// than a split; less makes crowded scenes slower, more changes little until cells hold thousands.
    pub const TAU: u32 = 512;
    /// Raster ratio by default. Smaller cells mean more entries per sphere, larger ones more comparisons: uniform
    /// scenes are fastest between 4 and 8, crowded ones in the array grid between 1 and 1.5.
    pub const CELL_RATIO: f32 = 4.0;
    /// 2²⁹ pairs, a list of 4 GiB.
    pub const MAX_PAIRS: u64 = 1 << 29;

    /// Refuses settings outside their range.
    pub(crate) fn check(&self) -> Result<(), Error> {
        if !(0.5..=16.0).contains(&self.cell_ratio) {
            let value = self.cell_ratio.to_string();
            return Err(Error::InvalidSetting {
                name: "cell_ratio",
                value,
                range: "choose between 0.5 and 16",
            });
        }
        if self.threads == Some(0) {
            let range = "choose at least one, or leave it unset";
            return Err(Error::InvalidSetting { name: "threads", value: "0".into(), range });
        }
        if let Skin::Fixed(distance) = self.skin {
            self.check_skin(distance)?;
        }
        Ok(())
    }

    /// Refuses a skin that no arithmetic can follow, and one for an algorithm that keeps nothing.
    fn check_skin(&self, distance: f64) -> Result<(), Error> {
        let value = distance.to_string();
        if !SKIN_RANGE.contains(&(distance as f32)) {
            return Err(Error::InvalidSetting {
                name: "skin",
                value,
                range: "choose between 1e-14 and 1e17, `Auto` or `Off`",
            });
        }
        if !self.keeps_candidates() {
            let range =
                "only `Algorithm::CellList` and `Auto` keep candidates: choose one of them, or no skin";
            return Err(Error::InvalidSetting { name: "skin", value, range });
        }
        Ok(())
    }

    /// Returns `true` if every call is searched in a frame, whatever its spheres: in a triclinic space, and if a length or a
    /// distance is no `f32` number.
    pub fn is_framed(&self) -> bool {
        self.space.triclinic_cell().is_some() || !self.is_narrow()
    }

    /// Returns `true` if the space and all distances are such that `f32` spheres need no bounds for their frame, if any.
    pub(crate) fn is_narrow(&self) -> bool {
        self.space.is_narrow() && self.interactions.as_ref().is_none_or(Interactions::is_narrow)
    }

    /// Returns `true` if a detector may keep candidates from call to call.
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
