//! Candidates that outlive a call: pairs that may overlap until some sphere has moved too far.
//!
//! Every sphere has an *allowance*, how far it may go. Candidates are the pairs that touch when radii are larger by
//! those; as long as no sphere has gone farther than its own, every pair that touches is among them. So a call
//! measures how far the spheres have gone and tests the candidates, or else finds new ones. What is found never
//! depends on the allowances, only the time it takes.
//!
//! `motion` observes, `worth` chooses allowances, `forecast` remembers what came of it, `course` decides from call to call, this
//! file keeps and tests. The GPU keeps candidates of its own, and shares the first three.

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
