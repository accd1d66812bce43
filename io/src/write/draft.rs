use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use super::temporary::Temporary;
use crate::Error;

/// Bytes gathered before they go to the system.
const BUFFER: usize = 1 << 20;

/// A file that is being written under a temporary name beside its own. Unless it is published it disappears.
#[derive(Debug)]
#[must_use = "a draft that is not published disappears"]
pub struct Draft {
    path: PathBuf,
    temporary: Temporary,
    out: BufWriter<File>,
}

impl Draft {
    /// An empty draft of the file at `path`. Takes away what killed processes left in the directory.
    ///
    /// # Errors
    /// [`Error::Write`] where the directory takes no new file.
    pub fn create(path: impl Into<PathBuf>) -> Result<Self, Error> {
        let path = path.into();
        let directory = match path.parent() {
            Some(parent) if parent != Path::new("") => parent,
            _ => Path::new("."),
        };
        match Temporary::create(directory) {
            Ok((file, temporary)) => {
                Ok(Self { path, temporary, out: BufWriter::with_capacity(BUFFER, file) })
            }
            Err(source) => Err(Error::Write { path, source }),
        }
    }

    /// Writes to the draft.
    ///
    /// # Errors
    /// [`Error::Write`] with what the system said, such as that the disk is full.
    pub fn put(&mut self, write: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<(), Error> {
        write(&mut self.out).map_err(|source| Error::Write { path: self.path.clone(), source })
    }

    /// Gives the file its name, in place of any that has it.
    ///
    /// # Errors
    /// [`Error::Write`] where the last bytes cannot be written or the name cannot be given.
    pub fn publish(mut self) -> Result<(), Error> {
        self.put(|out| out.flush())?;
        let Self { path, temporary, .. } = self;
        temporary.rename(&path).map_err(|source| Error::Write { path, source })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_draft_appears_when_it_is_published_and_not_before() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.csv");
        std::fs::write(&path, "old").unwrap();
        let mut draft = Draft::create(&path).unwrap();
        draft.put(|out| out.write_all(b"new")).unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "old");
        draft.publish().unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "new");
        drop(Draft::create(&path).unwrap());
        assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 1);
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn a_full_disk_is_an_error_and_leaves_nothing() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.npy");
        let (_, temporary) = Temporary::create(directory.path()).unwrap();
        let full = File::options().write(true).open("/dev/full").unwrap();
        let mut draft = Draft { path: path.clone(), temporary, out: BufWriter::new(full) };
        draft.put(|out| out.write_all(b"fits the buffer")).unwrap();
        let error = draft.publish().unwrap_err().to_string();
        assert_eq!(error, format!("{}: cannot write: No space left on device (os error 28)", path.display()));
        assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 0);
    }
}
