//! Results of runs, from the files that they write.

pub mod bit_errors;
pub mod channel;
pub mod log;
pub mod mean;
pub mod response;
pub mod series;
pub mod symbols;
