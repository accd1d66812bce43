//! Readers of simulators' files: frames of spheres, one at a time.
//!
//! ```no_run
//! use lazygrid_io::read::{Frames, Options};
//!
//! for frame in Frames::open("pour.dump", Options::default())? {
//!     println!("{} spheres", frame?.spheres.len());
//! }
//! # Ok::<(), lazygrid_io::Error>(())
//! ```
//!
//! Memory is bounded to one frame. What a file says about its own size is never believed before the data is
//! there. Radii and coordinates are `f32`, rounded once from what is written.

mod columns;
mod csv;
mod lammps;
mod lines;
mod npy;
mod smoldyn;
mod species;
#[cfg(test)]
mod tests;
mod xyz;

use std::fmt;
use std::fs::File;
use std::io::{self, Cursor, Read};
use std::path::Path;
use std::str::FromStr;
use std::sync::Arc;

use lazygrid::Sphere;

use crate::error::{At, Error, Place};

pub use species::{Radii, Species};

/// The most spheres for which room is made before they are read. More grow the room as they come.
const RESERVE: u64 = 1 << 20;

/// A file format.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Format {
    /// Comma-separated values with a header.
    Csv,
    /// A NumPy array of shape `(n, 4)`.
    Npy,
    /// XYZ, plain or extended.
    Xyz,
    /// LAMMPS text dump.
    Lammps,
    /// Smoldyn's `listmols` output.
    Smoldyn,
}

impl Format {
    /// Every value.
    pub const ALL: [Self; 5] = [Self::Csv, Self::Npy, Self::Xyz, Self::Lammps, Self::Smoldyn];

    /// The name in lower case.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Csv => "csv",
            Self::Npy => "npy",
            Self::Xyz => "xyz",
            Self::Lammps => "lammps",
            Self::Smoldyn => "smoldyn",
        }
    }

    /// The format that a file name's extension stands for.
    pub fn from_extension(path: &Path) -> Option<Self> {
        match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "csv" => Some(Self::Csv),
            "npy" => Some(Self::Npy),
            "xyz" | "extxyz" => Some(Self::Xyz),
            "dump" | "lammpstrj" | "lammps" => Some(Self::Lammps),
            "smoldyn" | "listmols" => Some(Self::Smoldyn),
            _ => None,
        }
    }

    /// The format that the first bytes of a file look like.
    pub fn from_content(head: &[u8]) -> Option<Self> {
        let line = head.split(|&b| b == b'\n').map(<[u8]>::trim_ascii).find(|line| !line.is_empty())?;
        if head.starts_with(npy::MAGIC) {
            Some(Self::Npy)
        } else if line.starts_with(b"ITEM: ") {
            Some(Self::Lammps)
        } else if line.iter().all(u8::is_ascii_digit) {
            Some(Self::Xyz)
        } else if smoldyn::is_listing(line) {
            Some(Self::Smoldyn)
        } else if csv::is_header(line) {
            Some(Self::Csv)
        } else {
            None
        }
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Format {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::ALL
            .into_iter()
            .find(|format| format.name() == text)
            .ok_or_else(|| format!("unknown format '{text}'; expected csv, npy, xyz, lammps or smoldyn"))
    }
}

/// How to read a file. The default finds the format itself and takes radii from the file.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// The format; else by extension, else by content.
    pub format: Option<Format>,
    /// Radii by species, for files that have none; they win over a radius column.
    pub radii: Radii,
}

/// The spheres of one moment.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Frame {
    /// The simulator's number of the time step, where the file has one.
    pub step: Option<i64>,
    /// The spheres in the order of the file; finite, with radii that are not negative.
    pub spheres: Vec<Sphere>,
    /// A species id per sphere where the file has species; names are in [`Frames::species`].
    pub species: Option<Vec<u32>>,
}

impl Frame {
    fn with_capacity(spheres: u64) -> Self {
        let mut frame = Self::default();
        // A refusal now means nothing yet: room is made again as spheres come.
        let _ = frame.spheres.try_reserve_exact(spheres as usize);
        frame
    }
}

/// The frames of a file, read one at a time. Ends after the first error.
pub struct Frames {
    format: Format,
    reader: Reader,
    species: Species,
}

enum Reader {
    /// A format of one frame per file, not read yet.
    Single(fn(Source, &mut Species) -> Result<Frame, Error>, Source),
    Xyz(xyz::Xyz),
    Lammps(lammps::Lammps),
    Ended,
}

