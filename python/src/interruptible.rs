//! Calls that release the interpreter's lock and that Ctrl-C ends.
//!
//! Python handles signals in its main thread only. A long call therefore works in another thread while its own polls
//! for signals. A signal sets the flag that ends the search. The call returns after the search, so the caller may
//! change the arrays again.

use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::thread::{self, Builder};
use std::time::Duration;

use lazygrid::start_thread;
use pyo3::prelude::*;

/// At or above this number of spheres a call uses another thread. A smaller call takes milliseconds, or a second if all
/// spheres coincide.
const MIN_THREADED_SPHERES: usize = 1 << 15;

/// Below this number of spheres a CPU call keeps the interpreter's lock: releasing it would add a tenth to some
/// microseconds.
const MIN_UNLOCKED_SPHERES: usize = 1 << 6;

pub(crate) const SIGNAL_POLL: Duration = Duration::from_millis(20);

pub(crate) struct Work {
    pub(crate) spheres: usize,
    pub(crate) can_hold_lock: bool,
}

/// Runs `work`, which ends soon after `cancel` becomes true, and returns the exception of a signal's handler, such as
/// `KeyboardInterrupt`.
pub(crate) fn interruptible<R: Send>(
    py: Python<'_>,
    Work { spheres, can_hold_lock }: Work,
    cancel: &AtomicBool,
    work: impl FnOnce() -> R + Send,
) -> PyResult<R> {
    match spheres {
        0..MIN_UNLOCKED_SPHERES if can_hold_lock => Ok(work()),
        0..MIN_THREADED_SPHERES => Ok(py.detach(work)),
        _ => py.detach(|| poll_signals(cancel, work)),
    }
}

pub(crate) fn poll_signals<R: Send>(cancel: &AtomicBool, work: impl FnOnce() -> R + Send) -> PyResult<R> {
    thread::scope(|scope| {
        let (done_sender, finished) = sync_channel(1);
        let work = move || {
            let result = work();
            // The receiver also notices a dropped sender.
            let _ = done_sender.send(());
            result
        };
        let thread = Builder::new().name("lazygrid".into());
        let worker = start_thread(|| thread.spawn_scoped(scope, work)).map_err(crate::error::engine)?;
        let mut signal = None;
        while let Err(RecvTimeoutError::Timeout) = finished.recv_timeout(SIGNAL_POLL) {
            if let Err(raised) = Python::attach(|py| py.check_signals()) {
                signal.get_or_insert(raised);
                cancel.store(true, Ordering::Relaxed);
            }
        }
        let result = worker.join().unwrap_or_else(|panic| resume_unwind(panic));
        cancel.store(false, Ordering::Relaxed);
        signal.map_or(Ok(result), Err)
    })
}
