//! NumPy arrays of shape `(n, 4)`, `f32` or `f64`, of either byte order and either memory order; versions 1 to 3
//! of the file format. One frame.
//!
//! Rows of `f32` as this machine stores them are read straight into the spheres, with no copy in between. The
//! file is read rather than mapped: a mapped file that another program shortens ends this one.

use lazygrid::{MAX_SPHERES, Sphere};

use super::species::Species;
use super::{Frame, Source};
use crate::error::{At, Error, excerpt};

/// The first bytes of every such file.
pub(super) const MAGIC: &[u8] = b"\x93NUMPY";
/// The longest header that is read; a longer one does not describe a plain table.
const LONGEST_HEADER: usize = 1 << 16;
/// Values decoded or rows checked at a time: few enough to stay in the cache between the two.
const BLOCK: usize = 1 << 15;
const COLUMNS: [&str; 4] = ["x", "y", "z", "radius"];

pub(super) fn read(mut source: Source, _: &mut Species) -> Result<Frame, Error> {
    let header = Header::read(&mut source)?;
    header.check_length(&source)?;
    let mut spheres = Vec::new();
    if source.length.is_some() {
        // The length shows that the rows are there. Where it is not known, room is made as they come.
        spheres.try_reserve_exact(header.rows as usize).map_err(|_| header.too_many(&source, "memory"))?;
    }
    if header.number == Number::NATIVE && !header.fortran {
        read_rows(&mut source, &header, &mut spheres)?;
    } else {
        decode(&mut source, &header, &mut spheres)?;
    }
    if source.fill(&mut [0])? != 0 {
        return Err(syntax(&source, "the end of the file after the array", "further bytes"));
    }
    Ok(Frame { spheres, ..Frame::default() })
}

/// Rows that are stored as spheres are.
fn read_rows(source: &mut Source, header: &Header, spheres: &mut Vec<Sphere>) -> Result<(), Error> {
    let rows = header.rows;
    while (spheres.len() as u64) < rows {
        let start = spheres.len();
        let block = (rows - start as u64).min(BLOCK as u64) as usize;
        spheres.try_reserve(block).map_err(|_| header.too_many(source, "memory"))?;
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
                    check(source, (row as u64, column), value, value.into())?;
                }
            }
        }
    }
    Ok(())
}

/// Values in any other arrangement, one after the other.
fn decode(source: &mut Source, header: &Header, spheres: &mut Vec<Sphere>) -> Result<(), Error> {
    let (rows, width) = (header.rows, header.number.width());
    let mut bytes = vec![0; BLOCK * width];
    let total = rows * 4;
    let mut next = 0;
    while next < total {
        let block = (total - next).min(BLOCK as u64) as usize * width;
        let read = source.fill(&mut bytes[..block])?;
        for value in bytes[..read].chunks_exact(width) {
            let value = header.number.decode(value);
            let (row, column) = if header.fortran {
                (next % rows, (next / rows) as usize)
            } else {
                (next / 4, (next % 4) as usize)
            };
            check(source, (row, column), value as f32, value)?;
            if column == 0 {
                spheres.try_reserve(1).map_err(|_| header.too_many(source, "memory"))?;
                spheres.push(Sphere::default());
            }
            bytemuck::cast_mut::<_, [f32; 4]>(&mut spheres[row as usize])[column] = value as f32;
            next += 1;
        }
        if read < block {
            return Err(truncated(source, next / 4, rows));
        }
    }
    Ok(())
}

fn check(source: &Source, (row, column): (u64, usize), value: f32, written: f64) -> Result<(), Error> {
    let rule = if !value.is_finite() {
        "values must be finite 32-bit floating-point numbers"
    } else if column == 3 && value < 0.0 {
        "radii must not be negative"
    } else {
        return Ok(());
    };
    let (column, value) = (COLUMNS[column].to_owned(), written.to_string());
    Err(Error::Value { place: source.at(At::Row(row)), column, value, rule })
}

/// How a value is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Number {
    F32Little,
    F32Big,
    F64Little,
    F64Big,
}

impl Number {
    const NATIVE: Self = if cfg!(target_endian = "big") { Self::F32Big } else { Self::F32Little };

    fn width(self) -> usize {
        match self {
            Self::F32Little | Self::F32Big => 4,
            Self::F64Little | Self::F64Big => 8,
        }
    }

    /// The value of [`width`](Self::width) bytes.
    fn decode(self, bytes: &[u8]) -> f64 {
        let four = || bytes.first_chunk().copied().unwrap_or_default();
        let eight = || bytes.first_chunk().copied().unwrap_or_default();
        match self {
            Self::F32Little => f32::from_le_bytes(four()).into(),
            Self::F32Big => f32::from_be_bytes(four()).into(),
            Self::F64Little => f64::from_le_bytes(eight()),
            Self::F64Big => f64::from_be_bytes(eight()),
        }
    }
}

