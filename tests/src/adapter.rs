//! What becomes of a test where there is no adapter. Tests of several crates include this file.

use lazygrid::Error;

/// What was opened. Without an adapter nothing, and a word on standard error why the test is skipped.
///
/// # Panics
/// Where there is none although `LAZYGRID_REQUIRE_GPU` is set, or where it cannot be used.
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
