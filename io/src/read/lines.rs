use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use memchr::{memchr, memchr_iter, memrchr};

use super::line::{LONGEST_LINE, Line, too_long};
use super::source::Source;
use crate::error::{Error, Location, Position};

/// Each block is up to four times the previous one.
const FIRST_READ_BYTES: usize = 1 << 16;
/// Maximum bytes of a block, per thread and in all.
const READ_BYTES_PER_THREAD: usize = 1 << 20;
const MAX_READ_BYTES: usize = 32 << 20;
/// Bytes per task, up to the end of a line.
const TASK_BYTES: usize = 1 << 17;

pub(super) struct Lines {
    source: Source,
    buffer: Vec<u8>,
    /// Receives bytes while the other buffer is parsed.
    spare: Vec<u8>,
    unread: Range<usize>,
    line: Range<usize>,
    number: u64,
    ended: bool,
    /// Reported after the lines that were read.
    failed: Option<Error>,
}

#[derive(Clone, Copy)]
pub(super) struct LineBlock<'a> {
    bytes: &'a [u8],
    first: u64,
    path: &'a Arc<Path>,
}

impl Lines {
    pub(super) fn new(source: Source) -> Self {
        Self {
            source,
            buffer: vec![0; FIRST_READ_BYTES],
            spare: Vec::new(),
            unread: 0..0,
            line: 0..0,
            number: 0,
            ended: false,
            failed: None,
        }
    }

    /// Skips blank lines and a byte-order mark, and removes line ends.
    pub(super) fn next(&mut self) -> Result<Option<Line<'_>>, Error> {
        while self.advance()? {
            if !self.line().is_blank() {
                return Ok(Some(self.line()));
            }
        }
        Ok(None)
    }

    pub(super) fn at_end(&mut self) -> Result<bool, Error> {
        while self.advance()? {
            if !self.line().is_blank() {
                self.put_back();
                return Ok(false);
            }
        }
        Ok(true)
    }

    pub(super) fn required(
        &mut self,
        what: &'static str,
        found: u64,
        expected: u64,
    ) -> Result<Line<'_>, Error> {
        if self.advance()? {
            Ok(self.line())
        } else {
            Err(Error::Truncated { location: self.location(), what, found, expected })
        }
    }

    pub(super) fn put_back(&mut self) {
        self.unread.start = match memrchr(b'\n', &self.buffer[..self.line.start]) {
            Some(end) if self.number > 1 => end + 1,
            _ => self.line.start,
        };
        self.number -= 1;
    }

    pub(super) fn location(&self) -> Location {
        let at = if self.number == 0 { Position::File } else { Position::Line(self.number) };
        Location { path: self.source.path.clone(), at }
    }

    /// Parses at most `most` lines while `meanwhile` runs and reading continues. Returns the number of lines,
    /// 0 at the end.
    pub(super) fn parse<T: Send>(
        &mut self,
        most: u64,
        parse: impl FnOnce(&[LineBlock<'_>]) -> T + Send,
        meanwhile: impl FnOnce() + Send,
    ) -> Result<(T, u64), Error> {
        loop {
            let Self { source, buffer, spare, unread, number, ended, failed, .. } = &mut *self;
            let path = source.path.clone();
            let text =
                Text { bytes: &buffer[unread.clone()], first: *number + 1, path: &path, ended: *ended };
            let (blocks, lines, end) = text.cut(most);
            if lines == 0 && most > 0 && !*ended {
                self.fill()?;
                continue;
            }
            let parsed = if lines == most || *ended || failed.is_some() {
                unread.start += end;
                if blocks.len() > 1 {
                    start_threads(&path)?;
                    rayon::join(|| parse(&blocks), meanwhile).0
                } else {
                    meanwhile();
                    parse(&blocks)
                }
            } else {
                let (rest, left) = (&text.bytes[end..], most - lines);
                try_resize(spare, larger(text.bytes.len(), &path)?, &path)?;
                let read_on = || {
                    meanwhile();
                    read_on(source, spare, rest, left)
                };
                let (parsed, read) = rayon::join(|| parse(&blocks), read_on);
                std::mem::swap(buffer, spare);
                *unread = 0..read.filled;
                (*ended, *failed) = (read.ended, read.failed);
                parsed
            };
            *number += lines;
            return Ok((parsed, lines));
        }
    }

    fn line(&self) -> Line<'_> {
        Line { bytes: &self.buffer[self.line.clone()], number: self.number, path: &self.source.path }
    }

    fn advance(&mut self) -> Result<bool, Error> {
        let mut searched = 0;
        let (length, end) = loop {
            let unread = &self.buffer[self.unread.clone()];
            match memchr(b'\n', &unread[searched..]) {
                Some(at) => break (searched + at, 1),
                None if self.ended && unread.is_empty() => return Ok(false),
                None if self.ended => break (unread.len(), 0),
                None => searched = unread.len(),
            }
            self.fill()?;
        };
        let start = self.unread.start;
        let line = Line::new(&self.buffer[start..start + length], self.number + 1, &self.source.path)?;
        let before = length - line.bytes.len() - usize::from(self.buffer[..start + length].ends_with(b"\r"));
        let length_of_line = line.bytes.len();
        self.line = start + before..start + before + length_of_line;
        self.unread.start += length + end;
        self.number += 1;
        Ok(true)
    }

    fn fill(&mut self) -> Result<(), Error> {
        self.buffer.copy_within(self.unread.clone(), 0);
        self.unread = 0..self.unread.len();
        if self.unread.end > LONGEST_LINE && memchr(b'\n', &self.buffer[..self.unread.end]).is_none() {
            return Err(too_long(self.source.at(Position::Line(self.number + 1))));
        }
        if let Some(error) = self.failed.take() {
            return Err(error);
        }
        if self.unread.end == self.buffer.len() {
            let length = larger(self.buffer.len(), &self.source.path)?;
            try_resize(&mut self.buffer, length, &self.source.path)?;
        }
        let read = self.source.read(&mut self.buffer[self.unread.end..])?;
        self.unread.end += read;
        self.ended = read == 0;
        Ok(())
    }
}

