use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use super::Source;
use crate::error::{At, Error, Place, excerpt};

/// The longest line that is read. Bounds memory where a file turns out not to be text.
const LONGEST_LINE: usize = 1 << 20;

/// The lines of a text, without their ends, one at a time from a buffer that is reused.
pub(super) struct Lines {
    source: Source,
    buffer: Vec<u8>,
    /// What of the buffer is read and not yet handed out.
    unread: Range<usize>,
    /// The last line, within the buffer.
    line: Range<usize>,
    number: u64,
    ended: bool,
}

/// One line, and where it stands.
#[derive(Clone, Copy)]
pub(super) struct Line<'a> {
    pub(super) bytes: &'a [u8],
    pub(super) number: u64,
    path: &'a Arc<Path>,
}

impl Lines {
    pub(super) fn new(source: Source) -> Self {
        Self { source, buffer: vec![0; LONGEST_LINE], unread: 0..0, line: 0..0, number: 0, ended: false }
    }

    /// The next line that is not blank, or `None` at the end. Ends are `\n` or `\r\n`; a byte-order mark is
    /// skipped.
    pub(super) fn next(&mut self) -> Result<Option<Line<'_>>, Error> {
        while self.advance()? {
            if !self.line().is_blank() {
                return Ok(Some(self.line()));
            }
        }
        Ok(None)
    }

    /// The next line of a frame that is not complete without it: `found` of `expected` of `what` were there.
    pub(super) fn required(
        &mut self,
        what: &'static str,
        found: u64,
        expected: u64,
    ) -> Result<Line<'_>, Error> {
        if self.advance()? {
            Ok(self.line())
        } else {
            Err(Error::Truncated { place: self.place(), what, found, expected })
        }
    }

    /// Where the last line stands; before the first, the file.
    pub(super) fn place(&self) -> Place {
        let at = if self.number == 0 { At::File } else { At::Line(self.number) };
        Place { path: self.source.path.clone(), at }
    }

    fn line(&self) -> Line<'_> {
        Line { bytes: &self.buffer[self.line.clone()], number: self.number, path: &self.source.path }
    }

    fn advance(&mut self) -> Result<bool, Error> {
        let mut searched = 0;
        let (length, end) = loop {
            let unread = &self.buffer[self.unread.clone()];
            match memchr::memchr(b'\n', &unread[searched..]) {
                Some(at) => break (searched + at, 1),
                None if self.ended && unread.is_empty() => return Ok(false),
                None if self.ended => break (unread.len(), 0),
                None => searched = unread.len(),
            }
            self.fill()?;
        };
        let start = self.unread.start;
        self.unread.start += length + end;
        self.number += 1;
        let bytes = &self.buffer[start..start + length];
        let mark = if self.number == 1 && bytes.starts_with(b"\xEF\xBB\xBF") { 3 } else { 0 };
        let carriage = usize::from(bytes[mark..].ends_with(b"\r"));
        self.line = start + mark..start + length - carriage;
        Ok(true)
    }

    /// Moves what is unread to the front and reads more behind it.
    fn fill(&mut self) -> Result<(), Error> {
        self.buffer.copy_within(self.unread.clone(), 0);
        self.unread = 0..self.unread.len();
        if self.unread.end == self.buffer.len() {
            let place = Place { path: self.source.path.clone(), at: At::Line(self.number + 1) };
            return Err(Error::LineTooLong { place, limit: LONGEST_LINE });
        }
        let read = self.source.read(&mut self.buffer[self.unread.end..])?;
        self.unread.end += read;
        self.ended = read == 0;
        Ok(())
    }
}

impl<'a> Line<'a> {
    /// The fields between white space.
    pub(super) fn words(self) -> impl Iterator<Item = &'a [u8]> {
        self.bytes.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty())
    }

    pub(super) fn is_blank(self) -> bool {
        self.bytes.trim_ascii().is_empty()
    }

    pub(super) fn place(self) -> Place {
        Place { path: self.path.clone(), at: At::Line(self.number) }
    }

    /// The line is not what the format wants.
    pub(super) fn unexpected(self, expected: impl Into<String>) -> Error {
        let found = match self.is_blank() {
            true => "a blank line".to_owned(),
            false => format!("'{}'", excerpt(self.bytes)),
        };
        Error::Syntax { place: self.place(), expected: expected.into(), found }
    }

    /// The whole line as a whole number.
    pub(super) fn count(self, what: &str) -> Result<u64, Error> {
        let digits = self.bytes.trim_ascii();
        lexical_core::parse(digits).map_err(|_| self.unexpected(what))
    }

    /// A field as a finite number.
    pub(super) fn number<F>(self, column: &str, field: &[u8]) -> Result<F, Error>
    where
        F: lexical_core::FromLexical + Into<f64> + Copy,
    {
        match lexical_core::parse::<F>(field) {
            Ok(value) if value.into().is_finite() => Ok(value),
            Ok(_) => Err(self.refuse(column, field, "values must be finite 32-bit floating-point numbers")),
            Err(_) => {
                let (column, text) = (column.to_owned(), excerpt(field));
                Err(Error::Number { place: self.place(), column, text })
            }
        }
    }

    /// A field as a radius: finite and not negative.
    pub(super) fn radius(self, column: &str, field: &[u8]) -> Result<f32, Error> {
        let radius = self.number(column, field)?;
        if radius < 0.0 {
            return Err(self.refuse(column, field, "radii must not be negative"));
        }
        Ok(radius)
    }

    pub(super) fn refuse(self, column: &str, field: &[u8], rule: &'static str) -> Error {
        Error::Value { place: self.place(), column: column.to_owned(), value: excerpt(field), rule }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(text: &'static [u8]) -> Lines {
        Lines::new(Source::from_bytes("test", text))
    }

    #[test]
    fn ends_and_marks_are_not_part_of_a_line() {
        let mut lines = lines(b"\xEF\xBB\xBFone\r\n\ntwo\n three");
        let mut seen = Vec::new();
        while let Some(line) = lines.next().unwrap() {
            seen.push((line.number, line.bytes.to_vec()));
        }
        let expected: [(u64, &[u8]); 3] = [(1, b"one"), (3, b"two"), (4, b" three")];
        assert_eq!(seen, expected.map(|(n, bytes)| (n, bytes.to_vec())));
    }

    #[test]
    fn a_line_may_span_reads_but_not_exceed_the_limit() {
        let fits = [vec![b'a'; LONGEST_LINE - 1], vec![b'\n'; 1], vec![b'b'; LONGEST_LINE - 1]].concat();
        let mut lines = Lines::new(Source::from_bytes("test", fits));
        assert_eq!(lines.next().unwrap().unwrap().bytes.len(), LONGEST_LINE - 1);
        assert_eq!(lines.next().unwrap().unwrap().bytes.len(), LONGEST_LINE - 1);
        assert!(lines.next().unwrap().is_none());

        let long = [b"short\n".to_vec(), vec![b'a'; LONGEST_LINE + 1]].concat();
        let mut lines = Lines::new(Source::from_bytes("test", long));
        lines.next().unwrap();
        assert_eq!(
            lines.next().err().unwrap().to_string(),
            "test, line 2: the line is longer than 1048576 bytes; is this a text file?"
        );
    }

    #[test]
    fn numbers_are_finite_and_whole_fields() {
        let mut lines = lines(b"row");
        let line = lines.next().unwrap().unwrap();
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
