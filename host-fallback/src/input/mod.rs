mod copy;
mod grouping;
mod input_spheres;
mod query;
mod search_input;
mod species_groups;
mod species_partition;
mod stats;
mod validate;

pub(crate) use grouping::{Grouping, sort_by_group};
pub(crate) use input_spheres::{InputLoop, InputRows, InputSpheres};
pub use query::{Preparation, PreparedQuery, QueryBuffers, check};
pub(crate) use search_input::{SearchInput, search_pieces};
pub use species_groups::SpeciesGroups;
pub use species_partition::SpeciesPartition;
pub(crate) use species_partition::{Division, MAX_GROUPS, Meeting};
pub use stats::{InputStats, SizeClass};
pub use validate::check_valid;
