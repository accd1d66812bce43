//! The figures of the paper, the peers lazygrid is compared with, and how engines are timed beside each other.

pub mod figures;
pub mod measure;
pub mod peers;
