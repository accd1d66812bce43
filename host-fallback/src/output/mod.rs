mod neighbor_list;
mod neighbors;
mod pair_sorter;

pub use neighbor_list::{ContactTest, ListOptions, NeighborList, NeighborListBuilder, PeriodicImages};
pub use neighbors::{Neighbors, NeighborsBuilder};
pub(crate) use pair_sorter::PairSorter;
