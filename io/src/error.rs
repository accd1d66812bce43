use std::fmt;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use thiserror::Error;

/// The location of a fault in a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Location {
    /// The file, as it was named.
    pub path: Arc<Path>,
    /// The position in the file.
    pub at: Position,
}

/// A position in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Position {
    /// The file as a whole.
    File,
    /// A line of a text file; the first is 1.
    Line(u64),
    /// A row of an array; the first is 0, as in the pairs that refer to it.
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

/// The failure to read or write a file. Every message names the file, the line or row, and the offending text.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum Error {
    /// The system refused to open or read the file.
    #[error("{}: cannot read: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The message of the system.
        source: io::Error,
    },
    /// The system refused to create or write the file. What was there before is untouched.
    #[error("{}: cannot write: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The message of the system.
        source: io::Error,
    },
    /// Neither the name nor the first lines tell the format.
    #[error(
        "{}: neither the name nor the content tells the format; say --format csv, npy, xyz, lammps or smoldyn",
        path.display()
    )]
    UnknownFormat {
        /// The file.
        path: PathBuf,
    },
    /// Something else stands where the format wants something.
    #[error("{place}: expected {expected}, found {found}")]
    Syntax {
        /// The location.
        place: Location,
        /// The format's requirement.
        expected: String,
        /// The text of the file.
        found: String,
    },
    /// A field that is not a number.
    #[error("{place}: {column} '{text}' is not a number")]
    Number {
        /// The location.
        place: Location,
        /// The column's name.
        column: String,
        /// The field.
        text: String,
    },
    /// A number that no sphere can have.
    #[error("{place}: {column} is {value}; {rule}")]
    Value {
        /// The location.
        place: Location,
        /// The column's name.
        column: String,
        /// The number as it is written.
        value: String,
        /// The valid values.
        rule: &'static str,
    },
    /// The file has no radii and none was given for this species.
    #[error("{place}: no radius column and no radius for {}", remedy(species.as_deref()))]
    NoRadius {
        /// The location.
        place: Location,
        /// The species, if the file names one.
        species: Option<String>,
    },
    /// The file ends inside a frame.
    #[error("{place}: the file ends after {found} of {expected} {what}")]
    Truncated {
        /// The end of the file.
        place: Location,
        /// The counted things.
        what: &'static str,
        /// The actual number.
        found: u64,
        /// The number that the file declares.
        expected: u64,
    },
    /// The file's box repeats along edges that span none.
    #[error(
        "{place}: the box cannot be periodic: {reason}; give lengths with --periodic X,Y,Z, or take space as unbounded with \
         --periodic none"
    )]
    BoxEdges {
        /// The location of the box.
        place: Location,
        /// The fault.
        reason: Box<lazygrid::InputError>,
    },
    /// The file's box repeats after a length that no period can have.
    #[error(
        "{place}: the box is periodic along {axis} and its length there is {length}, no 32-bit number above zero; give \
         lengths with --periodic X,Y,Z, or take space as unbounded with --periodic none"
    )]
    BoxLength {
        /// The location of the box.
        place: Location,
        /// The axis.
        axis: &'static str,
        /// The length.
        length: f64,
    },
    /// A Smoldyn molecule is listed twice: several listings in one file, and nothing marks where one ends.
    #[error(
        "{place}: molecule {serial} is listed a second time, first on line {first}; several listings in one \
         file cannot be told apart: write one file per listing (Smoldyn's `incrementfile`)"
    )]
    RepeatedMolecule {
        /// The location of the repeated molecule.
        place: Location,
        /// Its serial number.
        serial: String,
        /// The line of its first occurrence.
        first: u64,
    },
    /// A line so long that the file is hardly a text file.
    #[error("{place}: the line is longer than {limit} bytes; is this a text file?")]
    LineTooLong {
        /// The location.
        place: Location,
        /// The longest line that is read.
        limit: usize,
    },
    /// More spheres in a frame than indices or memory.
    #[error("{place}: no room for {spheres} spheres ({limit}); split the file")]
    TooManySpheres {
        /// The location.
        place: Location,
        /// The actual number.
        spheres: u64,
        /// The source of the limit.
        limit: &'static str,
    },
}

impl Error {
    /// The place in the file, where the error has one: for who reads a file in pieces and knows where each begins.
    pub fn location_mut(&mut self) -> Option<&mut Location> {
        match self {
            Self::Read { .. } | Self::Write { .. } | Self::UnknownFormat { .. } => None,
            Self::Syntax { place, .. }
            | Self::Number { place, .. }
            | Self::Value { place, .. }
            | Self::NoRadius { place, .. }
            | Self::Truncated { place, .. }
            | Self::BoxEdges { place, .. }
            | Self::BoxLength { place, .. }
            | Self::RepeatedMolecule { place, .. }
            | Self::LineTooLong { place, .. }
            | Self::TooManySpheres { place, .. } => Some(place),
        }
    }
}

/// Returns the name of a species without its state: `acid` of `acid(solution)`.
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

/// The offending bytes as printable text, short enough to be quoted in a message.
pub fn excerpt(bytes: &[u8]) -> String {
    printed(bytes, 60)
}

/// The first bytes as printable text, at most `longest`, with an ellipsis if there are more.
pub fn printed(bytes: &[u8], longest: usize) -> String {
    let text = String::from_utf8_lossy(&bytes[..bytes.len().min(longest)]);
    let mut shown: String = text.chars().flat_map(printable).collect();
    if bytes.len() > longest {
        shown.push('…');
    }
    shown
}

/// A control character would let a file write to the terminal.
fn printable(c: char) -> impl Iterator<Item = char> {
    let escaped = c.is_control().then(|| c.escape_default());
    let plain = (!c.is_control()).then_some(c);
    escaped.into_iter().flatten().chain(plain)
}
