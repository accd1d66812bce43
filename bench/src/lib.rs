//! What the `lazygrid` command, the tests and the benchmarks share.

pub mod scenes;
