use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::{Path, PathBuf};

use super::header::{Header, Layout, PlainLayout};
use super::{further_bytes, read_body};
use crate::error::{Error, Position};
use crate::read::read_context::ReadContext;
use crate::read::source::Source;
use crate::read::{Frame, Options, Species};

/// A NumPy file of spheres with contiguous rows.
pub struct NpyRows {
    path: PathBuf,
    header: Header,
}

impl NpyRows {
    /// Opens a file. Returns `None` in Fortran order, if compressed, or if not a regular file.
    ///
    /// # Errors
    /// [`Error::Read`]; [`Error::Syntax`] for another content or further bytes; [`Error::Truncated`] if the file is shorter
    /// than its header says.
    pub fn open(path: impl AsRef<Path>) -> Result<Option<Self>, Error> {
        let path = path.as_ref();
        let (file, length) = super::super::open(path)?;
        let mut source = Source::new(path, file, length)?;
        let header = Header::parse(&mut source)?;
        let is_fortran = matches!(header.layout, Layout::Plain(PlainLayout { fortran: true, .. }));
        let Some(length) = source.length.filter(|_| !is_fortran) else { return Ok(None) };
        header.check_length(&source)?;
        if length > header.end + header.rows * header.row_bytes() {
            return Err(further_bytes(&source));
        }
        Ok(Some(Self { path: path.to_owned(), header }))
    }

    /// Returns the number of rows.
    pub fn count(&self) -> u64 {
        self.header.rows
    }

    /// Reads the existing rows of `rows`.
    ///
    /// # Errors
    /// Returns the errors of the iterator [`Frames`](super::super::Frames).
    pub fn read(self, rows: Range<u64>, options: Options) -> Result<(Frame, Species), Error> {
        let Self { path, mut header } = self;
        let width = header.row_bytes();
        let first = rows.start.min(header.rows);
        let begin = header.end + first * width;
        header.rows = rows.end.clamp(first, header.rows) - first;
        header.end = 0;
        let open = || {
            let mut file = File::open(&path)?;
            file.seek(SeekFrom::Start(begin)).map(|_| file)
        };
        let file = open().map_err(|source| Error::Read { path: path.clone(), source })?;
        let length = header.rows * width;
        let mut source = Source::uncompressed(&path, file.take(length), Some(length));
        let mut context = ReadContext::new(options)?;
        let frame = read_body(&mut source, &header, &mut context).map_err(|mut error| {
            if let Some(location) = error.location_mut()
                && let Position::Row(row) = &mut location.at
            {
                *row += first;
            }
            error
        })?;
        Ok((Frame { space: context.space.unwrap_or_default(), ..frame }, context.species))
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::file;
    use super::*;
    use crate::read::Frames;

    fn data(rows: u32) -> Vec<u8> {
        (0..4 * rows).flat_map(|k| (k as f32).to_le_bytes()).collect()
    }

    #[test]
    fn ranges_of_rows_are_the_rows_of_the_file() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.npy");
        let plain = "{'descr': '<f4', 'fortran_order': False, 'shape': (10, 4), }";
        let spelled = "{\"shape\":( 10 , 4 ),'fortran_order' :False,\"descr\":'<f4'}\n\n";
        let structured = "{'descr': [('x', '<f4'), ('y', '<f4'), ('z', '<f4'), ('r', '<f4')], \
                           'fortran_order': False, 'shape': (10,), }";
        for text in [plain, spelled, structured] {
            std::fs::write(&path, file(1, text, &data(10))).unwrap();
            let whole = Frames::open(&path, Options::default()).unwrap().next().unwrap().unwrap();
            for rows in [0..10, 0..3, 3..4, 7..10, 5..5, 8..99, 99..100] {
                let file_rows = NpyRows::open(&path).unwrap().unwrap();
                assert_eq!(file_rows.count(), 10);
                let [first, end] = [rows.start, rows.end].map(|row| row.min(10) as usize);
                let (frame, _) = file_rows.read(rows, Options::default()).unwrap();
                assert_eq!(frame.spheres, whole.spheres[first..end]);
            }
        }
    }

    #[test]
    fn row_that_begins_like_a_compressed_file_is_read() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.npy");
        let mut rows = data(2);
        rows[16..20].copy_from_slice(b"\x1F\x8B\x08\x00");
        let text = "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 4), }";
        std::fs::write(&path, file(1, text, &rows)).unwrap();
        let (frame, _) = NpyRows::open(&path).unwrap().unwrap().read(1..2, Options::default()).unwrap();
        assert_eq!(frame.spheres[0].radius, 7.0);
    }

    #[test]
    fn errors_name_rows_of_the_file() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.npy");
        let mut rows = data(10);
        rows[8 * 16 + 12..][..4].copy_from_slice(&(-1.0_f32).to_le_bytes());
        let text = "{'descr': '<f4', 'fortran_order': False, 'shape': (10, 4), }";
        std::fs::write(&path, file(1, text, &rows)).unwrap();
        let error = NpyRows::open(&path).unwrap().unwrap().read(5..10, Options::default()).unwrap_err();
        assert!(error.to_string().contains("a.npy, row 8: "), "{error}");
    }

    #[test]
    fn only_contiguous_rows_are_read_by_range() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.npy");
        let open = |text: &str, data: &[u8]| {
            std::fs::write(&path, file(1, text, data)).unwrap();
            NpyRows::open(&path).map(|rows| rows.map(|rows| rows.count())).map_err(|error| error.to_string())
        };
        let text = |order: &str, shape: &str| {
            format!("{{'descr': '<f4', 'fortran_order': {order}, 'shape': {shape}, }}")
        };
        assert_eq!(open(&text("False", "(10, 4)"), &data(10)), Ok(Some(10)));
        assert_eq!(open(&text("False", "(0, 4)"), &[]), Ok(Some(0)));
        assert_eq!(open(&text("True", "(10, 4)"), &data(10)), Ok(None));
        assert_eq!(open("{'descr':'<f4','fortran_order':True,'shape':(10,4),}", &data(10)), Ok(None));
        let refused = |text: &str, data: &[u8]| open(text, data).unwrap_err();
        assert!(refused(&text("False", "(11, 4)"), &data(10)).contains("after 10 of 11 rows"));
        assert!(refused(&text("False", "(9, 4)"), &data(10)).contains("further bytes"));
        assert!(refused(&text("False", &format!("({}, 4)", u64::MAX)), &data(10)).contains("after 10 of"));
    }
}
