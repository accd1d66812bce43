//! Random numbers by counter, and numbers of given distributions computed from random words.

pub mod gaussian;
pub mod philox;
