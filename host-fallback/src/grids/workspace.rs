//! Buffers that are lent to whichever piece of work needs some, and survive between calls.

use std::sync::{Mutex, PoisonError};

use crate::Error;
use crate::memory::try_push;

/// Buffers nobody uses at the moment. There are as many as were ever in use at once.
#[derive(Debug, Default)]
pub(crate) struct Workspaces<T>(Mutex<Vec<T>>);

impl<T: Default> Workspaces<T> {
    /// Lends one to `work`. Where that fails it does not come back, with whatever is half done in it.
    ///
    /// # Errors
    /// The errors of `work`.
    pub(crate) fn lend<R>(&self, work: impl FnOnce(&mut T) -> Result<R, Error>) -> Result<R, Error> {
        let spare = self.0.lock().unwrap_or_else(PoisonError::into_inner).pop();
        let mut workspace = spare.unwrap_or_default();
        let result = work(&mut workspace)?;
        try_push(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner), workspace, "workspaces")?;
        Ok(result)
    }
}
