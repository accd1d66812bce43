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
    /// The path without symbolic links at its end.
    target: PathBuf,
    temporary: Option<Temporary>,
    out: Box<dyn Encoder>,
}

impl AtomicFile {
    /// Creates an empty file, and removes temporary files of killed processes. It will replace the target of a symbolic
    /// link, and keep the permissions of a replaced file. FIFOs, devices and open files, such as `/dev/fd/3`, cannot be
    /// replaced and are written directly.
    ///
    /// # Errors
    /// [`Error::Write`] if the directory accepts no new file.
    pub fn create(path: impl Into<PathBuf>) -> Result<Self, Error> {
        let path = path.into();
        let (there, target) = (fs::metadata(&path), target(&path));
        if is_open_file(&target) || there.as_ref().is_ok_and(|there| !there.is_file() && !there.is_dir()) {
            let opened = File::options().write(true).open(&path);
            return Self::at_once(path, opened);
        }
        let created = Temporary::create(directory_of(&target)).and_then(|(file, temporary)| {
            if let Ok(there) = there.as_ref().map(fs::Metadata::permissions) {
                // A read-only target is replaced like any other.
                if !there.readonly() {
                    file.set_permissions(there)?;
                }
            }
            Ok((temporary, encoder(&path, file)?))
        });
        match created {
            Ok((temporary, out)) => Ok(Self { path, target, temporary: Some(temporary), out }),
            Err(source) => Err(Error::Write { path, source }),
        }
    }

    /// Creates a file, or writes to standard output for `-`.
    ///
    /// # Errors
    /// See [`create`](Self::create).
    pub fn create_or_stdout(path: &Path) -> Result<Self, Error> {
        if path == Path::new("-") { Self::stdout() } else { Self::create(path) }
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
            Ok(out) => Ok(Self { target: path.clone(), path, temporary: None, out }),
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
        let Self { path, target, temporary, out } = self;
        // Network file systems may report a full disk only here.
        let synced = out.finish().and_then(|()| temporary.as_ref().map_or(Ok(()), Temporary::sync));
        match synced {
            Ok(()) => Ok(CompleteFile { path, target, temporary }),
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
    target: PathBuf,
    temporary: Option<Temporary>,
}

impl CompleteFile {
    /// Renames the file over an existing one.
    ///
    /// # Errors
    /// [`Error::Write`].
    pub fn commit(self) -> Result<(), Error> {
        let Self { path, target, temporary } = self;
        temporary.map_or(Ok(()), |file| file.rename(&target)).map_err(|source| Error::Write { path, source })
    }
}

/// Maximum links that are followed, as on Linux.
const MAX_LINKS: usize = 40;

/// Returns `true` for the name of a file that this process has open.
fn is_open_file(path: &Path) -> bool {
    ["/dev/fd", "/proc/self/fd"].iter().any(|directory| path.starts_with(directory))
}

/// Follows symbolic links at the end of a path, also to a file that does not exist, but not to an open file.
fn target(path: &Path) -> PathBuf {
    let mut target = path.to_owned();
    for _ in 0..MAX_LINKS {
        match fs::read_link(&target) {
            Ok(link) if !is_open_file(&target) => target = directory_of(&target).join(link),
            _ => break,
        }
    }
    target
}

fn directory_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if parent != Path::new("") => parent,
        _ => Path::new("."),
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
    #[cfg(unix)]
    fn target_of_a_link_is_replaced_with_its_permissions() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let directory = tempfile::tempdir().unwrap();
        let [target, link, dangling] = ["a.csv", "b.csv", "c.csv"].map(|name| directory.path().join(name));
        fs::write(&target, "old").unwrap();
        fs::set_permissions(&target, fs::Permissions::from_mode(0o600)).unwrap();
        symlink("a.csv", &link).unwrap();
        symlink("new.csv", &dangling).unwrap();
        for path in [&link, &dangling] {
            let mut file = AtomicFile::create(path).unwrap();
            file.write_with(|out| out.write_all(b"new")).unwrap();
            file.commit().unwrap();
            assert!(fs::symlink_metadata(path).unwrap().is_symlink());
            assert_eq!(fs::read_to_string(path).unwrap(), "new");
        }
        assert_eq!(fs::read_to_string(&target).unwrap(), "new");
        assert_eq!(fs::metadata(&target).unwrap().permissions().mode() & 0o777, 0o600);
        assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 4);
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn open_file_is_not_replaced() {
        use std::os::fd::AsRawFd;
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.csv");
        let open = File::create(&path).unwrap();
        let mut file = AtomicFile::create(format!("/dev/fd/{}", open.as_raw_fd())).unwrap();
        file.write_with(|out| out.write_all(b"new")).unwrap();
        file.commit().unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "new");
        assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 1);
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn a_full_disk_is_an_error_and_leaves_nothing() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.npy");
        let (_, temporary) = Temporary::create(directory.path()).unwrap();
        let full = File::options().write(true).open("/dev/full").unwrap();
        let out = encoder(&path, full).unwrap();
        let mut file =
            AtomicFile { path: path.clone(), target: path.clone(), temporary: Some(temporary), out };
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
        let mut file =
            AtomicFile { path: path.clone(), target: path.clone(), temporary: Some(temporary), out };
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
