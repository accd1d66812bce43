mod copy;
mod grouping;
mod input_spheres;
mod query;
mod search_input;
mod species_groups;
mod stats;
mod validate;

pub(crate) use grouping::{Grouping, sort_by_group};
pub(crate) use input_spheres::{InputLoop, InputRows, InputSpheres};
pub use query::{PreparedQuery, QueryBuffers, check};
pub(crate) use search_input::{SearchInput, search_pieces};
pub use species_groups::SpeciesPartition;
pub(crate) use species_groups::{MAX_GROUPS, Meeting, SpeciesGroups};
pub use stats::{InputStats, SizeClass};
pub use validate::check_valid;
