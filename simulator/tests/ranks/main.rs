//! A run over ranks (threads here) equals one in a single process bit for bit.

#![allow(clippy::unwrap_used, reason = "tests")]

mod collisions;
mod damage;
mod files;
mod models;
mod refusals;
mod steps;

use lazygrid_ranks::threads;
