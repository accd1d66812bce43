use std::fmt;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use lazygrid::MAX_SPHERES;
use thiserror::Error;

/// The location of a fault.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Location {
    /// File.
    pub path: Arc<Path>,
    /// Position.
    pub at: Position,
}

/// A position in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Position {
    /// Whole file.
    File,
    /// Line, from 1.
    Line(u64),
    /// Row of an array, from 0.
    Row(u64),
}

impl fmt::Display for Location {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.path.display())?;
        match self.at {
            Position::File => Ok(()),
            Position::Line(line) => write!(f, ", line {line}"),
            Position::Row(row) => write!(f, ", row {row}"),
        }
    }
}

/// A failure to read or write a file.
#[derive(Debug, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "messages explain the fields")]
pub enum Error {
    #[error("{}: cannot read: {source}", path.display())]
    Read { path: PathBuf, source: io::Error },
    /// An existing file is untouched.
    #[error("{}: cannot write: {source}", path.display())]
    Write { path: PathBuf, source: io::Error },
    #[error(
        "{}: the header promises {expected} pairs, but the search found {found}; it was not written, try again as .csv",
        path.display()
    )]
    RowCount { path: PathBuf, expected: u64, found: u64 },
    #[error(
        "{}: neither the name nor the content tells the format; say --format csv, npy, xyz, lammps or smoldyn",
        path.display()
    )]
    UnknownFormat { path: PathBuf },
    #[error(
        "{}: the content is compressed by {program}, which is not read; decompress it first, or use gzip or Zstandard",
        path.display()
    )]
    Compression {
        path: PathBuf,
        /// Program that decompresses it.
        program: &'static str,
    },
    #[error("{location}: expected {expected}, found {found}")]
    Syntax {
        location: Location,
        expected: String,
        /// Text of the file.
        found: String,
    },
    #[error("{location}: {column} '{text}' is not a number")]
    Number { location: Location, column: String, text: String },
    #[error("{location}: {column} is {value}; {rule}")]
    Value {
        location: Location,
        column: String,
        /// Text of the file.
        value: String,
        rule: &'static str,
    },
    #[error(
        "the radius of species '{species}' is {radius}; radii must be finite in the precision that is read, and not negative"
    )]
    Radius { species: String, radius: f64 },
    #[error("{location}: no radius column and no radius for {}", remedy(species.as_deref()))]
    NoRadius { location: Location, species: Option<String> },
    #[error("{location}: the file ends after {found} of {expected} {what}")]
    Truncated {
        location: Location,
        /// Plural noun.
        what: &'static str,
        found: u64,
        expected: u64,
    },
    #[error(
        "{location}: the box cannot be periodic: {reason}; give lengths with --periodic X,Y,Z, or take space as unbounded with \
         --periodic none"
    )]
    BoxVectors { location: Location, reason: Box<lazygrid::InputError> },
    #[error(
        "{location}: the box is periodic along {axis} and its length there is {}, no {rule} above zero; give \
         lengths with --periodic X,Y,Z, or take space as unbounded with --periodic none",
        lazygrid::short(*length)
    )]
    BoxLength {
        location: Location,
        axis: &'static str,
        length: f64,
        /// Kind of numbers.
        rule: &'static str,
    },
    #[error(
        "{location}: molecule {serial} is listed a second time, first on line {first}; several listings in one \
         file cannot be told apart: write one file per listing (Smoldyn's `incrementfile`)"
    )]
    RepeatedMolecule {
        location: Location,
        serial: String,
        /// Line number.
        first: u64,
    },
    #[error("{location}: the line is longer than {limit} bytes; is this a text file?")]
    LineTooLong { location: Location, limit: usize },
    #[error("{}: cannot read: {reason}", path.display())]
    Threads { path: PathBuf, reason: Box<lazygrid::Error> },
    #[error(
        "{location}: {spheres} spheres exceed the {MAX_SPHERES} that 32-bit indices can name; split the file"
    )]
    TooManySpheres { location: Location, spheres: u64 },
    #[error("{location}: memory for {spheres} spheres was refused; free memory or split the file")]
    OutOfMemory { location: Location, spheres: u64 },
}

impl Error {
    /// Returns the location, for callers that read a file in ranges.
    pub fn location_mut(&mut self) -> Option<&mut Location> {
        match self {
            Self::Read { .. }
            | Self::Write { .. }
            | Self::RowCount { .. }
            | Self::UnknownFormat { .. }
            | Self::Compression { .. }
            | Self::Radius { .. }
            | Self::Threads { .. } => None,
            Self::Syntax { location, .. }
            | Self::Number { location, .. }
            | Self::Value { location, .. }
            | Self::NoRadius { location, .. }
            | Self::Truncated { location, .. }
            | Self::BoxVectors { location, .. }
            | Self::BoxLength { location, .. }
            | Self::RepeatedMolecule { location, .. }
            | Self::LineTooLong { location, .. }
            | Self::TooManySpheres { location, .. }
            | Self::OutOfMemory { location, .. } => Some(location),
        }
    }
}

pub(crate) fn bare(name: &str) -> &str {
    match name.split_once('(') {
        Some((bare, state)) if state.ends_with(')') => bare,
        _ => name,
    }
}

fn remedy(species: Option<&str>) -> String {
    match species {
        Some(name) => match bare(name) {
            bare if bare != name => {
                format!(
                    "species '{name}'; give it with --radius '{bare}=R', or '{name}=R' for that state alone"
                )
            }
            _ => format!("species '{name}'; give it with --radius '{name}=R'"),
        },
        None => "spheres without species; add a radius column".to_owned(),
    }
}

/// Returns bytes as short printable text.
pub fn excerpt(bytes: &[u8]) -> String {
    printed(bytes, 60)
}

/// Returns at most `longest` bytes as printable text.
pub fn printed(bytes: &[u8], longest: usize) -> String {
    let text = String::from_utf8_lossy(&bytes[..bytes.len().min(longest)]);
    let mut shown: String = text.chars().flat_map(printable).collect();
    if bytes.len() > longest {
        shown.push('…');
    }
    shown
}

/// Keeps control characters from the terminal.
fn printable(c: char) -> impl Iterator<Item = char> {
    let escaped = c.is_control().then(|| c.escape_default());
    let plain = (!c.is_control()).then_some(c);
    escaped.into_iter().flatten().chain(plain)
}
