//! The CPU path of lazygrid: every pair of overlapping spheres, found by rayon threads.
//!
//! [`HostDetector`] is the way in. Data flows one way: spheres → [`Survey`] → [`choice`] → plan → detector → pairs.
//! Most programs use it through the `lazygrid` crate.

#![cfg_attr(test, allow(clippy::disallowed_methods, clippy::disallowed_macros))]

pub mod choice;

mod array_grid;
mod canonical;
mod cell;
mod cell_list;
mod columns;
mod contact;
mod cover;
mod detector;
mod entries;
mod hash_grid;
#[cfg(test)]
mod judged;
mod memory;
mod naive;
mod neighbors;
mod radix;
mod recursive_grid;
mod report;
mod scatter;
mod settings;
mod simd;
mod sink;
mod survey;
mod threads;
mod workspace;

pub use canonical::Canonical;
pub use detector::HostDetector;
pub use lazygrid_kernels::Error;
pub use neighbors::{Lists, Neighbors};
pub use report::{Phase, Report};
pub use settings::{Order, Settings};
pub use simd::Simd;
pub use survey::{CLASSES, Class, Survey};
