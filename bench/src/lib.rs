//! The figures of the paper, the peers lazygrid is compared with, how engines are timed beside each other, and what drivers
//! make of the GPU kernels.

pub mod figures;
pub mod kernels;
pub mod measure;
pub mod peers;

/// The commit that this was built from, with a word where its sources had changes; `unknown` without git or outside a clone.
pub const COMMIT: &str = env!("LAZYGRID_COMMIT");
