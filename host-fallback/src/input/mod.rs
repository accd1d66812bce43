//! The input of a search: a query is checked, copied where it cannot be searched in place, and measured.
//!
//! `query` prepares it with the copies of `copy`, `validate` refuses bad spheres, `stats` measures sizes and bounds, `species_groups` groups species
//! by their partners, and `search_input` holds all of that for one call.

mod copy;
mod query;
mod search_input;
mod species_groups;
mod stats;
mod validate;

pub use query::{PreparedQuery, QueryBuffers, check};
pub(crate) use search_input::{SearchInput, search_pieces};
pub use species_groups::SpeciesPartition;
pub(crate) use species_groups::{Grouping, MAX_GROUPS, Meeting, SpeciesGroups};
pub use stats::{InputStats, SizeClass};
pub use validate::check_valid;
