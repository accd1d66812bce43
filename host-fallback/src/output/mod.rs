//! The forms of a result: pairs in canonical order, and neighbor lists with or without geometry.

mod neighbor_list;
mod neighbors;
mod pair_sorter;

pub use neighbor_list::{ContactTest, ListOptions, NeighborList, NeighborListBuilder, PeriodicImages};
pub use neighbors::{Neighbors, NeighborsBuilder};
pub(crate) use pair_sorter::PairSorter;
