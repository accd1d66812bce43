//! Calls that release the interpreter's lock and that Ctrl-C ends.
//!
//! Python handles signals in its main thread only. A long call therefore works in a thread of its own, while the
//! calling thread polls for signals. A signal sets the flag that ends the search, and the call returns when the search
//! has ended, so the caller may change the arrays again.

use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::thread::{self, Builder};
use std::time::Duration;

use lazygrid::Error;
use pyo3::prelude::*;

/// At or above this number of spheres a call works in a thread of its own. A smaller call takes milliseconds, or a
/// second if all spheres coincide.
const MIN_THREADED_SPHERES: usize = 1 << 15;

/// Below this number of spheres a call on the CPU keeps the interpreter's lock: releasing it would add a tenth to some
/// microseconds.
const MIN_UNLOCKED_SPHERES: usize = 1 << 6;

/// The time between two polls for signals.
pub(crate) const SIGNAL_POLL: Duration = Duration::from_millis(20);

/// The size of a call's work.
pub(crate) struct Work {
    /// The number of spheres.
    pub(crate) spheres: usize,
    pub(crate) can_hold_lock: bool,
}

/// Runs `work`, which ends soon after `cancel` becomes true.
///
/// # Errors
/// The exception of a signal's handler, such as `KeyboardInterrupt`; an error if the system refuses a thread.
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

fn poll_signals<R: Send>(cancel: &AtomicBool, work: impl FnOnce() -> R + Send) -> PyResult<R> {
    thread::scope(|scope| {
        let (done, finished) = sync_channel(1);
        let worker = Builder::new().name("lazygrid".into()).spawn_scoped(scope, move || {
            let result = work();
            // The receiver also notices a sender that is dropped.
            let _ = done.send(());
            result
        });
        let refused = |error: std::io::Error| Error::ThreadPool { threads: 1, reason: error.to_string() };
        let worker = worker.map_err(|error| crate::error::engine(refused(error)))?;
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
