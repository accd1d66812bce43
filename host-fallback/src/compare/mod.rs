mod candidate_filter;
mod columns;
mod delivery;
mod effective_rows;
mod filter;
mod pair_test;
mod scan;
mod simd;
mod sink;
mod triclinic_filter;

pub use candidate_filter::CandidateFilter;
pub(crate) use columns::{Columns, ColumnsMut, MAX_LANES};
pub(crate) use delivery::deliver_unordered;
pub(crate) use effective_rows::{EffectiveLoop, EffectiveRows};
pub use filter::PairFilter;
pub(crate) use pair_test::{PairTest, SkinMargin, SphereRadii};
pub(crate) use scan::{COMPARE_NS, HitQueue, ScanInput, scan};
#[cfg(test)]
pub(crate) use simd::Portable;
pub use simd::Simd;
pub(crate) use simd::{Axes, NeighborRows, PeriodicBox, RunQueue, SimdTask, SimdWidth, SphereRun, Xyzr};
pub use sink::PairConsumer;
pub(crate) use sink::{ChunkTarget, ChunkedOutput, Count, Output, Sink, memory_of_list, pair_at};
