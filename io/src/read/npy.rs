//! NumPy arrays, format versions 1 to 3, of one frame: `f32` or `f64` of shape `(n, 4)` with x, y, z and
//! radius, in any byte and memory order; or a structured array of shape `(n,)` with fields as in
//! [CSV](super::csv), also `pos` of three numbers.
//!
//! The file is not mapped, because shortening a mapped file ends the process.

mod array;
mod dictionary;
mod dtype;
mod fields;
mod header;
mod npy_rows;

use lazygrid::Sphere;

use self::dtype::Dtype;
use self::header::{Header, Layout, PlainLayout};
use super::line::rule_of;
use super::read_context::ReadContext;
use super::source::Source;
use super::{Frame, Precision};
use crate::error::{Error, Position};

pub use self::array::ArrayFile;
pub use self::npy_rows::NpyRows;

pub(super) const MAGIC: &[u8] = b"\x93NUMPY";
/// In the cache between decoding and checking.
const BLOCK: usize = 1 << 15;
const COLUMNS: [&str; 4] = ["x", "y", "z", "radius"];

pub(super) fn read(mut source: Source, context: &mut ReadContext) -> Result<Frame, Error> {
    let header = Header::parse(&mut source)?;
    read_body(&mut source, &header, context)
}

fn read_body(source: &mut Source, header: &Header, context: &mut ReadContext) -> Result<Frame, Error> {
    header.check_count(source)?;
    header.check_length(source)?;
    context.choose_precision(&header.layout);
    let mut frame = Frame::with_capacity(0, context);
    if source.length.is_some() {
        let reserved = frame.try_reserve(header.rows as usize);
        reserved.map_err(|_| header.out_of_memory(source))?;
    }
    match &header.layout {
        Layout::Plain(_) if context.ids => {
            let expected = "a structured array with a field `id`, which --ids asks for";
            return Err(syntax(source, expected, "an array of numbers"));
        }
        Layout::Plain(_) if context.groups => {
            let expected = "a structured array with a field `group`, `molecule` or `mol`, which --exclude-groups asks for";
            return Err(syntax(source, expected, "an array of numbers"));
        }
        Layout::Plain(PlainLayout { kind: Dtype::NATIVE_F32, fortran: false }) if !context.doubles => {
            read_rows(source, header, &mut frame.spheres)?;
        }
        &Layout::Plain(plain) => decode(source, header, plain, &mut frame, context)?,
        Layout::Structured(fields) => fields.read(source, header, &mut frame, context)?,
    }
    if source.fill(&mut [0])? != 0 {
        return Err(further_bytes(source));
    }
    Ok(frame)
}

#[derive(Clone, Copy)]
struct ArrayNumber<'a> {
    row: u64,
    column: &'a str,
    is_radius: bool,
    written: f64,
}

impl ArrayNumber<'_> {
    fn in_column(column: usize, row: u64, written: f64) -> Self {
        Self { row, column: COLUMNS[column], is_radius: column == 3, written }
    }
}

fn read_rows(source: &mut Source, header: &Header, spheres: &mut Vec<Sphere>) -> Result<(), Error> {
    let rows = header.rows;
    while (spheres.len() as u64) < rows {
        let start = spheres.len();
        let block = (rows - start as u64).min(BLOCK as u64) as usize;
        spheres.try_reserve(block).map_err(|_| header.out_of_memory(source))?;
        spheres.resize(start + block, Sphere::default());
        let bytes = bytemuck::cast_slice_mut(&mut spheres[start..]);
        let read = source.fill(bytes)?;
        if read < bytes.len() {
            let found = (start + read / size_of::<Sphere>()) as u64;
            return Err(truncated(source, found, rows));
        }
        if !spheres[start..].iter().fold(true, |valid, sphere| valid & sphere.is_valid()) {
            for (row, sphere) in spheres.iter().enumerate().skip(start) {
                for (column, &value) in bytemuck::cast_ref::<_, [f32; 4]>(sphere).iter().enumerate() {
                    check(source, ArrayNumber::in_column(column, row as u64, value.into()), false)?;
                }
            }
        }
    }
    Ok(())
}

fn decode(
    source: &mut Source,
    header: &Header,
    plain: PlainLayout,
    frame: &mut Frame,
    context: &mut ReadContext,
) -> Result<(), Error> {
    let PlainLayout { kind, fortran } = plain;
    let width = kind.width;
    let mut bytes = vec![0; BLOCK * width];
    let rows = header.rows;
    let total = rows * 4;
    let mut next = 0;
    while next < total {
        let block = (total - next).min(BLOCK as u64) as usize * width;
        let read = source.fill(&mut bytes[..block])?;
        for value in bytes[..read].chunks_exact(width) {
            let written = kind.float(value);
            let (row, column) =
                if fortran { (next % rows, (next / rows) as usize) } else { (next / 4, (next % 4) as usize) };
            let value = context.number(source, ArrayNumber::in_column(column, row, written))?;
            if column == 0 {
                frame.try_reserve(1).map_err(|_| header.out_of_memory(source))?;
                frame.push([0.0; 4]);
            }
            match &mut frame.doubles {
                Some(doubles) => doubles[row as usize][column] = value,
                None => {
                    bytemuck::cast_mut::<_, [f32; 4]>(&mut frame.spheres[row as usize])[column] =
                        value as f32;
                }
            }
            next += 1;
        }
        if read < block {
            return Err(truncated(source, next / 4, rows));
        }
    }
    Ok(())
}

impl ReadContext {
    fn choose_precision(&mut self, layout: &Layout) {
        if self.precision == Precision::Auto {
            let takes_radii = layout.has_species() && !self.species.radii_fit_f32();
            self.doubles = layout.has_f64() || takes_radii;
        }
    }

    fn number(&mut self, source: &Source, number: ArrayNumber<'_>) -> Result<f64, Error> {
        let value = check(source, number, self.doubles)?;
        if value != number.written {
            self.warn_of_rounding(source.at(Position::Row(number.row)), number.column, number.written);
        }
        Ok(value)
    }
}

fn check(source: &Source, number: ArrayNumber<'_>, doubles: bool) -> Result<f64, Error> {
    let ArrayNumber { row, column, is_radius, written } = number;
    let value = if doubles { written } else { f64::from(written as f32) };
    let rule = if !value.is_finite() {
        rule_of(doubles)
    } else if is_radius && value < 0.0 {
        "radii must not be negative"
    } else {
        return Ok(value);
    };
    let (column, value) = (column.to_owned(), lazygrid::short(written));
    Err(Error::Value { location: source.at(Position::Row(row)), column, value, rule })
}

fn truncated(source: &Source, found: u64, expected: u64) -> Error {
    Error::Truncated { location: source.at(Position::File), what: "rows", found, expected }
}

fn further_bytes(source: &Source) -> Error {
    syntax(source, "the end of the file after the array", "further bytes")
}

fn syntax(source: &Source, expected: &str, found: &str) -> Error {
    Error::Syntax {
        location: source.at(Position::File),
        expected: expected.to_owned(),
        found: found.to_owned(),
    }
}

#[cfg(test)]
pub(super) mod tests {
    pub(crate) fn file(version: u8, header: &str, data: &[u8]) -> Vec<u8> {
        let length = (header.len() as u32).to_le_bytes();
        let width = if version == 1 { 2 } else { 4 };
        [super::MAGIC, &[version, 0], &length[..width], header.as_bytes(), data].concat()
    }
}
