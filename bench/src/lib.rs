//! The figures of the paper, the peers lazygrid is compared with, how engines are timed beside each other, and what drivers
//! make of the GPU kernels.

pub mod figures;
pub mod kernels;
pub mod measure;
pub mod peers;
