//! How a call is made: without the interpreter's lock, and so that Ctrl-C ends it.
//!
//! Python sees signals in its main thread only. So where a call may take long a thread of its own works while the
//! calling one looks for signals now and then; a signal raises the flag that ends the search, and the call returns when
//! it has ended. Nothing goes on behind the caller's back, who may change the arrays again.

use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::thread::{self, Builder};
use std::time::Duration;

use lazygrid::Error;
use pyo3::prelude::*;

/// Calls of fewer spheres are over before anybody could lose patience, but for a crowd in one place, which takes a
/// second: they are spared the thread.
const LONG: usize = 1 << 15;

/// Between two looks at signals.
pub(crate) const GLANCE: Duration = Duration::from_millis(20);

/// Does `work` for this number of spheres. Once `stop` is true it must end soon.
///
/// # Errors
/// What a signal's handler raised, such as `KeyboardInterrupt`; a thread that the system refused.
pub(crate) fn call<R: Send>(
    py: Python<'_>,
    spheres: usize,
    stop: &AtomicBool,
    work: impl FnOnce() -> R + Send,
) -> PyResult<R> {
    match spheres < LONG {
        true => Ok(py.detach(work)),
        false => py.detach(|| watched(stop, work)),
    }
}

fn watched<R: Send>(stop: &AtomicBool, work: impl FnOnce() -> R + Send) -> PyResult<R> {
    thread::scope(|scope| {
        let (done, finished) = sync_channel(1);
        let worker = Builder::new().name("lazygrid".into()).spawn_scoped(scope, move || {
            let result = work();
            // Who waits sees also that the sender is gone.
            let _ = done.send(());
            result
        });
        let refused = |error: std::io::Error| Error::Threads { threads: 1, reason: error.to_string() };
        let worker = worker.map_err(|error| crate::error::engine(refused(error)))?;
        let mut signal = None;
        while let Err(RecvTimeoutError::Timeout) = finished.recv_timeout(GLANCE) {
            if let Err(raised) = Python::attach(|py| py.check_signals()) {
                signal.get_or_insert(raised);
                stop.store(true, Ordering::Relaxed);
            }
        }
        let result = worker.join().unwrap_or_else(|panic| resume_unwind(panic));
        stop.store(false, Ordering::Relaxed);
        signal.map_or(Ok(result), Err)
    })
}
