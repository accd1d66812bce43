//! Rows of a NumPy array: each rank reads its own, under a header of its own.

use std::fs::File;
use std::io::{self, Cursor, Read, Seek, SeekFrom};
use std::path::Path;

use lazygrid_io::Position;
use lazygrid_io::read::{Format, Frame, Frames, Options};

const LONGEST: usize = 1 << 16;

#[derive(Debug)]
pub(crate) struct Rows {
    header: Vec<u8>,
    /// Position of the number of rows in the header.
    digits: std::ops::Range<usize>,
    rows: u64,
    width: u64,
}

impl Rows {
    /// Returns the rows of a file; `None` to read all of it, also to report a fault.
    pub(crate) fn of(path: &Path) -> io::Result<Option<Self>> {
        let length = path.metadata()?.len();
        let mut head = Vec::new();
        File::open(path)?.take(LONGEST as u64).read_to_end(&mut head)?;
        Ok(Self::parse(head, length))
    }

    fn parse(mut header: Vec<u8>, length: u64) -> Option<Self> {
        let bytes = |range: std::ops::Range<usize>| header.get(range);
        let (begin, size) = match bytes(6..7)?[0] {
            1 => (10, u16::from_le_bytes(bytes(8..10)?.try_into().ok()?) as usize),
            2 | 3 => (12, u32::from_le_bytes(bytes(8..12)?.try_into().ok()?) as usize),
            _ => return None,
        };
        let text = std::str::from_utf8(bytes(begin..begin.checked_add(size)?)?).ok()?;
        if text.contains("'fortran_order': True") {
            return None;
        }
        let shape = text.find("'shape':")?;
        let first = shape + text[shape..].find(|c: char| c.is_ascii_digit())?;
        let after = first + text[first..].find(|c: char| !c.is_ascii_digit())?;
        let rows: u64 = text[first..after].parse().ok()?;
        let end = begin + size;
        let body = length.checked_sub(end as u64)?;
        let whole = rows > 0 && body > 0 && body % rows == 0;
        header.truncate(end);
        let digits = begin + first..begin + after;
        whole.then(|| Self { header, digits, rows, width: body / rows })
    }

    /// Fewer rows, of the same length.
    fn header_for(&self, rows: u64) -> Vec<u8> {
        let digits = rows.to_string();
        let missing = self.digits.len().saturating_sub(digits.len());
        let mut header = self.header.clone();
        header.splice(self.digits.clone(), digits.into_bytes());
        // The format wants a final line break.
        let line_break = header.len().saturating_sub(1);
        header.splice(line_break..line_break, std::iter::repeat_n(b' ', missing));
        header
    }

    pub(crate) fn read(&self, path: &Path, options: Options, rank: u64, ranks: u64) -> Result<Frame, String> {
        let first = share(self.rows, rank, ranks);
        let rows = share(self.rows, rank + 1, ranks) - first;
        let begin = self.header.len() as u64 + first * self.width;
        let open = || {
            let mut file = File::open(path)?;
            file.seek(SeekFrom::Start(begin)).map(|_| file)
        };
        let file = open().map_err(|error| format!("{}: cannot read: {error}", path.display()))?;
        let header = self.header_for(rows);
        let length = header.len() as u64 + rows * self.width;
        let input = Cursor::new(header).chain(file.take(rows * self.width));
        let mut options = options;
        options.format = Some(Format::Npy);
        let mut frames =
            Frames::new(path, input, Some(length), options).map_err(|error| error.to_string())?;
        let frame = frames.next().transpose().map_err(|mut error| {
            if let Some(place) = error.location_mut()
                && let Position::Row(row) = &mut place.at
            {
                *row += first;
            }
            error.to_string()
        })?;
        Ok(frame.unwrap_or_default())
    }
}

pub(crate) fn share(all: u64, rank: u64, ranks: u64) -> u64 {
    (u128::from(all) * u128::from(rank) / u128::from(ranks.max(1))) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(shape: &str, order: &str) -> Vec<u8> {
        let text = format!("{{'descr': '<f4', 'fortran_order': {order}, 'shape': {shape}, }}");
        let text = format!("{text:<117}\n");
        [b"\x93NUMPY\x01\x00", &(text.len() as u16).to_le_bytes()[..], text.as_bytes()].concat()
    }

    #[test]
    fn headers_speak_of_fewer_rows() {
        let header = file("(1200, 4)", "False");
        let rows = Rows::parse(header.clone(), header.len() as u64 + 1200 * 16).unwrap();
        assert_eq!((rows.rows, rows.width), (1200, 16));
        let fewer = rows.header_for(7);
        assert_eq!(fewer.len(), header.len());
        assert!(fewer.ends_with(b" \n") && String::from_utf8_lossy(&fewer).contains("'shape': (7, 4), }"));
        assert_eq!(rows.header_for(1200), header);
    }

    #[test]
    fn only_complete_c_order_rows_are_read_in_parts() {
        let parse = |shape, order, body| {
            let header = file(shape, order);
            let length = header.len() as u64 + body;
            Rows::parse(header, length)
        };
        assert!(parse("(10, 4)", "False", 160).is_some());
        assert!(parse("(10, 4)", "True", 160).is_none());
        assert!(parse("(10, 4)", "False", 161).is_none());
        assert!(parse("(0, 4)", "False", 0).is_none());
        assert!(Rows::parse(b"\x93NUMPY".to_vec(), 6).is_none());
        assert!(Rows::parse(b"\x93NUMPY\x02\x00\xFF\xFF\xFF\xFF".to_vec(), 1 << 40).is_none());
    }

    #[test]
    fn shares_cover_everything() {
        for (all, ranks) in [(0, 3), (7, 8), (1 << 60, 512), (1000, 7)] {
            assert_eq!((share(all, 0, ranks), share(all, ranks, ranks)), (0, all));
            assert!((0..ranks).all(|rank| share(all, rank, ranks) <= share(all, rank + 1, ranks)));
        }
    }
}
