//! Included by tests of several crates.

/// Prints that a test, or a part of it, is skipped.
///
/// # Panics
/// Panics if the environment variable `required` is set.
#[allow(unreachable_pub, reason = "public in one of the crates")]
pub fn skip(required: Option<&str>, why: &str) {
    if let Some(variable) = required {
        assert!(std::env::var_os(variable).is_none(), "{variable} is set, and {why}");
    }
    #[expect(clippy::print_stderr, reason = "a skipped test says why")]
    {
        eprintln!("skipped: {why}");
    }
}
