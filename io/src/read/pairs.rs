use std::fs::File;
use std::path::Path;

use super::csv;
use super::line::Line;
use super::lines::Lines;
use super::source::Source;
use crate::error::Error;
use crate::memory::{refused, try_push};

/// Reads two integers per line, such as bonds, separated by commas, semicolons or white space. Skips blank
/// lines, `#` lines, and a header.
///
/// # Errors
/// [`Error::Read`], and [`Error::Syntax`] for the first other line.
pub fn pairs(path: impl AsRef<Path>) -> Result<Vec<(i64, i64)>, Error> {
    let path = path.as_ref();
    let file = File::open(path).map_err(|source| Error::Read { path: path.to_owned(), source })?;
    let mut lines = Lines::new(Source::new(path, file, None)?);
    let (mut pairs, mut may_be_header) = (Vec::new(), true);
    while let Some(line) = lines.next()? {
        if line.is_blank() || csv::is_comment(line.bytes) {
            continue;
        }
        match pair(line) {
            Some(pair) => try_push(&mut pairs, pair).map_err(|_| no_memory(path, pairs.len()))?,
            None if may_be_header && !line.bytes.iter().any(u8::is_ascii_digit) => {}
            None => return Err(line.unexpected("two whole numbers")),
        }
        may_be_header = false;
    }
    Ok(pairs)
}

fn no_memory(path: &Path, pairs: usize) -> Error {
    refused(path, &format!("more than {pairs} pairs; list fewer"))
}

fn pair(line: Line<'_>) -> Option<(i64, i64)> {
    let between = |b: &u8| b.is_ascii_whitespace() || b",;".contains(b);
    let mut fields = line.bytes.split(between).filter(|field| !field.is_empty());
    let mut next = || fields.next().and_then(|field| lexical_core::parse(field).ok());
    let pair = (next()?, next()?);
    fields.next().is_none().then_some(pair)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Vec<(i64, i64)>, String> {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("bonds.csv");
        std::fs::write(&path, text).unwrap();
        pairs(&path).map_err(|error| error.to_string())
    }

    #[test]
    fn two_numbers_on_a_line() {
        assert_eq!(read("i,j\n0,1\n 7;3 \n# bonds\n\n12\t-4\n"), Ok(vec![(0, 1), (7, 3), (12, -4)]));
        assert_eq!(read(""), Ok(vec![]));
        for text in ["0,1\ni,j\n", "0,1\n2\n", "0 1\n1 2 3\n", "i,j\nid_i,id_j\n", "0.5,1\n"] {
            let error = read(text).unwrap_err();
            assert!(error.contains("expected two whole numbers, found"), "{text:?}: {error}");
        }
    }
}
