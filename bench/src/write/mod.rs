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
