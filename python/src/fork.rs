//! Detection of forked processes, which lack the threads of their parent. A forked process whose parent had started
//! threads refuses calls.

use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use pyo3::prelude::*;

use crate::error;

static STARTED: AtomicBool = AtomicBool::new(false);
static PARENT_STARTED: AtomicBool = AtomicBool::new(false);

static COPIES: AtomicU32 = AtomicU32::new(0);

#[derive(Clone, Copy, Debug)]
pub(crate) struct Process(u32);

impl Process {
    pub(crate) fn current() -> Self {
        Self(COPIES.load(Ordering::Relaxed))
    }

    /// Returns `false` in a copy of this process.
    pub(crate) fn is_current(self) -> bool {
        self.0 == COPIES.load(Ordering::Relaxed)
    }

    /// Returns an `Error` in a copy of this process.
    pub(crate) fn check(self) -> PyResult<()> {
        if self.is_current() { Ok(()) } else { Err(forked_process_error()) }
    }
}

/// Registers a handler that runs in forked processes.
pub(crate) fn watch(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let os = module.py().import("os")?;
    // Platforms without fork have no such function.
    if let Ok(register) = os.getattr("register_at_fork") {
        let keywords = [("after_in_child", pyo3::wrap_pyfunction!(forked, module)?)];
        register.call((), Some(&pyo3::types::IntoPyDict::into_py_dict(keywords, module.py())?))?;
    }
    Ok(())
}

#[pyfunction]
fn forked() {
    COPIES.fetch_add(1, Ordering::Relaxed);
    PARENT_STARTED.store(STARTED.load(Ordering::Relaxed), Ordering::Relaxed);
}

/// Records the use of threads; an `Error` in a forked process whose parent has used threads.
pub(crate) fn use_threads() -> PyResult<()> {
    if PARENT_STARTED.load(Ordering::Relaxed) {
        return Err(forked_process_error());
    }
    STARTED.store(true, Ordering::Relaxed);
    Ok(())
}

/// Refuses as [`use_threads`] does, and starts rayon's global pool, which would panic later if the system refused its
/// threads.
pub(crate) fn use_global_threads() -> PyResult<()> {
    use_threads()?;
    lazygrid::start_threads().map_err(error::engine)
}

fn forked_process_error() -> PyErr {
    error::other(
        "this process was copied (os.fork) from one in which lazygrid had started threads, which are not copied; let \
         multiprocessing start processes by \"spawn\" or \"forkserver\", or use Detector(threads=1) in both",
    )
}
