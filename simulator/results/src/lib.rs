//! Results of simulations from the files of runs. Lengths are in µm and times in s.

#![allow(missing_docs, reason = "most names and types are clear")]

pub mod animation;
pub mod bit_errors;
pub mod by_symbol;
pub mod channel;
pub mod columns;
pub mod interval;
pub mod log;
pub mod mean;
pub mod response;
pub mod series;
pub mod sweep;
pub mod symbols;

/// Bytes of memory per field of a table: 8 for a number, or for a row's type divided by its fields, doubled because
/// vectors double as they grow.
const BYTES_PER_FIELD: u64 = 16;
