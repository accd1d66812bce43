//! XYZ: a count, a comment, then `species x y z` per sphere; as many frames as there are. Where the comment has
//! `Properties=` (extended XYZ), that says what the columns are.

use super::columns::{Column, Columns};
use super::lines::{Line, Lines};
use super::species::Species;
use super::{Frame, RESERVE, Source};
use crate::error::Error;

pub(super) struct Xyz {
    lines: Lines,
}

impl Xyz {
    pub(super) fn new(source: Source) -> Self {
        Self { lines: Lines::new(source) }
    }

    pub(super) fn next_frame(&mut self, species: &mut Species) -> Result<Option<Frame>, Error> {
        let Some(line) = self.lines.next()? else { return Ok(None) };
        let count = line.count("the number of spheres of the next frame")?;
        let comment = self.lines.required("lines of the frame's head", 1, 2)?;
        let columns = columns(comment, species)?;
        let mut frame = Frame::with_capacity(count.min(RESERVE));
        for found in 0..count {
            let line = self.lines.required("spheres", found, count)?;
            let row = columns.row(line, line.words())?;
            frame.push(line, row, species)?;
        }
        Ok(Some(frame))
    }
}

fn columns(comment: Line<'_>, species: &Species) -> Result<Columns, Error> {
    let columns = match value_of(comment.bytes, b"Properties=") {
        Some(properties) => Columns::new(declared(comment, properties)?),
        None => {
            let axes = ["x", "y", "z"].into_iter().enumerate().map(|(k, name)| (name, Column::Axis(k)));
            let plain = std::iter::once(("species", Column::Species)).chain(axes);
            Columns::new(plain.map(|(name, meaning)| (name.to_owned(), meaning))).open_ended()
        }
    };
    columns.check(comment, species)?;
    Ok(columns)
}

/// The columns of `species:S:1:pos:R:3:radius:R:1`: triples of name, type and number of columns.
fn declared(comment: Line<'_>, properties: &[u8]) -> Result<Vec<(String, Column)>, Error> {
    const MOST: usize = 1000;
    let malformed = || comment.unexpected("Properties=name:type:columns, such as pos:R:3:radius:R:1");
    let parts: Vec<_> = properties.split(|&b| b == b':').collect();
    let (triples, []) = parts.as_chunks::<3>() else { return Err(malformed()) };
    let mut columns = Vec::new();
    for &[name, _type, width] in triples {
        let name = String::from_utf8_lossy(name).into_owned();
        let width: usize = lexical_core::parse(width).map_err(|_| malformed())?;
        if width == 0 || columns.len() + width > MOST {
            return Err(malformed());
        }
        match (name.to_ascii_lowercase().as_str(), width) {
            ("pos", 3) => {
                let axes = ["x", "y", "z"].into_iter().enumerate();
                columns.extend(axes.map(|(k, axis)| (axis.to_owned(), Column::Axis(k))));
            }
            ("radius" | "radii", 1) => columns.push((name, Column::Radius)),
            ("species", 1) => columns.push((name, Column::Species)),
            _ => columns.extend(std::iter::repeat_n((name, Column::Other), width)),
        }
    }
    Ok(columns)
}

/// The value after `key` in a comment of `key=value` words; it may be in double quotes.
fn value_of<'a>(comment: &'a [u8], key: &[u8]) -> Option<&'a [u8]> {
    let at = memchr::memmem::find_iter(comment, key)
        .find(|&at| at == 0 || comment[at - 1].is_ascii_whitespace())?;
    let value = &comment[at + key.len()..];
    match value.strip_prefix(b"\"") {
        Some(quoted) => quoted.split(|&b| b == b'"').next(),
        None => value.split(u8::is_ascii_whitespace).next(),
    }
}
