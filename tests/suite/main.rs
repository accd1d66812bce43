//! Every detector × scenario × threads × order against the oracle.

mod bad_input;
mod between;
mod exclusions;
mod expected;
mod files;
mod interactions;
mod lazy;
mod limits;
mod periodic;
mod properties;
mod results;
mod reuse;
mod scenes;
mod sheared;
mod skin;
mod structure;
