//! A run over ranks (threads here) equals one in a single process bit for bit.

#![allow(clippy::unwrap_used, reason = "tests")]

#[cfg(feature = "gpu")]
#[path = "../../../tests/src/adapter.rs"]
mod adapter;
mod collisions;
mod damage;
mod files;
#[cfg(feature = "gpu")]
mod gpu_files;
#[cfg(feature = "gpu")]
mod gpus;
mod models;
mod refusals;
mod steps;

use lazygrid::{Backend, Config};
use lazygrid_ranks::threads;

fn on_cpu() -> Config {
    Config::default().backend(Backend::Cpu)
}
