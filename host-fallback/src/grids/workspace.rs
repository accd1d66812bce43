use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::Error;
use crate::memory::try_push;

#[derive(Debug, Default)]
pub(crate) struct Workspaces<T>(Mutex<Vec<T>>);

impl<T: Default> Workspaces<T> {
    /// A thread that waits for others may execute their work, so it should keep no workspace meanwhile.
    pub(crate) fn take(&self) -> T {
        self.lock().pop().unwrap_or_default()
    }

    pub(crate) fn give_back(&self, workspace: T) -> Result<(), Error> {
        try_push(&mut self.lock(), workspace, "workspaces")
    }

    pub(crate) fn lend<R>(&self, work: impl FnOnce(&mut T) -> Result<R, Error>) -> Result<R, Error> {
        let mut workspace = self.take();
        let result = work(&mut workspace)?;
        self.give_back(workspace)?;
        Ok(result)
    }

    /// Workspaces grow with compared cells, so each might become as large as the largest cell.
    pub(crate) fn keep_largest(&mut self, bytes: impl Fn(&T) -> usize) {
        let all = self.0.get_mut().unwrap_or_else(PoisonError::into_inner);
        let largest = (0..all.len()).max_by_key(|&k| bytes(&all[k]));
        if let Some(largest) = largest {
            all.swap(0, largest);
            all.truncate(1);
        }
    }

    fn lock(&self) -> MutexGuard<'_, Vec<T>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The [largest](Workspaces::keep_largest) may contain all spheres; during a call each entry is in one workspace.
pub(crate) fn most_members(spheres: u64, entries: u64, threads: u64) -> u64 {
    spheres.saturating_mul(threads).min(spheres + entries)
}
