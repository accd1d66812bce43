use std::fmt;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use super::encoder::{Encoder, encoder};
use super::temporary::Temporary;
use crate::Error;

/// A file with a temporary name until it is committed, else removed; compressed for `.gz` and `.zst`.
#[must_use = "a file that is not published disappears"]
pub struct AtomicFile {
    path: PathBuf,
    temporary: Option<Temporary>,
    out: Box<dyn Encoder>,
}

impl AtomicFile {
    /// Creates an empty file, and removes temporary files of killed processes. FIFOs and devices cannot be
    /// replaced and are written directly.
    ///
    /// # Errors
    /// [`Error::Write`] if the directory accepts no new file.
    pub fn create(path: impl Into<PathBuf>) -> Result<Self, Error> {
        let path = path.into();
        if fs::metadata(&path).is_ok_and(|there| !there.is_file() && !there.is_dir()) {
            let opened = File::options().write(true).open(&path);
            return Self::at_once(path, opened);
        }
        let directory = match path.parent() {
            Some(parent) if parent != Path::new("") => parent,
            _ => Path::new("."),
        };
        let created =
            Temporary::create(directory).and_then(|(file, temporary)| Ok((temporary, encoder(&path, file)?)));
        match created {
            Ok((temporary, out)) => Ok(Self { path, temporary: Some(temporary), out }),
            Err(source) => Err(Error::Write { path, source }),
        }
    }

    /// Writes to standard output.
    ///
    /// # Errors
    /// [`Error::Write`].
    pub fn stdout() -> Result<Self, Error> {
        Self::at_once(PathBuf::from(STDOUT), Ok(io::stdout()))
    }

    fn at_once(path: PathBuf, to: io::Result<impl Write + Send + 'static>) -> Result<Self, Error> {
        match to.and_then(|to| encoder(&path, to)) {
            Ok(out) => Ok(Self { path, temporary: None, out }),
            Err(source) => Err(Error::Write { path, source }),
        }
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Writes to the file.
    ///
    /// # Errors
    /// [`Error::Write`] with the system's error.
    pub fn write_with(&mut self, write: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<(), Error> {
        write(&mut self.out).map_err(|source| Error::Write { path: self.path.clone(), source })
    }

    /// Syncs the file to the disk, under the temporary name.
    ///
    /// # Errors
    /// [`Error::Write`], also if the disk is full.
    pub fn finish(self) -> Result<CompleteFile, Error> {
        let Self { path, temporary, out } = self;
        // Network file systems may report a full disk only here.
        let synced = out.finish().and_then(|()| temporary.as_ref().map_or(Ok(()), Temporary::sync));
        match synced {
            Ok(()) => Ok(CompleteFile { path, temporary }),
            Err(source) => Err(Error::Write { path, source }),
        }
    }

    /// Finishes the file and renames it over an existing one.
    ///
    /// # Errors
    /// [`Error::Write`].
    pub fn commit(self) -> Result<(), Error> {
        Self::commit_all([self])
    }

    /// Finishes all files before it renames the first, so a full disk replaces none.
    ///
    /// # Errors
    /// [`Error::Write`].
    pub fn commit_all(files: impl IntoIterator<Item = Self>) -> Result<(), Error> {
        let complete = files.into_iter().map(Self::finish).collect::<Result<Vec<_>, _>>()?;
        complete.into_iter().try_for_each(CompleteFile::commit)
    }
}

/// A synced file without its final name; removed unless committed.
#[derive(Debug)]
#[must_use = "a file that is not committed disappears"]
pub struct CompleteFile {
    path: PathBuf,
    temporary: Option<Temporary>,
}

impl CompleteFile {
    /// Renames the file over an existing one.
    ///
    /// # Errors
    /// [`Error::Write`].
    pub fn commit(self) -> Result<(), Error> {
        let Self { path, temporary } = self;
        temporary.map_or(Ok(()), |file| file.rename(&path)).map_err(|source| Error::Write { path, source })
    }
}

impl fmt::Debug for AtomicFile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("AtomicFile").field("path", &self.path).finish_non_exhaustive()
    }
}

pub(super) const STDOUT: &str = "standard output";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_draft_appears_when_it_is_published_and_not_before() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.csv");
        std::fs::write(&path, "old").unwrap();
        let mut file = AtomicFile::create(&path).unwrap();
        file.write_with(|out| out.write_all(b"new")).unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "old");
        file.commit().unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "new");
        drop(AtomicFile::create(&path).unwrap());
        assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 1);
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn device_is_not_replaced() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("null.csv");
        std::os::unix::fs::symlink("/dev/null", &path).unwrap();
        let mut file = AtomicFile::create(&path).unwrap();
        file.write_with(|out| out.write_all(b"new")).unwrap();
        file.commit().unwrap();
        assert_eq!(fs::read_link(&path).unwrap(), Path::new("/dev/null"));
        let full = directory.path().join("full.csv");
        std::os::unix::fs::symlink("/dev/full", &full).unwrap();
        let mut file = AtomicFile::create(&full).unwrap();
        file.write_with(|out| out.write_all(b"fits the buffer")).unwrap();
        assert!(file.commit().unwrap_err().to_string().contains("No space left"));
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn a_full_disk_is_an_error_and_leaves_nothing() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.npy");
        let (_, temporary) = Temporary::create(directory.path()).unwrap();
        let full = File::options().write(true).open("/dev/full").unwrap();
        let out = encoder(&path, full).unwrap();
        let mut file = AtomicFile { path: path.clone(), temporary: Some(temporary), out };
        file.write_with(|out| out.write_all(b"fits the buffer")).unwrap();
        let error = file.commit().unwrap_err().to_string();
        assert_eq!(error, format!("{}: cannot write: No space left on device (os error 28)", path.display()));
        assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 0);
    }

    #[test]
    #[cfg(unix)]
    fn disk_that_reports_its_end_late_is_an_error_and_leaves_nothing() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.npy");
        let (file, mut temporary) = Temporary::create(directory.path()).unwrap();
        // Pipes cannot be synced.
        let (_reader, pipe) = io::pipe().unwrap();
        temporary.file = File::from(std::os::fd::OwnedFd::from(pipe));
        let out = encoder(&path, file).unwrap();
        let mut file = AtomicFile { path: path.clone(), temporary: Some(temporary), out };
        file.write_with(|out| out.write_all(b"new")).unwrap();
        let error = file.commit().unwrap_err().to_string();
        assert!(error.starts_with(&format!("{}: cannot write: Invalid argument", path.display())), "{error}");
        assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 0);
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn full_disk_of_the_last_file_leaves_the_names_of_all() {
        let directory = tempfile::tempdir().unwrap();
        let [first, full] = ["a.npy", "b.npy"].map(|name| directory.path().join(name));
        std::fs::write(&first, "old").unwrap();
        std::os::unix::fs::symlink("/dev/full", &full).unwrap();
        let mut files = [&first, &full].map(|path| AtomicFile::create(path).unwrap());
        files.iter_mut().for_each(|file| file.write_with(|out| out.write_all(b"new")).unwrap());
        assert!(AtomicFile::commit_all(files).unwrap_err().to_string().contains("No space left"));
        assert_eq!(std::fs::read_to_string(&first).unwrap(), "old");
        assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 2);
    }
}
