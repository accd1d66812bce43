//! Included by tests of several crates.

use lazygrid::Error;

/// Returns `None` without an adapter, to skip the test.
///
/// # Panics
/// Panics if no adapter exists but `LAZYGRID_REQUIRE_GPU` is set, or if an adapter cannot be used.
pub(crate) fn or_skip<T>(opened: Result<T, Error>) -> Option<T> {
    match opened {
        Ok(opened) => Some(opened),
        Err(error @ Error::NoAdapter { .. }) if std::env::var_os("LAZYGRID_REQUIRE_GPU").is_none() => {
            #[expect(clippy::print_stderr, reason = "a skipped test says why")]
            {
                eprintln!("skipped: {error}");
            }
            None
        }
        Err(error) => panic!("{error}"),
    }
}
