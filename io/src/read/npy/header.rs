use lazygrid::MAX_SPHERES;

use super::dictionary::{Descr, Description, Dictionary};
use super::dtype::{Dtype, DtypeKind};
use super::fields::Fields;
use super::{MAGIC, Source, syntax, truncated};
use crate::error::{Error, Position, excerpt};

/// Maximum header length in bytes; a longer header cannot describe a plain table.
const LONGEST_HEADER: usize = 1 << 16;

pub(super) struct Header {
    pub(super) layout: Layout,
    pub(super) rows: u64,
    /// Length in bytes.
    pub(super) end: u64,
}

pub(super) enum Layout {
    Plain(PlainLayout),
    Structured(Fields),
}

#[derive(Clone, Copy)]
pub(super) struct PlainLayout {
    pub(super) kind: Dtype,
    pub(super) fortran: bool,
}

pub(super) fn read_text(source: &mut Source) -> Result<(Vec<u8>, u64), Error> {
    let mut start = [0; 8];
    if source.fill(&mut start)? < start.len() || !start.starts_with(MAGIC) {
        return Err(syntax(source, "a NumPy array", "other content"));
    }
    let major = start[6];
    let mut length = [0; 4];
    let width = match major {
        1 => 2,
        2 | 3 => 4,
        _ => {
            let found = format!("version {major}");
            return Err(syntax(source, "version 1, 2 or 3 of the NumPy format", &found));
        }
    };
    source.fill(&mut length[..width])?;
    let length = u32::from_le_bytes(length) as usize;
    if length > LONGEST_HEADER {
        let expected = format!("a header of at most {LONGEST_HEADER} bytes");
        return Err(syntax(source, &expected, &format!("{length}")));
    }
    let mut text = vec![0; length];
    if source.fill(&mut text)? < length {
        return Err(syntax(source, "a whole header", "the end of the file"));
    }
    Ok((text, (start.len() + width + length) as u64))
}

impl Layout {
    pub(super) fn has_f64(&self) -> bool {
        match self {
            Self::Plain(plain) => plain.kind.is_f64(),
            Self::Structured(fields) => fields.has_f64(),
        }
    }

    pub(super) fn has_species(&self) -> bool {
        match self {
            Self::Plain(_) => false,
            Self::Structured(fields) => fields.has_species(),
        }
    }
}

impl Header {
    pub(super) fn parse(source: &mut Source) -> Result<Self, Error> {
        let (text, end) = read_text(source)?;
        let (layout, rows) = layout(source, &text)?;
        Ok(Self { layout, rows, end })
    }

    pub(super) fn check_count(&self, source: &Source) -> Result<(), Error> {
        if self.rows > MAX_SPHERES {
            return Err(Error::TooManySpheres { location: source.at(Position::File), spheres: self.rows });
        }
        Ok(())
    }

    pub(super) fn row_bytes(&self) -> u64 {
        match &self.layout {
            Layout::Plain(plain) => 4 * plain.kind.width as u64,
            Layout::Structured(fields) => fields.width() as u64,
        }
    }

    /// Requires the declared rows before memory is reserved.
    pub(super) fn check_length(&self, source: &Source) -> Result<(), Error> {
        let row = self.row_bytes();
        match source.length.map(|length| length.saturating_sub(self.end)) {
            Some(bytes) if bytes < self.rows.saturating_mul(row) => {
                Err(truncated(source, bytes / row, self.rows))
            }
            _ => Ok(()),
        }
    }

    pub(super) fn out_of_memory(&self, source: &Source) -> Error {
        Error::OutOfMemory { location: source.at(Position::File), spheres: self.rows }
    }
}

pub(super) fn describe<'a>(source: &Source, text: &'a [u8]) -> Result<Description<'a>, Error> {
    Dictionary::parse(text).map_err(|rest| {
        let expected = "a header {'descr': …, 'fortran_order': …, 'shape': …} of a plain or structured array";
        syntax(source, expected, &format!("'{}'", excerpt(rest)))
    })
}

pub(super) fn float_type(source: &Source, descr: &[u8]) -> Result<Dtype, Error> {
    Dtype::parse(descr).filter(|kind| kind.class == DtypeKind::Float).ok_or_else(|| {
        let wide = if descr.ends_with(b"f2") { "f4" } else { "f8" };
        let found = format!("'{}'; convert it with .astype('{wide}')", excerpt(descr));
        syntax(source, "values of type f4 or f8", &found)
    })
}

fn layout(source: &Source, text: &[u8]) -> Result<(Layout, u64), Error> {
    let said = describe(source, text)?;
    let found = format!("shape {:?}", said.shape);
    match said.descr {
        Descr::Plain(descr) => {
            let kind = float_type(source, descr)?;
            match said.shape.as_slice() {
                &[rows, 4] => Ok((Layout::Plain(PlainLayout { kind, fortran: said.fortran }), rows)),
                _ => Err(syntax(source, "an array of shape (n, 4)", &found)),
            }
        }
        Descr::Structured(fields) => match *said.shape {
            [rows] => Ok((Layout::Structured(Fields::new(source, &fields)?), rows)),
            _ => Err(syntax(source, "a structured array of shape (n,)", &found)),
        },
    }
}
