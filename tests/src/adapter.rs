//! Included by tests of several crates.

#[path = "skip.rs"]
pub(crate) mod skip;

use lazygrid::Error;

/// Returns `None` without an adapter, to skip the test.
///
/// # Panics
/// Panics if no adapter exists but `LAZYGRID_REQUIRE_GPU` is set, or if an adapter cannot be used.
pub(crate) fn or_skip<T>(opened: Result<T, Error>) -> Option<T> {
    match opened {
        Ok(opened) => Some(opened),
        Err(error @ Error::NoAdapter { .. }) => {
            skip::skip(Some("LAZYGRID_REQUIRE_GPU"), &error.to_string());
            None
        }
        Err(error) => panic!("{error}"),
    }
}
