//! Counter-based random numbers, and distributions.

pub(crate) mod bridge;
pub mod gaussian;
pub mod philox;
