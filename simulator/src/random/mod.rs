//! A counter-based random number generator, and numbers of given distributions.

pub mod gaussian;
pub mod philox;
