//! A time series that was written.

use std::io::{self, BufRead, BufReader};
use std::path::Path;

use crate::Error;

/// The rows of a `series.csv`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Series {
    /// The counted thing; see [`names`](crate::series::names).
    pub names: Vec<String>,
    /// Of each row: how many steps are done.
    pub steps: Vec<u32>,
    /// Of each row: the time that has passed, in s.
    pub times: Vec<f64>,
    /// Row after row, a count for each of the names.
    pub counts: Vec<u64>,
}

impl Series {
    /// Reads a series.
    ///
    /// # Errors
    /// [`Error::Read`], also for a file that is none, with the line.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let mut lines = Lines::open(path, "step,time,")?;
        let mut series = Self { names: lines.header.iter().skip(2).cloned().collect(), ..Self::default() };
        while let Some(line) = lines.next()? {
            series.steps.push(line.number(0)?);
            series.times.push(line.number(1)?);
            for column in 0..series.names.len() {
                series.counts.push(line.number(2 + column)?);
            }
        }
        Ok(series)
    }

    /// The counts of a row.
    pub fn row(&self, row: usize) -> &[u64] {
        let width = self.names.len();
        &self.counts[row * width..][..width]
    }

    /// The counts of a column, row after row.
    pub fn column(&self, column: usize) -> impl Iterator<Item = u64> + '_ {
        self.counts.iter().skip(column).step_by(self.names.len().max(1)).copied()
    }
}

/// The lines of a table that a run wrote.
pub(crate) struct Lines<'a> {
    path: &'a Path,
    pub(super) header: Vec<String>,
    lines: io::Lines<BufReader<std::fs::File>>,
    line: usize,
}

/// A line of it.
pub(crate) struct Line<'a> {
    path: &'a Path,
    number: usize,
    text: String,
    /// The end of each of its fields.
    ends: Vec<usize>,
}

impl<'a> Lines<'a> {
    /// A table whose first line begins as said.
    pub(crate) fn open(path: &'a Path, begin: &str) -> Result<Self, Error> {
        let read = |source| Error::Read { path: path.to_owned(), source };
        let mut lines = BufReader::new(std::fs::File::open(path).map_err(read)?).lines();
        let first = lines.next().transpose().map_err(read)?.unwrap_or_default();
        if !first.starts_with(begin) {
            return Err(damaged(path, 1, &format!("it does not begin with '{begin}'")));
        }
        Ok(Self { path, header: first.split(',').map(str::to_owned).collect(), lines, line: 1 })
    }

    pub(crate) fn next(&mut self) -> Result<Option<Line<'a>>, Error> {
        let read = |source| Error::Read { path: self.path.to_owned(), source };
        let Some(text) = self.lines.next().transpose().map_err(read)? else { return Ok(None) };
        self.line += 1;
        let ends: Vec<usize> = text.match_indices(',').map(|(at, _)| at).chain([text.len()]).collect();
        let line = Line { path: self.path, number: self.line, text, ends };
        match line.ends.len() == self.header.len() {
            true => Ok(Some(line)),
            false => Err(line.damaged(&format!("it has not {} fields", self.header.len()))),
        }
    }
}

impl Line<'_> {
    /// A field of it.
    pub(crate) fn field(&self, column: usize) -> &str {
        let start = column.checked_sub(1).map_or(0, |before| self.ends[before] + 1);
        &self.text[start..self.ends[column]]
    }

    /// A field of it, as a number.
    pub(crate) fn number<T: std::str::FromStr>(&self, column: usize) -> Result<T, Error> {
        let field = self.field(column);
        field.parse().map_err(|_| self.damaged(&format!("'{field}' is not such a number")))
    }

    pub(crate) fn damaged(&self, what: &str) -> Error {
        damaged(self.path, self.number, what)
    }
}

fn damaged(path: &Path, line: usize, what: &str) -> Error {
    let message = format!("line {line}: {what}; it is not as the run wrote it, so run that again");
    Error::Read { path: path.to_owned(), source: io::Error::new(io::ErrorKind::InvalidData, message) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Series, String> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        Series::read(file.path()).map_err(|error| error.to_string())
    }

    #[test]
    fn a_series_is_read_back() {
        let series = read("step,time,A,A + B -> C\n0,0,5,0\n10,0.25,4,1\n").unwrap();
        assert_eq!(
            (series.names.len(), &series.steps[..], &series.times[..]),
            (2, &[0, 10][..], &[0.0, 0.25][..])
        );
        assert_eq!((series.row(1), series.column(1).collect::<Vec<_>>()), (&[4, 1][..], vec![0, 1]));
    }

    #[test]
    fn what_is_no_series_is_refused_by_line() {
        for (text, message) in [
            ("", "line 1: it does not begin"),
            ("step,time,A\n0,0,1\n1,0.1\n", "line 3: it has not 3 fields"),
            ("step,time,A\n0,0,x\n", "line 2: 'x' is not such a number"),
            ("step,time,A\n0,0,-1\n", "line 2: '-1' is not such a number"),
        ] {
            let error = read(text).unwrap_err();
            assert!(error.contains(message), "{error}");
        }
    }
}
