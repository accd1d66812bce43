//! The figures of the paper, the peers that lazygrid is compared with, interleaved timing, and statistics of Vulkan
//! drivers about the GPU kernels. And `RESULTS-GPU.md`: what arithmetic expects of GPUs, next to what was measured.

pub mod figures;
pub mod gpu_results;
pub mod kernels;
pub mod measure;
pub mod peers;

/// The commit of the build, marked `with changes` if its sources had changed; `unknown` without git or outside a clone.
pub const COMMIT: &str = env!("LAZYGRID_COMMIT");
