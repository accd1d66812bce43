//! Hidden incomplete files, `.lazygrid-HOST-RANDOM.part`, which the writing process locks. The host's next
//! process that writes to the directory removes unlocked files of killed processes.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use same_file::Handle;
use tempfile::TempPath;

const PREFIX: &str = ".lazygrid-";
const SUFFIX: &str = ".part";
const RANDOM: usize = 12;

/// Unfinished files of this process, and directories searched for orphans.
static UNFINISHED_FILES: Mutex<UnfinishedFiles> =
    Mutex::new(UnfinishedFiles { files: Vec::new(), swept: Vec::new() });

struct UnfinishedFiles {
    files: Vec<PathBuf>,
    swept: Vec<PathBuf>,
}

fn unfinished_files() -> MutexGuard<'static, UnfinishedFiles> {
    UNFINISHED_FILES.lock().unwrap_or_else(PoisonError::into_inner)
}

#[derive(Debug)]
pub(super) struct Temporary {
    path: Option<TempPath>,
    /// Holds the lock.
    pub(super) file: File,
}

impl Temporary {
    pub(super) fn create(directory: &Path) -> io::Result<(File, Self)> {
        let mut unfinished_files = unfinished_files();
        if !unfinished_files.swept.iter().any(|swept| swept == directory) {
            unfinished_files.swept.push(directory.to_owned());
            sweep(directory);
        }
        let prefix = prefix();
        let mut builder = tempfile::Builder::new();
        builder.prefix(&prefix).suffix(SUFFIX).rand_bytes(RANDOM);
        let (file, path) = builder.make_in(directory, create_locked)?.into_parts();
        let out = file.try_clone()?;
        unfinished_files.files.push(path.to_path_buf());
        Ok((out, Self { path: Some(path), file }))
    }

    pub(super) fn sync(&self) -> io::Result<()> {
        self.file.sync_data()
    }

    pub(super) fn rename(mut self, path: &Path) -> io::Result<()> {
        let mut unfinished_files = unfinished_files();
        let Some(temporary) = self.path.take() else { return Ok(()) };
        unfinished_files.files.retain(|file| **file != *temporary);
        temporary.persist(path).map_err(|error| error.error)
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        if let Some(temporary) = self.path.take() {
            let mut unfinished_files = unfinished_files();
            unfinished_files.files.retain(|file| **file != *temporary);
            drop(temporary);
        }
    }
}

/// Removes all uncommitted files of this process, for signal handlers. Later uses of this module block until
/// the process ends.
pub fn remove_temporaries() {
    let unfinished_files = unfinished_files();
    for file in &unfinished_files.files {
        // The next use of the directory retries.
        let _ = fs::remove_file(file);
    }
    std::mem::forget(unfinished_files);
}

/// Creates a locked file, since another process could take an unlocked one for an orphan.
fn create_locked(path: &Path) -> io::Result<File> {
    let file = File::options().write(true).create_new(true).open(path)?;
    let taken = io::Error::from(io::ErrorKind::AlreadyExists);
    match file.try_lock() {
        Err(fs::TryLockError::WouldBlock) => Err(taken),
        Ok(()) if !is_at(&file, path) => Err(taken),
        Ok(()) | Err(fs::TryLockError::Error(_)) => Ok(file),
    }
}

fn sweep(directory: &Path) {
    let Ok(entries) = fs::read_dir(directory) else { return };
    let prefix = prefix();
    for entry in entries.flatten() {
        let is_file = entry.file_type().is_ok_and(|kind| kind.is_file());
        if is_file && entry.file_name().to_str().is_some_and(|name| is_temporary(name, &prefix)) {
            remove_orphan(&entry.path());
        }
    }
}

fn remove_orphan(path: &Path) {
    let Ok(file) = File::options().write(true).open(path) else { return };
    if file.try_lock().is_ok() && is_at(&file, path) && fs::remove_file(path).is_ok() {
        log::info!("{}: removed; it was left by a run that was killed", path.display());
    }
}

fn is_at(file: &File, path: &Path) -> bool {
    let open = file.try_clone().and_then(Handle::from_file);
    matches!((open, Handle::from_path(path)), (Ok(open), Ok(named)) if open == named)
}

/// Contains the host, since locks may not work over a network.
fn prefix() -> String {
    let host = gethostname::gethostname();
    let plain = |c: char| if c.is_ascii_alphanumeric() || c == '.' { c } else { '_' };
    let host: String = host.to_string_lossy().chars().map(plain).take(64).collect();
    format!("{PREFIX}{host}-")
}

fn is_temporary(name: &str, prefix: &str) -> bool {
    let random = name.strip_prefix(prefix).and_then(|name| name.strip_suffix(SUFFIX));
    random.is_some_and(|r| r.len() == RANDOM && r.bytes().all(|b| b.is_ascii_alphanumeric()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_abandoned_files_are_removed() {
        let directory = tempfile::tempdir().unwrap();
        let at = |name: &str| directory.path().join(name);
        let own_prefix = prefix();
        let live = File::create(at(&format!("{own_prefix}abcdefghijk0.part"))).unwrap();
        live.lock().unwrap();
        let retained = [
            format!("{own_prefix}abcdefghijk.part"),
            format!("{own_prefix}abcdefghijk-.part"),
            format!("{own_prefix}abcdefghijk0.csv"),
            format!("{PREFIX}another.host-abcdefghijk0.part"),
            ".lazygrid-notes".to_owned(),
            "pairs.csv".to_owned(),
        ];
        for name in &retained {
            fs::write(at(name), "mine").unwrap();
        }
        fs::create_dir(at(&format!("{own_prefix}abcdefghijk2.part"))).unwrap();
        fs::write(at(&format!("{own_prefix}abcdefghijk1.part")), "orphaned").unwrap();
        sweep(directory.path());
        assert!(!at(&format!("{own_prefix}abcdefghijk1.part")).exists());
        assert!(at(&format!("{own_prefix}abcdefghijk0.part")).exists());
        assert_eq!(fs::read_dir(directory.path()).unwrap().count(), retained.len() + 2);
        drop(live);
        sweep(directory.path());
        assert_eq!(fs::read_dir(directory.path()).unwrap().count(), retained.len() + 1);
    }

    #[test]
    fn a_file_in_the_making_is_locked() {
        let directory = tempfile::tempdir().unwrap();
        let (file, temporary) = Temporary::create(directory.path()).unwrap();
        sweep(directory.path());
        assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 1);
        temporary.rename(&directory.path().join("a.csv")).unwrap();
        drop(file);
        sweep(directory.path());
        assert!(directory.path().join("a.csv").exists());
        drop(Temporary::create(directory.path()).unwrap());
        assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 1);
    }
}
