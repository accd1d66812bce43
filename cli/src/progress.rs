use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};

/// Reading fewer bytes than this takes no time worth a bar.
const LONG_FILE: u64 = 64 << 20;
/// Searching fewer spheres than this takes no time worth a spinner.
const LONG_SEARCH: usize = 1_000_000;

/// A bar for reading a file of this length. Like all of these it shows on a terminal only.
pub(crate) fn reading(length: Option<u64>) -> ProgressBar {
    match length {
        Some(length) if length >= LONG_FILE => {
            let bar = ProgressBar::new(length).with_message("reading");
            bar.with_style(style("{msg} {wide_bar} {bytes}/{total_bytes} {bytes_per_sec}"))
        }
        _ => ProgressBar::hidden(),
    }
}

/// A spinner for work on this many spheres.
pub(crate) fn working(what: &'static str, spheres: usize) -> ProgressBar {
    if spheres < LONG_SEARCH {
        return ProgressBar::hidden();
    }
    let message = format!("{what}, {spheres} spheres");
    let spinner = ProgressBar::new_spinner().with_message(message);
    spinner.enable_steady_tick(Duration::from_millis(200));
    spinner.with_style(style("{spinner} {msg} {elapsed}"))
}

/// A bar for a run of so many steps.
pub(crate) fn running(steps: u32) -> ProgressBar {
    let bar = ProgressBar::new(steps.into());
    bar.with_style(style("{wide_bar} step {pos}/{len} {per_sec}, {eta} left, {msg}"))
}

fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
}
