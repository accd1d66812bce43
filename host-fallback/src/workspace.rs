//! Buffers that are lent to whichever piece of work needs some, and survive between calls.

use std::sync::{Mutex, PoisonError};

/// Buffers nobody uses at the moment. There are as many as were ever in use at once.
#[derive(Debug, Default)]
pub(crate) struct Workspaces<T>(Mutex<Vec<T>>);

impl<T: Default> Workspaces<T> {
    /// Lends one to `work`.
    pub(crate) fn lend<R>(&self, work: impl FnOnce(&mut T) -> R) -> R {
        let spare = self.0.lock().unwrap_or_else(PoisonError::into_inner).pop();
        let mut workspace = spare.unwrap_or_default();
        let result = work(&mut workspace);
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(workspace);
        result
    }
}
