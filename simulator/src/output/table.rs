//! A reader of `.csv` tables that runs write.

use std::io::{self, BufRead, BufReader};
use std::path::Path;

use lazygrid_io::excerpt;

use crate::Error;

pub struct TableReader<'a> {
    path: &'a Path,
    header: Vec<String>,
    lines: io::Lines<BufReader<std::fs::File>>,
    line: usize,
}

pub struct TableRow<'a> {
    path: &'a Path,
    number: usize,
    text: String,
    ends: Vec<usize>,
}

impl<'a> TableReader<'a> {
    /// Opens a table whose first line begins with `begin`.
    ///
    /// # Errors
    /// [`Error::Read`] if the file cannot be read or begins otherwise.
    pub fn open(path: &'a Path, begin: &str) -> Result<Self, Error> {
        let read = |source| Error::Read { path: path.to_owned(), source };
        let mut lines = BufReader::new(std::fs::File::open(path).map_err(read)?).lines();
        let first = lines.next().transpose().map_err(read)?.unwrap_or_default();
        if !first.starts_with(begin) {
            return Err(damaged(path, 1, &format!("it does not begin with '{begin}'")));
        }
        Ok(Self { path, header: first.split(',').map(str::to_owned).collect(), lines, line: 1 })
    }

    pub fn header(&self) -> &[String] {
        &self.header
    }

    /// Reads the next row, if any.
    ///
    /// # Errors
    /// [`Error::Read`] if the file cannot be read or the row's number of fields is wrong.
    pub fn next_row(&mut self) -> Result<Option<TableRow<'a>>, Error> {
        let read = |source| Error::Read { path: self.path.to_owned(), source };
        let Some(text) = self.lines.next().transpose().map_err(read)? else { return Ok(None) };
        self.line += 1;
        let ends: Vec<usize> = text.match_indices(',').map(|(at, _)| at).chain([text.len()]).collect();
        let line = TableRow { path: self.path, number: self.line, text, ends };
        match line.ends.len() == self.header.len() {
            true => Ok(Some(line)),
            false => Err(line.damaged(&format!("it has not {} fields", self.header.len()))),
        }
    }
}

impl TableRow<'_> {
    pub fn field(&self, column: usize) -> &str {
        let start = column.checked_sub(1).map_or(0, |before| self.ends[before] + 1);
        &self.text[start..self.ends[column]]
    }

    /// Parses a field as a number.
    ///
    /// # Errors
    /// [`Error::Read`] with the line if the field is no such number.
    pub fn number<T: std::str::FromStr>(&self, column: usize) -> Result<T, Error> {
        let field = self.field(column);
        let refused = |_| self.damaged(&format!("'{}' is not such a number", excerpt(field.as_bytes())));
        field.parse().map_err(refused)
    }

    /// Returns an [`Error::Read`] for this line.
    pub fn damaged(&self, what: &str) -> Error {
        damaged(self.path, self.number, what)
    }
}

fn damaged(path: &Path, line: usize, what: &str) -> Error {
    let message = format!("line {line}: {what}; it is not as the run wrote it, so run that again");
    Error::Read { path: path.to_owned(), source: io::Error::new(io::ErrorKind::InvalidData, message) }
}
