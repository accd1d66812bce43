mod copy;
mod given;
mod grouping;
mod query;
mod search_input;
mod species_groups;
mod stats;
mod validate;

pub(crate) use given::{GivenLoop, GivenRows, GivenSpheres};
pub(crate) use grouping::{Grouping, sort_by_group};
pub use query::{PreparedQuery, QueryBuffers, check};
pub(crate) use search_input::{SearchInput, search_pieces};
pub use species_groups::SpeciesPartition;
pub(crate) use species_groups::{MAX_GROUPS, Meeting, SpeciesGroups};
pub use stats::{InputStats, SizeClass};
pub use validate::check_valid;
