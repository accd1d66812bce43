//! The contact test of two spheres, and its vector code for one sphere and many.
//!
//! rule → columns → vectors → sink → scan: each file knows those before it.

mod columns;
mod rule;
mod scan;
mod simd;
mod sink;

pub(crate) use columns::{Columns, ColumnsMut, MAX_LANES};
pub(crate) use rule::{Effective, Rule, Widening};
pub(crate) use scan::{COMPARE, Touches, scan};
pub use simd::Simd;
pub(crate) use simd::{Around, Axes, Images, Jobs, Portable, Row, Task, Vector, prefetch};
pub(crate) use sink::{Count, Output, Sink, To, Written, at_places, memory_of_list};
