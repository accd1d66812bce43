//! Whole lines of a CSV file for each rank, after the header.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Cursor, Read, Seek, SeekFrom};
use std::path::Path;

use lazygrid_io::read::{BYTE_ORDER_MARK, Format, Frame, Frames, Options, Species};
use lazygrid_io::{Error, Location, Position, excerpt};

use super::rank_range::rank_range;

const MAX_HEAD_BYTES: u64 = 1 << 16;

#[derive(Debug)]
pub(crate) struct TextRows {
    head: Vec<u8>,
    end: u64,
}

#[derive(Debug)]
pub(crate) struct RankLines {
    head: Vec<u8>,
    bytes: Vec<u8>,
    /// `true` on rank 0, which reports an empty file.
    is_first: bool,
}

impl TextRows {
    /// Returns `None` if ranks must read the whole file.
    pub(crate) fn open(path: &Path) -> io::Result<Option<Self>> {
        let end = path.metadata()?.len();
        let mut start = Vec::new();
        File::open(path)?.take(MAX_HEAD_BYTES).read_to_end(&mut start)?;
        Ok(head(&start).map(|length| {
            start.truncate(length);
            Self { head: start, end }
        }))
    }

    /// Returns the lines that begin in a rank's range of the bytes.
    pub(crate) fn lines_of(&self, path: &Path, rank: u64, ranks: u64) -> Result<RankLines, String> {
        let from = self.head.len() as u64;
        let range = rank_range(self.end.saturating_sub(from), rank, ranks);
        let read = || {
            let mut file = File::open(path)?;
            let begin = line_from(&mut file, from, self.end, from + range.start)?;
            let end = line_from(&mut file, from, self.end, from + range.end)?;
            file.seek(SeekFrom::Start(begin))?;
            let mut bytes = Vec::new();
            bytes.try_reserve_exact((end - begin) as usize).map_err(|_| io::ErrorKind::OutOfMemory)?;
            file.take(end - begin).read_to_end(&mut bytes)?;
            Ok(bytes)
        };
        let bytes = read().map_err(|error: io::Error| format!("{}: cannot read: {error}", path.display()))?;
        Ok(RankLines { head: self.head.clone(), bytes, is_first: rank == 0 })
    }
}

impl RankLines {
    pub(crate) fn lines(&self) -> u64 {
        newlines(&self.bytes)
    }

    /// `before` counts lines of earlier ranks, for messages.
    pub(crate) fn read(
        self,
        path: &Path,
        options: Options,
        before: u64,
    ) -> Result<(Frame, Option<Species>), String> {
        if self.bytes.is_empty() && !self.is_first {
            return Ok((Frame::default(), None));
        }
        let options = Options { format: Some(Format::Csv), ..options };
        // Before the first row, a comment could replace the header.
        let skipped = if self.is_first { 0 } else { comments(&self.bytes) };
        let mut bytes = self.bytes;
        let before = before + newlines(&bytes[..skipped]);
        bytes.drain(..skipped);
        let head = newlines(&self.head);
        // After a header in a comment, the reader would take a first row of names for the header.
        let row = bytes.split(|&byte| byte == b'\n').next().unwrap_or_default();
        let marked = self.head.strip_prefix(BYTE_ORDER_MARK).unwrap_or(&self.head);
        if !self.is_first && comments(marked) == marked.len() && is_header(row) {
            let location = Location { path: path.into(), at: Position::Line(head + before + 1) };
            let found = format!("'{}'", excerpt(row.trim_ascii()));
            return Err(Error::Syntax { location, expected: "numbers".to_owned(), found }.to_string());
        }
        let length = (self.head.len() + bytes.len()) as u64;
        let input = Cursor::new(self.head).chain(Cursor::new(bytes));
        let mut frames =
            Frames::new(path, input, Some(length), options).map_err(|error| error.to_string())?;
        let frame = frames.next().transpose().map_err(|mut error| {
            if let Some(location) = error.location_mut()
                && let Position::Line(line) = &mut location.at
                && *line > head
            {
                *line += before;
            }
            error.to_string()
        })?;
        Ok((frame.unwrap_or_default(), Some(frames.species().clone())))
    }
}

fn newlines(bytes: &[u8]) -> u64 {
    bytes.iter().filter(|&&byte| byte == b'\n').count() as u64
}

/// Returns the length of the comments and blank lines before the first row.
fn comments(lines: &[u8]) -> usize {
    let is_comment = |line: &&[u8]| matches!(line.trim_ascii().first(), None | Some(b'#'));
    lines.split_inclusive(|&byte| byte == b'\n').take_while(is_comment).map(<[u8]>::len).sum()
}

fn is_header(line: &[u8]) -> bool {
    Format::from_content(line) == Some(Format::Csv)
}

