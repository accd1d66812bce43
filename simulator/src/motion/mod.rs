//! Motion of particles and receivers, and their contacts.

pub mod binding;
pub mod contact;
pub mod path_hit;
pub mod propagate;
pub mod receiver_state;

pub(crate) mod adsorption;
pub(crate) mod collisions;
pub(crate) mod receiver_search;
pub(crate) mod reflection;
pub(crate) mod request_counts;
pub(crate) mod species_step;
pub(crate) mod step_normals;
pub(crate) mod surface_diffusion;
pub(crate) mod surface_events;
pub(crate) mod surfaces;
pub(crate) mod tumble;
pub(crate) mod vessel_flow;
pub(crate) mod wall;
