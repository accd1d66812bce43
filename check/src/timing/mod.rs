//! Times of copies, of the building blocks and of each algorithm.

pub mod bandwidth;
pub mod speed;
