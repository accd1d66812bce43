use std::path::Path;

use super::dictionary::Descr;
use super::dtype::Dtype;
use super::header::{describe, float_type, read_text};
use super::{BLOCK, further_bytes, syntax};
use crate::error::{Error, Position};
use crate::memory::refused;
use crate::read::source::Source;

/// A NumPy file of `f32` or `f64` in any shape, byte order and memory order.
pub struct ArrayFile {
    source: Source,
    kind: Dtype,
    fortran: bool,
    shape: Vec<u64>,
    numbers: u64,
}

impl ArrayFile {
    /// Opens a file and reads its header.
    ///
    /// # Errors
    /// [`Error::Read`]; [`Error::Syntax`] for another content; [`Error::Truncated`] if the file is shorter than its
    /// header says.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        let (file, length) = super::super::open(path)?;
        Self::new(Source::new(path, file, length)?)
    }

    fn new(mut source: Source) -> Result<Self, Error> {
        let (text, end) = read_text(&mut source)?;
        let said = describe(&source, &text)?;
        let Descr::Plain(descr) = said.descr else {
            return Err(syntax(&source, "an array of numbers", "a structured array"));
        };
        let kind = float_type(&source, descr)?;
        let (shape, fortran) = (said.shape, said.fortran);
        let bytes = shape.iter().try_fold(kind.width as u64, |all, &n| all.checked_mul(n));
        let Some(bytes) = bytes else {
            return Err(syntax(&source, "an array that fits 64-bit lengths", &format!("shape {shape:?}")));
        };
        let numbers = bytes / kind.width as u64;
        match source.length.map(|length| length.saturating_sub(end)) {
            Some(there) if there < bytes => Err(truncated(&source, there / kind.width as u64, numbers)),
            _ => Ok(Self { source, kind, fortran, shape, numbers }),
        }
    }

    /// Returns the shape of the array.
    pub fn shape(&self) -> &[u64] {
        &self.shape
    }

    /// Reads the numbers, rounded to `f32`, with the last index varying fastest.
    ///
    /// # Errors
    /// [`Error::Read`], also if the system refuses the memory; [`Error::Value`] for a number that is not finite;
    /// [`Error::Truncated`]; [`Error::Syntax`] for further bytes.
    pub fn read(mut self) -> Result<Vec<f32>, Error> {
        let mut values = Vec::new();
        let mut bytes = vec![0; BLOCK * self.kind.width];
        let mut found = 0;
        while found < self.numbers {
            let block = (self.numbers - found).min(BLOCK as u64) as usize;
            let bytes = &mut bytes[..block * self.kind.width];
            let read = self.source.fill(bytes)? / self.kind.width;
            values.try_reserve(read).map_err(|_| self.refused())?;
            for value in bytes.chunks_exact(self.kind.width).take(read) {
                values.push(self.number(self.kind.float(value), found)?);
                found += 1;
            }
            if read < block {
                return Err(truncated(&self.source, found, self.numbers));
            }
        }
        if self.source.fill(&mut [0])? != 0 {
            return Err(further_bytes(&self.source));
        }
        if self.fortran { self.in_c_order(&values) } else { Ok(values) }
    }

    fn number(&self, written: f64, position: u64) -> Result<f32, Error> {
        let value = written as f32;
        if value.is_finite() {
            return Ok(value);
        }
        Err(Error::Value {
            location: self.source.at(Position::File),
            column: format!("the number at {:?}", self.index(position)),
            value: lazygrid::short(written),
            rule: "values must be finite 32-bit floating-point numbers",
        })
    }

    fn index(&self, mut position: u64) -> Vec<u64> {
        let mut index = vec![0; self.shape.len()];
        let mut next = |axis: usize| {
            index[axis] = position % self.shape[axis];
            position /= self.shape[axis];
        };
        match self.fortran {
            true => (0..self.shape.len()).for_each(&mut next),
            false => (0..self.shape.len()).rev().for_each(&mut next),
        }
        index
    }

    fn in_c_order(&self, values: &[f32]) -> Result<Vec<f32>, Error> {
        let mut ordered = Vec::new();
        ordered.try_reserve_exact(values.len()).map_err(|_| self.refused())?;
        ordered.resize(values.len(), 0.0);
        for (position, &value) in (0..).zip(values) {
            let index = self.index(position);
            let at = index.iter().zip(&self.shape).fold(0, |at, (&i, &n)| at * n + i);
            ordered[at as usize] = value;
        }
        Ok(ordered)
    }

    fn refused(&self) -> Error {
        refused(&self.source.path, &format!("{} numbers; read a smaller array", self.numbers))
    }
}

fn truncated(source: &Source, found: u64, expected: u64) -> Error {
    Error::Truncated { location: source.at(Position::File), what: "numbers", found, expected }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(descr: &str, fortran: &str, shape: &str, data: &[u8]) -> Vec<u8> {
        let header = format!("{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': {shape}, }}\n");
        super::super::tests::file(1, &header, data)
    }

    fn read(bytes: Vec<u8>) -> Result<(Vec<u64>, Vec<f32>), Error> {
        let array = ArrayFile::new(Source::from_bytes("a.npy", bytes))?;
        Ok((array.shape().to_vec(), array.read()?))
    }

    #[test]
    fn arrays_of_any_order_and_type_are_equal() {
        let c: Vec<u8> = (0..6).flat_map(|k| (k as f32).to_le_bytes()).collect();
        let fortran: Vec<u8> =
            [0, 3, 1, 4, 2, 5].into_iter().flat_map(|k| f64::from(k).to_be_bytes()).collect();
        let expected = (vec![2, 3], vec![0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
        assert_eq!(read(file("<f4", "False", "(2, 3)", &c)).unwrap(), expected);
        assert_eq!(read(file(">f8", "True", "(2, 3)", &fortran)).unwrap(), expected);
        assert_eq!(read(file("<f4", "False", "(0, 3)", &[])).unwrap(), (vec![0, 3], vec![]));
    }

    #[test]
    fn faulty_arrays_are_explained() {
        let nan = [1.0, f32::NAN].map(f32::to_le_bytes).concat();
        for (bytes, message) in [
            (
                file("<f4", "False", "(2, 1)", &nan),
                "a.npy: the number at [1, 0] is NaN; values must be finite",
            ),
            (file("<f4", "False", "(3,)", &nan), "the file ends after 2 of 3 numbers"),
            (file("<f4", "False", "(1,)", &nan), "further bytes"),
            (file("<i4", "False", "(2,)", &nan), "'<i4'; convert it with .astype('f8')"),
            (file("<f4", "False", "(99999999999, 99999999999)", &[]), "fits 64-bit lengths"),
            (b"PK".to_vec(), "expected a NumPy array"),
        ] {
            let error = read(bytes).unwrap_err().to_string();
            assert!(error.contains(message), "{error}");
        }
    }
}
