mod neighbor_list;
mod neighbors;
mod pair_sorter;

pub use neighbor_list::{
    ContactTest, FoundPairs, ListOptions, NeighborList, NeighborListBuilder, PeriodicImages,
};
pub use neighbors::{Neighbors, NeighborsBuilder, NeighborsIter};
pub(crate) use pair_sorter::PairSorter;