fn head(start: &[u8]) -> Option<usize> {
    let mut length = if start.starts_with(BYTE_ORDER_MARK) { BYTE_ORDER_MARK.len() } else { 0 };
    for line in start[length..].split_inclusive(|&byte| byte == b'\n') {
        let text = line.trim_ascii();
        if !line.ends_with(b"\n") {
            return None;
        }
        match text.first() {
            None | Some(b'#') => length += line.len(),
            _ if is_header(text) => return Some(length + line.len()),
            _ => return Some(length),
        }
    }
    None
}

fn line_from(file: &mut File, first: u64, end: u64, at: u64) -> io::Result<u64> {
    if at <= first {
        return Ok(first);
    }
    if at >= end {
        return Ok(end);
    }
    // The byte before a line is a newline.
    file.seek(SeekFrom::Start(at - 1))?;
    let skipped = BufReader::new(file.take(end - (at - 1))).skip_until(b'\n')?;
    Ok(at - 1 + skipped as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heads_end_with_the_header() {
        let head = |text: &str| head(text.as_bytes());
        assert_eq!(head("x,y,z,r\n1,2,3,4\n"), Some(8));
        assert_eq!(head("# a\n\nx;y;z;radius\n1;2;3;4\n"), Some(18));
        assert_eq!(head("# x y\n# x,y,z,r\n1,2,3,4\n"), Some(16));
        assert_eq!(head("\u{feff}x,y,z,r\n1,2,3,4\n"), Some(11));
        assert_eq!((head("# x,y,z,r\n"), head(""), head("x,y,z,r")), (None, None, None));
    }

    #[test]
    fn later_comment_does_not_replace_the_header() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.csv");
        std::fs::write(&path, "# x,y,z,r\n1.00000,2.00000,3,4\n# r,x,y,z\n5,6,7,8\n,\n").unwrap();
        let rows = TextRows::open(&path).unwrap().unwrap();
        let lines = rows.lines_of(&path, 1, 2).unwrap();
        assert!(lines.bytes.starts_with(b"# r,x,y,z\n5,"), "{lines:?}");
        let error = lines.read(&path, Options::default(), 1).unwrap_err();
        assert!(error.contains("a.csv, line 5: "), "{error}");
        std::fs::write(&path, "# x,y,z,r\n1.00000,2.00000,3,4\n# r,x,y,z\n5,6,7,8.0\n").unwrap();
        let rows = TextRows::open(&path).unwrap().unwrap();
        let (frame, _) = rows.lines_of(&path, 1, 2).unwrap().read(&path, Options::default(), 1).unwrap();
        assert_eq!(frame.as_spheres().get_f64(0), [5.0, 6.0, 7.0, 8.0]);
    }

    #[test]
    fn later_header_is_refused_on_every_rank() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.csv");
        for begin in ["# x,y,z,r\n", "\u{feff}# r,x,y,z\n\n", "x,y,z,r\n"] {
            std::fs::write(&path, format!("{begin}1,2,3,4\n# r,x,y,z\nx,y,z,r\n5,6,7,8\n")).unwrap();
            let line = format!("a.csv, line {}: ", 3 + newlines(begin.as_bytes()));
            for ranks in 1..9 {
                let rows = TextRows::open(&path).unwrap().unwrap();
                let mut before = 0;
                let read = (0..ranks).map(|rank| {
                    let lines = rows.lines_of(&path, rank, ranks).unwrap();
                    let count = lines.lines();
                    before += count;
                    lines.read(&path, Options::default(), before - count)
                });
                let refused: Vec<String> = read.filter_map(Result::err).collect();
                assert!(refused.len() == 1 && refused[0].contains(&line), "{ranks}: {refused:?}");
            }
        }
    }

    #[test]
    fn rank_lines_are_whole_lines_and_cover_the_file() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.csv");
        for rows in ["", "1,2,3,4\n", "1,2,3,4\n5,6,7,8", "1,2,3,4\n\n55555,6,7,8\n9,9,9,9\n"] {
            std::fs::write(&path, format!("x,y,z,r\n{rows}")).unwrap();
            for ranks in 1..40 {
                let rows_of_file = TextRows::open(&path).unwrap();
                let Some(rows_of_file) = rows_of_file else {
                    assert!(rows.is_empty());
                    continue;
                };
                let of_ranks: Vec<_> =
                    (0..ranks).map(|rank| rows_of_file.lines_of(&path, rank, ranks).unwrap()).collect();
                let together: Vec<u8> = of_ranks.iter().flat_map(|lines| lines.bytes.clone()).collect();
                assert_eq!(String::from_utf8(together).unwrap(), rows);
                let cut =
                    of_ranks.iter().filter(|lines| !lines.bytes.is_empty() && !lines.bytes.ends_with(b"\n"));
                assert!(cut.count() <= usize::from(!rows.ends_with('\n')));
            }
        }
    }
}
