//! Writers of results and scenes. A file appears under its name only when it is complete.

mod pairs;
mod spheres;
mod text;

use std::ffi::OsStr;
use std::fs::File;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use tempfile::{NamedTempFile, TempPath};

pub use pairs::{PairFile, neighbors};
pub use spheres::{SphereFormat, spheres};

use crate::Error;

/// Bytes gathered before they go to the system.
const BUFFER: usize = 1 << 20;

/// How a table of whole numbers is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TableFormat {
    /// Text with a header line.
    Csv,
    /// NumPy arrays.
    Npy,
}

impl TableFormat {
    /// The format that a file name's extension stands for.
    pub fn from_extension(path: &Path) -> Option<Self> {
        match path.extension().and_then(OsStr::to_str)? {
            "csv" => Some(Self::Csv),
            "npy" => Some(Self::Npy),
            _ => None,
        }
    }
}

/// A file that is being written under a temporary name beside its own. Unless it is published it disappears.
#[derive(Debug)]
#[must_use = "a draft that is not published disappears"]
pub struct Draft {
    path: PathBuf,
    temporary: TempPath,
    out: BufWriter<File>,
}

impl Draft {
    /// An empty draft of the file at `path`.
    ///
    /// # Errors
    /// [`Error::Write`] where the directory takes no new file.
    pub fn create(path: impl Into<PathBuf>) -> Result<Self, Error> {
        let path = path.into();
        let directory = match path.parent() {
            Some(parent) if parent != Path::new("") => parent,
            _ => Path::new("."),
        };
        let mut builder = tempfile::Builder::new();
        builder.prefix(".lazygrid-");
        // A temporary file is private by default, but the file that it becomes is an ordinary one.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        match builder.tempfile_in(directory).map(NamedTempFile::into_parts) {
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
    pub fn put(&mut self, write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> Result<(), Error> {
        write(&mut self.out).map_err(|source| Error::Write { path: self.path.clone(), source })
    }

    /// Overwrites the beginning.
    fn put_at_start(&mut self, bytes: &[u8]) -> Result<(), Error> {
        self.put(|out| {
            out.seek(SeekFrom::Start(0))?;
            out.write_all(bytes)
        })
    }

    /// Gives the file its name, in place of any that has it.
    ///
    /// # Errors
    /// [`Error::Write`] where the last bytes cannot be written or the name cannot be given.
    pub fn publish(mut self) -> Result<(), Error> {
        self.put(|out| out.flush())?;
        let Self { path, temporary, .. } = self;
        temporary.persist(&path).map_err(|error| Error::Write { path, source: error.error })
    }
}

/// A header of the NumPy format, always of the same length, so that it can be written again once the number of
/// rows is known.
fn npy_header(kind: &str, shape: &str) -> [u8; NPY_HEADER] {
    const START: &[u8] = b"\x93NUMPY\x01\x00\x76\x00";
    const _: () = assert!(START.len() + 0x76 == NPY_HEADER);
    let order = if cfg!(target_endian = "big") { '>' } else { '<' };
    let text = format!("{{'descr': '{order}{kind}', 'fortran_order': False, 'shape': {shape}, }}");
    let mut header = [b' '; NPY_HEADER];
    header[..START.len()].copy_from_slice(START);
    header[START.len()..][..text.len()].copy_from_slice(text.as_bytes());
    header[NPY_HEADER - 1] = b'\n';
    header
}

/// Long enough for any shape of two 64-bit numbers; a multiple of 64, as the format asks.
const NPY_HEADER: usize = 128;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_have_one_length_whatever_the_shape() {
        for shape in ["(0, 2)".to_owned(), format!("({}, 2)", u64::MAX), format!("({},)", u64::MAX)] {
            let header = npy_header("u8", &shape);
            let text = std::str::from_utf8(&header[10..]).unwrap();
            assert!(text.contains(&format!("'shape': {shape}, }} ")), "{text}");
            assert!(text.ends_with(" \n"));
        }
    }

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
        let temporary = NamedTempFile::new_in(directory.path()).unwrap().into_temp_path();
        let full = File::options().write(true).open("/dev/full").unwrap();
        let mut draft = Draft { path: path.clone(), temporary, out: BufWriter::new(full) };
        draft.put(|out| out.write_all(b"fits the buffer")).unwrap();
        let error = draft.publish().unwrap_err().to_string();
        assert_eq!(error, format!("{}: cannot write: No space left on device (os error 28)", path.display()));
        assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 0);
    }
}
