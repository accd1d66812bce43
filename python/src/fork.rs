//! What becomes of threads when a process is copied: they are gone. Work that waits for them would never end, so a copy of
//! a process that had started them refuses to begin any.

use std::sync::atomic::{AtomicBool, Ordering};

use pyo3::prelude::*;

use crate::error;

/// Whether this process, or one that it is a copy of, has made use of a pool of threads.
static STARTED: AtomicBool = AtomicBool::new(false);
/// Whether that was before this process was copied.
static GONE: AtomicBool = AtomicBool::new(false);

/// Sees to it that copies know what they are.
///
/// # Errors
/// Those of Python's `os.register_at_fork`.
pub(crate) fn watch(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let os = module.py().import("os")?;
    // There is none where processes are not copied.
    if let Ok(register) = os.getattr("register_at_fork") {
        let keywords = [("after_in_child", pyo3::wrap_pyfunction!(forked, module)?)];
        register.call((), Some(&pyo3::types::IntoPyDict::into_py_dict(keywords, module.py())?))?;
    }
    Ok(())
}

#[pyfunction]
fn forked() {
    GONE.store(STARTED.load(Ordering::Relaxed), Ordering::Relaxed);
}

/// Asked before threads are made use of.
///
/// # Errors
/// `Error` where they are gone.
pub(crate) fn use_threads() -> PyResult<()> {
    if GONE.load(Ordering::Relaxed) {
        return Err(error::other(
            "this process was copied (os.fork) from one in which lazygrid had started threads, which are not copied; let \
             multiprocessing start processes by \"spawn\" or \"forkserver\", or use Detector(threads=1) in both",
        ));
    }
    STARTED.store(true, Ordering::Relaxed);
    Ok(())
}
