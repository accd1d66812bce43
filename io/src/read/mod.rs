//! Readers of simulators' files, one frame at a time.
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
//! One frame bounds the memory, not declared sizes.

mod cell;
mod columns;
mod comment;
mod csv;
mod gzip;
mod lammps;
mod line;
mod lines;
mod npy;
mod pairs;
mod precision;
mod read_context;
mod rows;
mod serial;
mod smoldyn;
mod source;
mod species;
#[cfg(test)]
mod tests;
mod xyz;
mod zstd;

use std::collections::TryReserveError;
use std::fs::File;
use std::io::Read;
use std::path::Path;

use lazygrid::{Space, Sphere, Spheres};
use rayon::slice::ParallelSliceMut;

use self::read_context::ReadContext;
use self::source::Source;
use crate::error::Error;
use crate::memory::try_collect;
use crate::names::text_is_name;

pub use line::BYTE_ORDER_MARK;
pub use npy::{ArrayFile, NpyRows};
pub use pairs::pairs;
pub use precision::Precision;
pub use species::{Radii, Species};

/// Limits the memory reserved for a declared number of spheres.
const MAX_RESERVED_SPHERES: u64 = 1 << 20;

/// A file format.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Format {
    /// Comma-separated values with a header.
    Csv,
    /// NumPy array of shape `(n, 4)`.
    Npy,
    /// XYZ, plain or extended.
    Xyz,
    /// LAMMPS text dump.
    Lammps,
    /// Smoldyn's `listmols` output.
    Smoldyn,
}

impl Format {
    /// All formats.
    pub const ALL: [Self; 5] = [Self::Csv, Self::Npy, Self::Xyz, Self::Lammps, Self::Smoldyn];

    /// Returns the name in lower case.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Csv => "csv",
            Self::Npy => "npy",
            Self::Xyz => "xyz",
            Self::Lammps => "lammps",
            Self::Smoldyn => "smoldyn",
        }
    }

    /// Returns the format of an extension, before `.gz` or `.zst`.
    pub fn from_extension(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_str()?.to_ascii_lowercase();
        match extension.as_str() {
            "gz" | "zst" => Self::from_extension(Path::new(path.file_stem()?)),
            "csv" | "tsv" => Some(Self::Csv),
            "npy" => Some(Self::Npy),
            "xyz" | "extxyz" => Some(Self::Xyz),
            "dump" | "lammpstrj" | "lammps" => Some(Self::Lammps),
            "smoldyn" | "listmols" => Some(Self::Smoldyn),
            _ => None,
        }
    }

    /// Guesses the format from the first bytes.
    pub fn from_content(head: &[u8]) -> Option<Self> {
        let head = head.strip_prefix(BYTE_ORDER_MARK).unwrap_or(head);
        let mut lines = head.split(|&b| b == b'\n').map(<[u8]>::trim_ascii);
        let tells = |line: &&[u8]| !line.is_empty() && (!csv::is_comment(line) || csv::is_header(line));
        let line = lines.find(tells)?;
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

text_is_name!(Format, "format");

/// Reader options.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Format, by default guessed from extension, then content.
    pub format: Option<Format>,
    /// Radii by species, finite and not negative; they override a radius column.
    pub radii: Radii,
    /// Space of all frames. By default each frame declares its own, or is unbounded.
    pub space: Option<Space>,
    /// Reads a column `id` (Smoldyn: serial numbers).
    pub ids: bool,
    /// Reads a column `group`, `molecule` or `mol`.
    pub groups: bool,
    /// Type of coordinates and radii.
    pub precision: Precision,
}

/// A frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Frame {
    /// Time step.
    pub step: Option<i64>,
    /// Declared or requested space.
    pub space: Space,
    /// Valid spheres in the order of the file. Empty if the numbers are `f64`.
    pub spheres: Vec<Sphere>,
    /// Rows `x, y, z, r` in place of spheres, if the numbers are `f64`.
    pub doubles: Option<Vec<[f64; 4]>>,
    /// Ids in [`Frames::species`].
    pub species: Option<Vec<u32>>,
    /// Ids, if requested.
    pub ids: Option<Vec<i64>>,
    /// Molecules, if requested; [`Spheres::NO_GROUP`] for 0.
    pub groups: Option<Vec<u32>>,
}

impl Frame {
    fn with_capacity(spheres: u64, context: &ReadContext) -> Self {
        let mut frame = Self { doubles: context.doubles.then(Vec::new), ..Self::default() };
        // Refused memory is reserved again as spheres come.
        let _ = frame.try_reserve(spheres as usize);
        frame
    }