impl Frames {
    /// Opens a file.
    ///
    /// # Errors
    /// [`Error::Read`] where it cannot be opened; [`Error::UnknownFormat`] where the format is not given and not
    /// clear.
    pub fn open(path: impl AsRef<Path>, options: Options) -> Result<Self, Error> {
        let path = path.as_ref();
        let open = || {
            let file = File::open(path)?;
            let metadata = file.metadata()?;
            Ok((file, metadata.is_file().then_some(metadata.len())))
        };
        let (file, length) = open().map_err(|source| Error::Read { path: path.to_owned(), source })?;
        Self::new(path, file, length, options)
    }

    /// Reads from `input`; `path` serves messages and the extension, `length` is the number of bytes to come
    /// where that is known.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub fn new(
        path: impl AsRef<Path>,
        input: impl Read + Send + 'static,
        length: Option<u64>,
        options: Options,
    ) -> Result<Self, Error> {
        let mut source = Source::new(path.as_ref(), input, length);
        let format = match options.format.or_else(|| Format::from_extension(&source.path)) {
            Some(format) => format,
            None => source.guess()?,
        };
        let reader = match format {
            Format::Csv => Reader::Single(csv::read, source),
            Format::Npy => Reader::Single(npy::read, source),
            Format::Smoldyn => Reader::Single(smoldyn::read, source),
            Format::Xyz => Reader::Xyz(xyz::Xyz::new(source)),
            Format::Lammps => Reader::Lammps(lammps::Lammps::new(source)),
        };
        Ok(Self { format, reader, species: Species::new(options.radii) })
    }

    /// The format that is being read.
    pub fn format(&self) -> Format {
        self.format
    }

    /// The species met so far.
    pub fn species(&self) -> &Species {
        &self.species
    }

    fn read(&mut self) -> Result<Option<Frame>, Error> {
        match std::mem::replace(&mut self.reader, Reader::Ended) {
            Reader::Single(read, source) => read(source, &mut self.species).map(Some),
            Reader::Xyz(mut xyz) => {
                let frame = xyz.next_frame(&mut self.species)?;
                self.reader = Reader::Xyz(xyz);
                Ok(frame)
            }
            Reader::Lammps(mut lammps) => {
                let frame = lammps.next_frame(&mut self.species)?;
                self.reader = Reader::Lammps(lammps);
                Ok(frame)
            }
            Reader::Ended => Ok(None),
        }
    }
}

impl Iterator for Frames {
    type Item = Result<Frame, Error>;

    fn next(&mut self) -> Option<Self::Item> {
        self.read().transpose()
    }
}

/// Bytes to read, and where they come from.
struct Source {
    path: Arc<Path>,
    input: Box<dyn Read + Send>,
    /// How many bytes there are in all, where that is known.
    length: Option<u64>,
}

impl Source {
    fn new(path: &Path, input: impl Read + Send + 'static, length: Option<u64>) -> Self {
        Self { path: path.into(), input: Box::new(input), length }
    }

    /// The format by content. What is looked at will be read again.
    fn guess(&mut self) -> Result<Format, Error> {
        const HEAD: usize = 4096;
        let mut head = vec![0; HEAD];
        let length = self.fill(&mut head)?;
        head.truncate(length);
        let format = Format::from_content(&head);
        let rest = std::mem::replace(&mut self.input, Box::new(io::empty()));
        self.input = Box::new(Cursor::new(head).chain(rest));
        format.ok_or_else(|| Error::UnknownFormat { path: self.path.to_path_buf() })
    }

    /// Some bytes; 0 at the end.
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Error> {
        loop {
            match self.input.read(buffer) {
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                result => {
                    return result.map_err(|source| Error::Read { path: self.path.to_path_buf(), source });
                }
            }
        }
    }

    /// As many bytes as the buffer takes, fewer at the end only.
    fn fill(&mut self, buffer: &mut [u8]) -> Result<usize, Error> {
        let mut filled = 0;
        while filled < buffer.len() {
            match self.read(&mut buffer[filled..])? {
                0 => break,
                read => filled += read,
            }
        }
        Ok(filled)
    }

    fn at(&self, at: At) -> Place {
        Place { path: self.path.clone(), at }
    }

    #[cfg(test)]
    fn from_bytes(name: &str, bytes: impl AsRef<[u8]> + Send + 'static) -> Self {
        let length = bytes.as_ref().len() as u64;
        Self::new(Path::new(name), Cursor::new(bytes), Some(length))
    }
}
