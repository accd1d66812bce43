//! lazygrid for C and C++, documented in `include/lazygrid.h`; a test compares it with this crate.
//!
//! Exported functions convert pointers to references, slices and [`OutPtr`]s, after all possible checks.
//! [`status::guarded`] turns a panic into a status. A detector is in a mutex that functions only `try_lock`, so a
//! second thread or a callback gets an error instead of waiting.
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
