use std::path::Path;
use std::sync::Arc;

use lazygrid::Spheres;

use crate::error::{Error, Location, Position, excerpt};

/// Bounds memory if the file is not text.
pub(super) const LONGEST_LINE: usize = 1 << 20;

#[derive(Clone, Copy)]
pub(super) struct Line<'a> {
    pub(super) bytes: &'a [u8],
    pub(super) number: u64,
    pub(super) path: &'a Arc<Path>,
}

/// Begins text files that some programs write in UTF-8.
pub const BYTE_ORDER_MARK: &[u8] = b"\xEF\xBB\xBF";

impl<'a> Line<'a> {
    pub(super) fn new(bytes: &'a [u8], number: u64, path: &'a Arc<Path>) -> Result<Self, Error> {
        if bytes.len() > LONGEST_LINE {
            return Err(too_long(Location { path: path.clone(), at: Position::Line(number) }));
        }
        let mark = if number == 1 { BYTE_ORDER_MARK } else { b"" };
        let bytes = bytes.strip_prefix(mark).unwrap_or(bytes);
        Ok(Self { bytes: bytes.strip_suffix(b"\r").unwrap_or(bytes), number, path })
    }

    pub(super) fn words(self) -> impl Iterator<Item = &'a [u8]> {
        self.bytes.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty())
    }

    pub(super) fn is_blank(self) -> bool {
        self.bytes.trim_ascii().is_empty()
    }

    pub(super) fn location(self) -> Location {
        Location { path: self.path.clone(), at: Position::Line(self.number) }
    }

    pub(super) fn unexpected(self, expected: impl Into<String>) -> Error {
        let found = match self.is_blank() {
            true => "a blank line".to_owned(),
            false => format!("'{}'", excerpt(self.bytes)),
        };
        Error::Syntax { location: self.location(), expected: expected.into(), found }
    }

    pub(super) fn count(self, what: &str) -> Result<u64, Error> {
        let digits = self.bytes.trim_ascii();
        lexical_core::parse(digits).map_err(|_| self.unexpected(format!("{what}, a whole number")))
    }

    pub(super) fn number<F>(self, column: &str, field: &[u8]) -> Result<F, Error>
    where
        F: lexical_core::FromLexical + Into<f64> + Copy,
    {
        match lexical_core::parse::<F>(field) {
            Ok(value) if value.into().is_finite() => Ok(value),
            Ok(_) => Err(self.refuse(column, field, rule_of(size_of::<F>() > 4))),
            Err(_) => {
                let (column, text) = (column.to_owned(), excerpt(field));
                Err(Error::Number { location: self.location(), column, text })
            }
        }
    }

    pub(super) fn real(self, column: &str, field: &[u8], doubles: bool) -> Result<f64, Error> {
        match doubles {
            true => self.number(column, field),
            false => self.number::<f32>(column, field).map(f64::from),
        }
    }

    pub(super) fn radius(self, column: &str, field: &[u8], doubles: bool) -> Result<f64, Error> {
        let radius = self.real(column, field, doubles)?;
        if radius < 0.0 {
            let rule = match column.eq_ignore_ascii_case("diameter") {
                true => "diameters must not be negative",
                false => "radii must not be negative",
            };
            return Err(self.refuse(column, field, rule));
        }
        Ok(radius)
    }

    pub(super) fn id(self, field: &[u8]) -> Result<i64, Error> {
        let found = || format!("'{}'", excerpt(field));
        lexical_core::parse(field).map_err(|_| Error::Syntax {
            location: self.location(),
            expected: "a whole number as id".to_owned(),
            found: found(),
        })
    }

    pub(super) fn group(self, field: &[u8]) -> Result<u32, Error> {
        let refused = || Error::Syntax {
            location: self.location(),
            expected: GROUPS.to_owned(),
            found: format!("'{}'", excerpt(field)),
        };
        let number = lexical_core::parse::<u64>(field).map_err(|_| refused())?;
        group_of(number.into()).ok_or_else(refused)
    }

    pub(super) fn refuse(self, column: &str, field: &[u8], rule: &'static str) -> Error {
        Error::Value { location: self.location(), column: column.to_owned(), value: excerpt(field), rule }
    }
}

pub(super) fn rule_of(doubles: bool) -> &'static str {
    match doubles {
        true => "values must be finite floating-point numbers",
        false => "values must be finite 32-bit floating-point numbers",
    }
}

pub(super) const GROUPS: &str = "groups as whole numbers below 2^32 - 1, 0 for none";

pub(super) fn group_of(number: i128) -> Option<u32> {
    match u32::try_from(number).ok()? {
        0 => Some(Spheres::NO_GROUP),
        Spheres::NO_GROUP => None,
        group => Some(group),
    }
}

pub(super) fn too_long(location: Location) -> Error {
    Error::LineTooLong { location, limit: LONGEST_LINE }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_finite_and_whole_fields() {
        let path = Arc::from(Path::new("test"));
        let line = Line::new(b"row", 1, &path).unwrap();
        for (field, value) in [("1", 1.0), ("+2.5", 2.5), ("-1e-3", -1e-3), (".5", 0.5), ("3.", 3.0)] {
            assert_eq!(line.number::<f32>("x", field.as_bytes()).unwrap(), value, "{field}");
        }
        for (field, message) in [
            ("1e39", "x is 1e39; values must be finite 32-bit floating-point numbers"),
            ("nan", "x is nan; values must be finite 32-bit floating-point numbers"),
            ("-inf", "x is -inf; values must be finite 32-bit floating-point numbers"),
            ("", "x '' is not a number"),
            ("1.0abc", "x '1.0abc' is not a number"),
            ("0x10", "x '0x10' is not a number"),
        ] {
            let error = line.number::<f32>("x", field.as_bytes()).unwrap_err();
            assert_eq!(error.to_string(), format!("test, line 1: {message}"));
        }
    }
}
