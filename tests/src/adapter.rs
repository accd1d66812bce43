//! Skips tests without a GPU adapter. Tests of several crates include this file.

use lazygrid::Error;

/// Returns the opened object, or `None` without an adapter.
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
