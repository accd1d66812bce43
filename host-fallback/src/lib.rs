//! The CPU path of lazygrid: every pair of overlapping spheres, found by rayon threads.
//!
//! [`HostDetector`] is the way in. Data flows one way: spheres → [`Survey`] → [`choice`] → plan → detector → pairs.
//! Most programs use it through the `lazygrid` crate.

#![cfg_attr(test, allow(clippy::disallowed_methods, clippy::disallowed_macros))]

pub mod choice;

mod canonical;
mod cell_list;
mod classes;
mod compare;
mod detector;
mod finder;
mod floor;
mod frame;
mod input;
#[cfg(test)]
mod judged;
mod list;
mod memory;
mod naive;
mod neighbors;
mod paper;
mod place;
mod radix;
mod refinement;
mod report;
mod scatter;
mod settings;
mod skin;
mod species_groups;
mod state;
mod survey;
mod threads;

pub use classes::CLASSES;
pub use compare::Simd;
pub use detector::{HostBackend, HostDetector};
pub use finder::{PairFinder, PairSource, SearchBackend, TakePairs, TakePart, Work, ranges};
pub use frame::Frame;
pub use lazygrid_kernels::{Error, InputError};
pub use list::{Contact, Images, ListOptions, NeighborList, NeighborListBuilder};
pub use neighbors::{Lists, Neighbors};
pub use place::{Placed, Places, check};
pub use refinement::Refinement;
pub use report::{Kept, Phase, Rebuilt, Report};
pub use settings::{Order, Settings, Skin};
pub use skin::{Costs, Forecast, SKINS};
pub use species_groups::Partition;
pub use survey::{Class, Survey, check_valid};
pub use threads::{Team, Threads};
