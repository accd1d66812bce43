//! A run over ranks is that of one process, to the last bit, for any number of ranks. Ranks are threads here, and
//! processes in `distributed/mpi`.

#![allow(clippy::unwrap_used, reason = "tests")]

mod damage;
mod files;
mod models;
mod refusals;
mod steps;

use lazygrid_ranks::threads;
