use std::sync::{Mutex, PoisonError};

use crate::Error;
use crate::memory::try_push;

/// Keeps all buffers that were ever in use at once.
#[derive(Debug, Default)]
pub(crate) struct Workspaces<T>(Mutex<Vec<T>>);

impl<T: Default> Workspaces<T> {
    pub(crate) fn lend<R>(&self, work: impl FnOnce(&mut T) -> Result<R, Error>) -> Result<R, Error> {
        let spare = self.0.lock().unwrap_or_else(PoisonError::into_inner).pop();
        let mut workspace = spare.unwrap_or_default();
        let result = work(&mut workspace)?;
        try_push(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner), workspace, "workspaces")?;
        Ok(result)
    }
}
