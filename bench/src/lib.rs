//! The paper's figures, the peers of lazygrid, and statistics of the GPU kernels.

#![allow(missing_docs, reason = "internal to the workspace: most names and types are clear")]

pub mod figures;
pub mod gpu_results;
pub mod kernels;
pub mod measure;
pub mod peers;
mod species_scene;

pub use species_scene::SpeciesScene;

/// Commit of the build, marked `with changes` if sources had changed; `unknown` outside a git clone.
pub const COMMIT: &str = env!("LAZYGRID_COMMIT");
