//! The lock of a directory: one run at a time writes to it.

use std::fs::{File, OpenOptions, TryLockError};
use std::io;
use std::path::Path;

use crate::Error;

/// A lock that keeps other runs out of a directory. It is a file lock of the system on `.lock`, which ends with the process.
/// The file itself remains and has no meaning.
#[derive(Debug)]
pub(crate) struct Lock {
    _file: File,
}

impl Lock {
    /// Locks a directory that exists.
    ///
    /// # Errors
    /// [`Error::Write`], also where another run holds it.
    pub(crate) fn take(directory: &Path) -> Result<Self, Error> {
        let refused = |source| Error::Write { path: directory.to_owned(), source };
        let open = OpenOptions::new().create(true).truncate(false).write(true).open(directory.join(".lock"));
        let file = open.map_err(refused)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                let message =
                    "another run is writing to it; wait until that has ended, or choose another directory";
                return Err(refused(io::Error::new(io::ErrorKind::ResourceBusy, message)));
            }
            // Some network file systems have no locks.
            Err(TryLockError::Error(error)) => log::warn!(
                "{}: cannot be locked ({error}); see to it that no other run writes to it",
                directory.display()
            ),
        }
        Ok(Self { _file: file })
    }
}
