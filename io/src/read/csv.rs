//! Comma-separated values: a header that names `x`, `y`, `z`, `r` or `radius`, and optionally `species`, in any
//! order and case; other columns are ignored. One frame.

use super::columns::{Column, Columns};
use super::lines::{Line, Lines};
use super::species::Species;
use super::{Frame, Source};
use crate::error::Error;

pub(super) fn read(source: Source, species: &mut Species) -> Result<Frame, Error> {
    let mut lines = Lines::new(source);
    let columns = match lines.next()? {
        Some(header) => columns(header, species)?,
        None => {
            let (place, expected) = (lines.place(), "a header with x, y, z and r or radius".to_owned());
            return Err(Error::Syntax { place, expected, found: "an empty file".to_owned() });
        }
    };
    let mut frame = Frame::default();
    while let Some(line) = lines.next()? {
        let row = columns.row(line, fields(line)?)?;
        frame.push(line, row, species)?;
    }
    Ok(frame)
}

fn columns(header: Line<'_>, species: &Species) -> Result<Columns, Error> {
    let columns = Columns::new(fields(header)?.map(|field| {
        let name = String::from_utf8_lossy(field).to_lowercase();
        let meaning = match name.as_str() {
            "x" => Column::Axis(0),
            "y" => Column::Axis(1),
            "z" => Column::Axis(2),
            "r" | "radius" => Column::Radius,
            "species" => Column::Species,
            _ => Column::Other,
        };
        (name, meaning)
    }));
    columns.check(header, species)?;
    Ok(columns)
}

/// The fields between commas, without the white space or the quotes around them. A comma or a quote inside
/// quotes is refused rather than split: none of the columns that are read needs one.
fn fields(line: Line<'_>) -> Result<impl Iterator<Item = &[u8]>, Error> {
    let quoted = memchr::memchr(b'"', line.bytes).is_some();
    let fields = line.bytes.split(|&b| b == b',').map(move |field| {
        let field = field.trim_ascii();
        if quoted { unquoted(field).unwrap_or(field) } else { field }
    });
    if quoted && fields.clone().any(|field| field.contains(&b'"')) {
        return Err(line.unexpected("quotes around whole fields without commas or quotes in them"));
    }
    Ok(fields)
}

fn unquoted(field: &[u8]) -> Option<&[u8]> {
    field.strip_prefix(b"\"")?.strip_suffix(b"\"")
}

/// Whether the first line of a file reads like the header of a table of spheres.
pub(super) fn is_header(line: &[u8]) -> bool {
    let names: Vec<_> = line.split(|&b| b == b',').map(|f| f.trim_ascii().to_ascii_lowercase()).collect();
    [b"x", b"y", b"z"]
        .iter()
        .all(|axis| names.iter().any(|name| unquoted(name).unwrap_or(name) == axis.as_slice()))
}