/// What the file says about its array.
#[derive(Debug, PartialEq)]
struct Header {
    number: Number,
    fortran: bool,
    rows: u64,
    /// Bytes before the array.
    end: u64,
}

impl Header {
    fn read(source: &mut Source) -> Result<Self, Error> {
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
        let (descr, fortran, shape) = Dictionary::parse(&text).map_err(|rest| {
            let expected = "a header {'descr': …, 'fortran_order': …, 'shape': …} of a plain array";
            syntax(source, expected, &format!("'{}'", excerpt(rest)))
        })?;
        let number = match descr {
            b"<f4" => Number::F32Little,
            b">f4" => Number::F32Big,
            b"<f8" => Number::F64Little,
            b">f8" => Number::F64Big,
            _ => {
                let found = format!("'{}'; convert it with .astype('f4')", excerpt(descr));
                return Err(syntax(source, "values of type f4 or f8", &found));
            }
        };
        let &[rows, 4] = shape.as_slice() else {
            return Err(syntax(source, "an array of shape (n, 4)", &format!("shape {shape:?}")));
        };
        let header = Self { number, fortran, rows, end: (start.len() + width + length) as u64 };
        if rows > MAX_SPHERES {
            return Err(header.too_many(source, "32-bit indices"));
        }
        Ok(header)
    }

    /// Refuses a file that is not as long as its header says, before room is made for what is not there.
    fn check_length(&self, source: &Source) -> Result<(), Error> {
        let row = 4 * self.number.width() as u64;
        match source.length.map(|length| length.saturating_sub(self.end)) {
            Some(bytes) if bytes < self.rows * row => Err(truncated(source, bytes / row, self.rows)),
            _ => Ok(()),
        }
    }

    fn too_many(&self, source: &Source, limit: &'static str) -> Error {
        Error::TooManySpheres { place: source.at(At::File), spheres: self.rows, limit }
    }
}

fn truncated(source: &Source, found: u64, expected: u64) -> Error {
    Error::Truncated { place: source.at(At::File), what: "rows", found, expected }
}

fn syntax(source: &Source, expected: &str, found: &str) -> Error {
    Error::Syntax { place: source.at(At::File), expected: expected.to_owned(), found: found.to_owned() }
}

/// The Python dictionary of a header, as far as it has been read.
struct Dictionary<'a> {
    rest: &'a [u8],
}

/// The type of the values, whether columns are contiguous, and the shape.
type Description<'a> = (&'a [u8], bool, Vec<u64>);

impl<'a> Dictionary<'a> {
    /// The three entries; where that fails, the text from there on.
    fn parse(text: &'a [u8]) -> Result<Description<'a>, &'a [u8]> {
        let mut this = Self { rest: text };
        this.entries().ok_or(this.rest)
    }

    fn entries(&mut self) -> Option<Description<'a>> {
        let (mut descr, mut fortran, mut shape) = (None, None, None);
        self.token(b"{")?;
        while self.token(b"}").is_none() {
            let key = self.string()?;
            self.token(b":")?;
            match key {
                b"descr" => descr = Some(self.string()?),
                b"fortran_order" => fortran = Some(self.boolean()?),
                b"shape" => shape = Some(self.tuple()?),
                _ => return None,
            }
            // The last entry may have a comma too.
            let _ = self.token(b",");
        }
        Some((descr?, fortran?, shape?))
    }

    fn token(&mut self, token: &[u8]) -> Option<()> {
        self.rest = self.rest.trim_ascii_start();
        self.rest = self.rest.strip_prefix(token)?;
        Some(())
    }

    fn string(&mut self) -> Option<&'a [u8]> {
        let quote = if self.token(b"'").is_some() { b'\'' } else { self.token(b"\"").map(|()| b'"')? };
        let end = memchr::memchr(quote, self.rest)?;
        let (string, rest) = self.rest.split_at(end);
        self.rest = &rest[1..];
        Some(string)
    }

    fn boolean(&mut self) -> Option<bool> {
        let yes = self.token(b"True").is_some();
        (yes || self.token(b"False").is_some()).then_some(yes)
    }

    fn tuple(&mut self) -> Option<Vec<u64>> {
        self.token(b"(")?;
        let mut values = Vec::new();
        while self.token(b")").is_none() {
            self.rest = self.rest.trim_ascii_start();
            let (value, length) = lexical_core::parse_partial(self.rest).ok().filter(|&(_, n)| n > 0)?;
            values.push(value);
            self.rest = &self.rest[length..];
            let _ = self.token(b",");
        }
        Some(values)
    }
}
