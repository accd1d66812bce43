//! Candidate lists (Verlet lists): pairs that may touch until a sphere has moved too far. Candidates touch with radii
//! larger by the spheres' *displacement limits*.
//!
//! # Correctness
//!
//! 1. If no sphere exceeds its limit, two touching spheres were at most their radii and both limits apart at the build.
//!    So every pair is a candidate.
//! 2. Each call measures displacements. It tests candidates if no limit is exceeded, else it builds a new list.
//!
//! The GPU shares `displacement`, `cost_model` and `tuner`.

use crate::compare::PairTest;
use crate::input::InputSpheres;

mod advance;
mod candidate_list;
mod controller;
mod cost_model;
mod displacement;
#[cfg(test)]
mod tests;
mod tuner;

pub(crate) use candidate_list::memory_of_candidates;
pub(crate) use controller::SkinController;
pub use cost_model::SkinCosts;
pub use tuner::SkinTuner;

/// The spheres of `input` are not yet mapped to their frame.
#[derive(Clone, Copy)]
pub(crate) struct CallSpheres<'a> {
    pub(crate) test: &'a PairTest<'a>,
    pub(crate) input: Option<InputSpheres<'a>>,
    /// `true` if the species of the spheres are those of the candidates.
    pub(crate) has_same_species: bool,
}

impl<'a> CallSpheres<'a> {
    pub(crate) fn new(test: &'a PairTest<'a>) -> Self {
        Self { test, input: None, has_same_species: false }
    }
}