struct Text<'a> {
    bytes: &'a [u8],
    first: u64,
    path: &'a Arc<Path>,
    ended: bool,
}

impl<'a> Text<'a> {
    fn cut(&self, most: u64) -> (Vec<LineBlock<'a>>, u64, usize) {
        let (mut blocks, mut lines, mut at) = (Vec::new(), 0, 0);
        while lines < most && at < self.bytes.len() {
            let rest = &self.bytes[at..];
            let near = memrchr(b'\n', &rest[..rest.len().min(TASK_BYTES)]);
            let end = near.or_else(|| memchr(b'\n', rest)).map(|end| end + 1);
            let Some(mut end) = end.or(self.ended.then_some(rest.len())) else { break };
            let mut within = memchr_iter(b'\n', &rest[..end]).count() as u64;
            // The last line may have no end.
            within += u64::from(!rest[..end].ends_with(b"\n"));
            if within > most - lines {
                within = most - lines;
                end = memchr_iter(b'\n', rest).nth(within as usize - 1).map_or(end, |end| end + 1);
            }
            blocks.push(LineBlock { bytes: &rest[..end], first: self.first + lines, path: self.path });
            (lines, at) = (lines + within, at + end);
        }
        (blocks, lines, at)
    }
}

struct Read {
    filled: usize,
    ended: bool,
    failed: Option<Error>,
}

fn read_on(source: &mut Source, spare: &mut [u8], rest: &[u8], lines: u64) -> Read {
    spare[..rest.len()].copy_from_slice(rest);
    let mut so_far = Read { filled: rest.len(), ended: false, failed: None };
    let mut left = lines;
    while so_far.filled < spare.len() && left > 0 {
        let read = match source.read(&mut spare[so_far.filled..]) {
            Ok(0) => return Read { ended: true, ..so_far },
            Ok(read) => so_far.filled..so_far.filled + read,
            Err(error) => return Read { failed: Some(error), ..so_far },
        };
        so_far.filled = read.end;
        left = left.saturating_sub(memchr_iter(b'\n', &spare[read]).count() as u64);
    }
    so_far
}

fn try_resize(buffer: &mut Vec<u8>, length: usize, path: &Path) -> Result<(), Error> {
    let refused = |_| Error::Read { path: path.to_owned(), source: std::io::ErrorKind::OutOfMemory.into() };
    buffer.try_reserve_exact(length.saturating_sub(buffer.len())).map_err(refused)?;
    buffer.resize(length, 0);
    Ok(())
}

fn start_threads(path: &Path) -> Result<(), Error> {
    let refused = |reason| Error::Threads { path: path.to_owned(), reason: Box::new(reason) };
    lazygrid::start_threads().map_err(refused)
}

/// Returns the length of the next block, and starts the threads that parse it.
fn larger(bytes: usize, path: &Path) -> Result<usize, Error> {
    start_threads(path)?;
    let most = (READ_BYTES_PER_THREAD * rayon::current_num_threads()).clamp(2 * LONGEST_LINE, MAX_READ_BYTES);
    Ok((4 * bytes).clamp(FIRST_READ_BYTES, most))
}

impl<'a> LineBlock<'a> {
    pub(super) fn lines(self) -> impl Iterator<Item = Result<Line<'a>, Error>> {
        let Self { mut bytes, first, path } = self;
        (first..).map_while(move |number| {
            if bytes.is_empty() {
                return None;
            }
            let end = memchr(b'\n', bytes);
            let line = &bytes[..end.unwrap_or(bytes.len())];
            bytes = end.map_or(&[], |end| &bytes[end + 1..]);
            Some(Line::new(line, number, path))
        })
    }

    pub(super) fn rows(self) -> usize {
        const SHORT_ROW: usize = 24;
        self.bytes.len() / SHORT_ROW
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
        let fits = [vec![b'a'; LONGEST_LINE], vec![b'\n'; 1], vec![b'b'; LONGEST_LINE]].concat();
        let mut lines = Lines::new(Source::from_bytes("test", fits));
        assert_eq!(lines.next().unwrap().unwrap().bytes.len(), LONGEST_LINE);
        assert_eq!(lines.next().unwrap().unwrap().bytes.len(), LONGEST_LINE);
        assert!(lines.next().unwrap().is_none());

        let long = [b"short\n".to_vec(), vec![b'a'; LONGEST_LINE + 1]].concat();
        let mut lines = Lines::new(Source::from_bytes("test", long));
        lines.next().unwrap();
        assert_eq!(
            lines.next().err().unwrap().to_string(),
            "test, line 2: the line is longer than 1048576 bytes; is this a text file?"
        );
    }
}
