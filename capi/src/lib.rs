//! lazygrid for C and C++, documented in `include/lazygrid.h`; a test compares it with this crate.
//!
//! Exported functions convert pointers to references, slices and [`OutPtr`]s, after all possible checks.
//! [`status::guarded`] turns a panic into a status. Functions only `try_lock` the mutex of a detector, so a second
//! thread or a callback gets an error.
//!
//! Safety comments refer to the header's conditions: pointers are NULL or valid for their type, live and unchanged for
//! the time that the header names; handles come from the function that makes them and have not been destroyed.

// No Rust program uses this crate; `pub` items are public to C.
#![allow(unreachable_pub)]

mod detector;
mod exclusions;
mod input;
mod interactions;
mod list;
mod pointer;
mod report;
mod search;
mod settings;
mod sized;
mod status;

#[cfg(test)]
mod tests;

use pointer::OutPtr;
use status::Failure;
