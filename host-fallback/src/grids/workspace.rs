use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::Error;
use crate::memory::try_push;

/// Buffers of threads, kept for reuse.
#[derive(Debug, Default)]
pub(crate) struct Workspaces<T>(Mutex<Vec<T>>);

impl<T: Default> Workspaces<T> {
    /// Takes a workspace, which [`give_back`](Self::give_back) returns. A thread should not keep one while it waits for
    /// others: it may then execute their work, with one more workspace.
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

    /// Drops all workspaces except the largest. Workspaces grow with the cells that their threads compare, so after
    /// some calls each might be as large as the largest cell.
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

/// Returns the most spheres in all workspaces. The [largest](Workspaces::keep_largest) may contain all spheres, and
/// during a call each of the (cell, sphere) `entries` is in one workspace.
pub(crate) fn most_members(spheres: u64, entries: u64, threads: u64) -> u64 {
    spheres.saturating_mul(threads).min(spheres + entries)
}
