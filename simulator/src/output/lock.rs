use std::fs::{File, FileType, OpenOptions, TryLockError};
use std::io::{self, Read, Seek, Write};
use std::path::{Path, PathBuf};

use super::PLOTS;
use super::directory::is_regular;
use crate::Error;

/// Prefix of incomplete files, before random letters and digits.
pub(super) const TEMPORARY: &str = ".lazygrid-draft-";
pub(super) const RANDOM_LETTERS: usize = 6;

const LOCK: &str = ".lock";

/// Keeps other runs out of a directory: a system lock on the file `.lock`, which ends with the process.
#[derive(Debug)]
pub(crate) struct Lock {
    path: PathBuf,
    file: File,
}

impl Lock {
    pub(crate) fn acquire(directory: &Path) -> Result<Self, Error> {
        refuse_pipes(directory)?;
        let refused = |source| Error::Write { path: directory.to_owned(), source };
        let path = directory.join(LOCK);
        let open = OpenOptions::new().create(true).truncate(false).read(true).write(true).open(&path);
        let file = open.map_err(refused)?;
        match file.try_lock() {
            // The lock excludes other writers.
            Ok(()) => {
                remove_temporaries(directory);
                remove_temporaries(&directory.join(PLOTS));
            }
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
        Ok(Self { path, file })
    }

    /// Marks files as those of a run with this seed, in case it loses its checkpoint. Changes neither a `.lock` of
    /// another program nor the target of a link.
    pub(crate) fn mark_begun(&self, seed: u64) -> Result<(), Error> {
        let written = self.write_mark(seed);
        written.map_err(|source| Error::Write { path: self.path.clone(), source })
    }

    fn write_mark(&self, seed: u64) -> io::Result<()> {
        let mut file = &self.file;
        let mut start = Vec::new();
        file.rewind()?;
        file.take(BEGUN.len() as u64).read_to_end(&mut start)?;
        // A full disk may have cut the last mark.
        if !is_regular(&self.path) || !BEGUN.as_bytes().starts_with(&start) {
            return Ok(());
        }
        file.set_len(0)?;
        file.rewind()?;
        file.write_all(mark(seed).as_bytes())?;
        file.sync_data()
    }
}

/// Begins the mark.
const BEGUN: &str = "begun with seed ";

fn mark(seed: u64) -> String {
    format!("{BEGUN}{seed}\n")
}

pub(crate) fn has_begun(directory: &Path, seed: u64) -> bool {
    let path = directory.join(LOCK);
    is_regular(&path) && std::fs::read(path).is_ok_and(|content| content == mark(seed).as_bytes())
}

/// Opening a named pipe instead of a file would wait for another program.
fn refuse_pipes(directory: &Path) -> Result<(), Error> {
    for entry in std::fs::read_dir(directory).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.metadata().is_ok_and(|data| is_pipe(data.file_type())) {
            let message = "it is a pipe; remove it, or choose another directory";
            return Err(Error::Write { path, source: io::Error::new(io::ErrorKind::InvalidInput, message) });
        }
    }
    Ok(())
}

#[cfg(unix)]
fn is_pipe(kind: FileType) -> bool {
    use std::os::unix::fs::FileTypeExt;

    kind.is_fifo() || kind.is_socket()
}

#[cfg(not(unix))]
fn is_pipe(_: FileType) -> bool {
    false
}

fn remove_temporaries(directory: &Path) {
    let Ok(entries) = std::fs::read_dir(directory) else { return };
    for entry in entries.flatten() {
        let name = entry.file_name();
        let random = name.to_str().and_then(|name| name.strip_prefix(TEMPORARY));
        let is_temporary = random.is_some_and(|random| {
            random.len() == RANDOM_LETTERS && random.bytes().all(|b| b.is_ascii_alphanumeric())
        });
        let is_draft = is_temporary && entry.file_type().is_ok_and(|kind| kind.is_file());
        if is_draft && std::fs::remove_file(entry.path()).is_ok() {
            log::info!("{}: removed; a run that was killed had left it", entry.path().display());
        }
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn lock_removes_incomplete_files_of_killed_runs_only() {
        let directory = tempfile::tempdir().unwrap();
        let at = |name: &str| directory.path().join(name);
        let retained = [
            ".draft-thesis",
            ".lazygrid-draft-notes",
            ".lazygrid-draft-",
            "lazygrid-draft-abc123",
            ".lazygrid-draft-abc-12",
            "series.csv",
        ];
        retained.iter().for_each(|name| fs::write(at(name), "mine").unwrap());
        fs::create_dir(at(".lazygrid-draft-folder")).unwrap();
        fs::create_dir(at(PLOTS)).unwrap();
        let left = [".lazygrid-draft-aB3xY9", "plots/.lazygrid-draft-aB3xY9"];
        left.iter().for_each(|name| fs::write(at(name), "left").unwrap());
        let lock = Lock::acquire(directory.path()).unwrap();
        assert!(left.iter().all(|name| !at(name).exists()));
        assert!(retained.iter().all(|name| at(name).exists()) && at(".lazygrid-draft-folder").exists());
        fs::write(at(".lazygrid-draft-aB3xY9"), "being written").unwrap();
        assert!(Lock::acquire(directory.path()).is_err());
        assert!(at(".lazygrid-draft-aB3xY9").exists());
        drop(lock);
    }

    #[test]
    fn mark_replaces_marks_only() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join(LOCK);
        let marked = |content: &str| {
            fs::write(&path, content).unwrap();
            Lock::acquire(directory.path()).unwrap().mark_begun(7).unwrap();
            fs::read_to_string(&path).unwrap()
        };
        for mark in ["", "begun wi", "begun with seed 123456\n"] {
            assert_eq!(marked(mark), "begun with seed 7\n", "{mark:?}");
            assert!(has_begun(directory.path(), 7) && !has_begun(directory.path(), 8));
        }
        for foreign in ["4711\n", "begun without\n", " "] {
            assert_eq!(marked(foreign), foreign);
            assert!(!has_begun(directory.path(), 7));
        }
    }

    #[cfg(unix)]
    #[test]
    fn mark_does_not_follow_links() {
        let directory = tempfile::tempdir().unwrap();
        let [target, path] = ["target", LOCK].map(|name| directory.path().join(name));
        std::os::unix::fs::symlink(&target, &path).unwrap();
        for content in ["", "begun with seed 7\n", "the work of years\n"] {
            fs::write(&target, content).unwrap();
            Lock::acquire(directory.path()).unwrap().mark_begun(8).unwrap();
            assert_eq!(fs::read_to_string(&target).unwrap(), content);
            assert!(!has_begun(directory.path(), 7));
        }
    }
}
