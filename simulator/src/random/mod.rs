//! Counter-based random numbers, and distributions.

pub mod gaussian;
pub mod philox;
