//! A run over ranks equals one in a single process bit for bit. Ranks are threads here, and processes in
//! `distributed/mpi`.

#![allow(clippy::unwrap_used, reason = "tests")]

mod damage;
mod files;
mod models;
mod refusals;
mod steps;

use lazygrid_ranks::threads;
