//! lazygrid for C and C++. `include/lazygrid.h` is the documentation; a test compares it with what is here.
//!
//! Every function that C calls follows one pattern. Its pointers become references, slices and [`OutPtr`]s first, each
//! behind a check for what can be checked; what is left to the caller is what the header asks for. The work runs inside
//! [`status::guarded`], so that a panic ends as a status. A detector sits in a mutex that is only ever tried, so that a
//! second thread, or a callback, is refused instead of let in.
//!
//! Safety comments refer to the conditions of the header ("by the header"): pointers are NULL or point to what their type
//! says, live and unchanged for the time that the header names; handles come from the function that makes them and have not
//! been destroyed.

// There is nothing here that a Rust program could name: what is public is public to C.
#![allow(unreachable_pub)]

mod detector;
mod exclusions;
mod input;
mod interactions;
mod list;
mod out;
mod report;
mod search;
mod settings;
mod sized;
mod status;

#[cfg(test)]
mod tests;

use out::OutPtr;
use status::Failure;
