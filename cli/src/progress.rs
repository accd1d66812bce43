use std::borrow::Cow;
use std::io::Read;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressBarIter, ProgressDrawTarget, ProgressStyle};

const DELAY: Duration = Duration::from_secs(1);
const TICK: Duration = Duration::from_millis(200);

/// A progress line that appears on terminals after a second.
pub(crate) struct Progress {
    bar: ProgressBar,
}

impl Progress {
    pub(crate) fn new(length: Option<u64>) -> Self {
        let progress = Self::hidden(length);
        let bar = progress.bar.downgrade();
        let later = move || {
            std::thread::sleep(DELAY);
            if let Some(bar) = bar.upgrade() {
                show(&bar, ProgressDrawTarget::stderr());
            }
            // The bar's own ticker panics if the system refuses it a thread.
            while let Some(bar) = bar.upgrade().filter(|bar| !bar.is_finished()) {
                bar.tick();
                drop(bar);
                std::thread::sleep(TICK);
            }
        };
        if let Err(error) = std::thread::Builder::new().spawn(later) {
            log::info!("no progress is shown: {error}");
        }
        progress
    }

    fn hidden(length: Option<u64>) -> Self {
        let bar = ProgressBar::with_draw_target(length, ProgressDrawTarget::hidden());
        let template = match length {
            Some(_) => "{spinner} {elapsed} {msg} {wide_bar} {bytes}/{total_bytes} read",
            None => "{spinner} {elapsed} {msg}",
        };
        Self { bar: bar.with_style(style(template)) }
    }

    pub(crate) fn wrap<R: Read>(&self, input: R) -> ProgressBarIter<R> {
        self.bar.wrap_read(input)
    }

    pub(crate) fn say(&self, what: impl Into<Cow<'static, str>>) {
        self.bar.set_message(what);
    }

    pub(crate) fn hidden_during<T>(&self, work: impl FnOnce() -> T) -> T {
        self.bar.suspend(work)
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

fn show(bar: &ProgressBar, target: ProgressDrawTarget) {
    if !bar.is_finished() {
        bar.set_draw_target(target);
        bar.tick();
    }
}

pub(crate) fn running(steps: u64) -> ProgressBar {
    let bar = ProgressBar::new(steps);
    let bar = bar.with_style(style("{wide_bar} step {pos}/{len} {per_sec}, {eta} left, {msg}"));
    bar.set_message("preparing");
    bar.tick();
    bar
}

pub(crate) fn working(total_weight: u64) -> ProgressBar {
    let bar = ProgressBar::new(total_weight);
    bar.with_style(style("{wide_bar} {percent}%, about {eta} left, {msg}"))
}

fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
}

#[cfg(test)]
mod tests {
    use std::io;
    use std::sync::{Arc, Mutex};

    use indicatif::TermLike;

    use super::*;

    #[derive(Clone, Debug, Default)]
    struct Terminal(Arc<Mutex<String>>);

    impl TermLike for Terminal {
        fn width(&self) -> u16 {
            100
        }

        fn move_cursor_up(&self, _: usize) -> io::Result<()> {
            Ok(())
        }

        fn move_cursor_down(&self, _: usize) -> io::Result<()> {
            Ok(())
        }

        fn move_cursor_right(&self, _: usize) -> io::Result<()> {
            Ok(())
        }

        fn move_cursor_left(&self, _: usize) -> io::Result<()> {
            Ok(())
        }

        fn write_line(&self, text: &str) -> io::Result<()> {
            self.write_str(text)
        }

        fn write_str(&self, text: &str) -> io::Result<()> {
            self.0.lock().unwrap().push_str(text);
            Ok(())
        }

        fn clear_line(&self) -> io::Result<()> {
            Ok(())
        }

        fn flush(&self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn progress_shows_until_the_work_is_done() {
        let terminal = Terminal::default();
        let target = || ProgressDrawTarget::term_like(Box::new(terminal.clone()));
        let progress = Progress::hidden(Some(2000));
        progress.wrap(&[0; 500][..]).read_exact(&mut [0; 500]).unwrap();
        progress.say("searching 7 spheres");
        assert_eq!(*terminal.0.lock().unwrap(), "");
        show(&progress.bar, target());
        let shown = terminal.0.lock().unwrap().clone();
        assert!(shown.contains("searching 7 spheres") && shown.contains("500 B/"), "{shown}");

        let finished = Progress::hidden(None);
        let bar = finished.bar.clone();
        drop(finished);
        drop(progress);
        terminal.0.lock().unwrap().clear();
        show(&bar, target());
        assert!(!terminal.0.lock().unwrap().contains("searching"));
    }
}
