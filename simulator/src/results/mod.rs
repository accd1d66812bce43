//! What comes of runs, from the files that they write.

pub mod mean;
pub mod series;