    /// Returns the spheres without species and groups.
    pub fn as_spheres(&self) -> Spheres<'_> {
        match &self.doubles {
            Some(doubles) => Spheres::from(doubles),
            None => Spheres::from(&self.spheres),
        }
    }

    /// Returns the number of spheres.
    pub fn len(&self) -> usize {
        self.doubles.as_ref().map_or(self.spheres.len(), Vec::len)
    }

    /// Returns `true` without spheres.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    fn try_reserve(&mut self, more: usize) -> Result<(), TryReserveError> {
        match &mut self.doubles {
            Some(doubles) => doubles.try_reserve(more),
            None => self.spheres.try_reserve(more),
        }
    }

    fn push(&mut self, row: [f64; 4]) {
        match &mut self.doubles {
            Some(doubles) => doubles.push(row),
            None => self.spheres.push(sphere(row)),
        }
    }

    /// Sorts spheres by id, if any. If memory is refused, columns may differ in order.
    ///
    /// # Errors
    /// [`SortError::RepeatedId`], and [`SortError::OutOfMemory`] if the system refuses memory for the sorted columns.
    pub fn sort_by_id(&mut self) -> Result<(), SortError> {
        let Some(ids) = &mut self.ids else { return Ok(()) };
        if !ids.is_sorted() {
            // A frame has fewer than 2³² spheres.
            let mut order = try_collect(0..ids.len() as u32).map_err(SortError::OutOfMemory)?;
            order.par_sort_unstable_by_key(|&row| ids[row as usize]);
            sort_column(ids, &order)?;
            match &mut self.doubles {
                Some(doubles) => sort_column(doubles, &order)?,
                None => sort_column(&mut self.spheres, &order)?,
            }
            for column in [&mut self.species, &mut self.groups].into_iter().flatten() {
                sort_column(column, &order)?;
            }
        }
        match ids.windows(2).find(|two| two[0] == two[1]) {
            Some(two) => Err(SortError::RepeatedId(two[0])),
            None => Ok(()),
        }
    }
}

/// A failure of [`Frame::sort_by_id`].
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SortError {
    /// The least id of several spheres.
    RepeatedId(i64),
    /// Memory for the sorted columns.
    OutOfMemory(TryReserveError),
}

fn sort_column<T: Copy>(column: &mut Vec<T>, order: &[u32]) -> Result<(), SortError> {
    let sorted = try_collect(order.iter().map(|&row| column[row as usize]));
    *column = sorted.map_err(SortError::OutOfMemory)?;
    Ok(())
}

fn sphere([x, y, z, r]: [f64; 4]) -> Sphere {
    Sphere::new([x, y, z].map(|number| number as f32), r as f32)
}

/// An iterator over the frames of a file, up to the first error.
pub struct Frames {
    format: Format,
    reader: Reader,
    context: ReadContext,
}

enum Reader {
    Single(fn(Source, &mut ReadContext) -> Result<Frame, Error>, Source),
    Xyz(xyz::Xyz),
    Lammps(lammps::Lammps),
    Ended,
}

fn open(path: &Path) -> Result<(File, Option<u64>), Error> {
    let open = || {
        let file = File::open(path)?;
        let metadata = file.metadata()?;
        Ok((file, metadata.is_file().then_some(metadata.len())))
    };
    open().map_err(|source| Error::Read { path: path.to_owned(), source })
}

impl Frames {
    /// Opens a file.
    ///
    /// # Errors
    /// [`Error::Read`]; [`Error::UnknownFormat`] if the format is neither set nor clear; [`Error::Radius`].
    pub fn open(path: impl AsRef<Path>, options: Options) -> Result<Self, Error> {
        let path = path.as_ref();
        let (file, length) = open(path)?;
        Self::new(path, file, length, options)
    }

    /// Reads from `input` of `length` bytes, if known. `path` gives the extension.
    ///
    /// # Errors
    /// See [`open`](Self::open).
    pub fn new(
        path: impl AsRef<Path>,
        input: impl Read + Send + 'static,
        length: Option<u64>,
        options: Options,
    ) -> Result<Self, Error> {
        let mut source = Source::new(path.as_ref(), input, length)?;
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
        Ok(Self { format, reader, context: ReadContext::new(options)? })
    }

    /// Returns the format.
    pub fn format(&self) -> Format {
        self.format
    }

    /// Returns the species so far.
    pub fn species(&self) -> &Species {
        &self.context.species
    }

    /// Returns the warning of the first rounded number, if any so far.
    pub fn rounding(&self) -> Option<&str> {
        self.context.rounding.as_deref()
    }

    /// Returns `true` if the rest of the file is blank. May wait for input.
    ///
    /// # Errors
    /// [`Error::Read`], [`Error::LineTooLong`] and [`Error::Threads`].
    pub fn at_end(&mut self) -> Result<bool, Error> {
        match &mut self.reader {
            Reader::Single(..) => Ok(false),
            Reader::Xyz(xyz) => xyz.lines.at_end(),
            Reader::Lammps(lammps) => lammps.lines.at_end(),
            Reader::Ended => Ok(true),
        }
    }

    fn read(&mut self) -> Result<Option<Frame>, Error> {
        match std::mem::replace(&mut self.reader, Reader::Ended) {
            Reader::Single(read, source) => {
                let frame = read(source, &mut self.context)?;
                let space = self.context.space.unwrap_or_default();
                Ok(Some(Frame { space, ..frame }))
            }
            Reader::Xyz(mut xyz) => {
                let frame = xyz.next_frame(&mut self.context)?;
                self.reader = Reader::Xyz(xyz);
                Ok(frame)
            }
            Reader::Lammps(mut lammps) => {
                let frame = lammps.next_frame(&mut self.context)?;
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
