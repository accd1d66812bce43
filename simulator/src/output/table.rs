use std::fs::File;
use std::io::{self, BufRead, BufReader, Seek};
use std::path::Path;

use lazygrid_io::excerpt;

use crate::Error;
use crate::memory::check_available;

pub struct TableReader<'a> {
    path: &'a Path,
    header: Vec<String>,
    lines: io::Lines<BufReader<File>>,
    line: usize,
}

pub struct TableRow<'a> {
    path: &'a Path,
    number: usize,
    text: String,
    ends: Vec<usize>,
}

impl<'a> TableReader<'a> {
    /// Opens a table whose first line begins with `begin`. The caller will need `bytes_per_field` bytes for each field.
    ///
    /// # Errors
    /// [`Error::Read`] if the file cannot be read or begins otherwise, and [`Error::TooLittleMemory`] for its fields.
    pub fn open(path: &'a Path, begin: &str, bytes_per_field: u64) -> Result<Self, Error> {
        let read = |source| Error::Read { path: path.to_owned(), source };
        let mut file = File::open(path).map_err(read)?;
        check_memory(path, &mut file, bytes_per_field)?;
        let mut lines = BufReader::new(file).lines();
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

    /// Parses a field.
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

fn check_memory(path: &Path, file: &mut File, bytes_per_field: u64) -> Result<(), Error> {
    let check = |fields: u64| {
        let what = format!("the {fields} fields of {}", path.display());
        let remedy =
            "write fewer rows (--series-every, arrivals = false), do fewer replicas, or raise the limit";
        check_available(&what, fields.saturating_mul(bytes_per_field), remedy)
    };
    let read = |source| Error::Read { path: path.to_owned(), source };
    // A table that fits with a field per byte needs no count.
    if check(file.metadata().map_err(read)?.len()).is_ok() {
        return Ok(());
    }
    check(count_fields(file).map_err(read)?)
}

fn count_fields(file: &mut File) -> io::Result<u64> {
    let (mut reader, mut fields) = (BufReader::with_capacity(1 << 16, &mut *file), 0);
    loop {
        let bytes = reader.fill_buf()?;
        let length = bytes.len();
        if length == 0 {
            break;
        }
        fields += bytes.iter().filter(|&&byte| matches!(byte, b',' | b'\n')).count() as u64;
        reader.consume(length);
    }
    file.rewind()?;
    Ok(fields)
}

fn damaged(path: &Path, line: usize, what: &str) -> Error {
    let message = format!("line {line}: {what}; it is not as the run wrote it, so run that again");
    Error::Read { path: path.to_owned(), source: io::Error::new(io::ErrorKind::InvalidData, message) }
}

#[cfg(test)]
mod tests {
    use lazygrid_io::available_memory;

    use super::*;

    #[test]
    fn table_whose_fields_exceed_the_memory_is_refused() {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), format!("a,b\n{:0>2000},1\n", 7)).unwrap();
        let Some(available) = available_memory() else { return };
        let open = |bytes_per_field: u64| TableReader::open(file.path(), "a,", bytes_per_field);
        let Err(error) = open(available.bytes) else { panic!("no error") };
        assert!(error.to_string().contains("the 4 fields of "), "{error}");
        for bytes_per_field in [0, 16, available.bytes / 64] {
            let row = open(bytes_per_field).unwrap().next_row().unwrap().unwrap();
            assert_eq!((row.number::<u32>(0).unwrap(), row.field(1)), (7, "1"));
        }
    }
}
