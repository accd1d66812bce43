//! Writers of results and scenes. A file appears under its name only when it is complete.

mod draft;
mod encoder;
mod pairs;
mod spheres;
mod temporary;
mod text;

use std::ffi::OsStr;
use std::path::Path;

pub use draft::Draft;
pub use pairs::{Output, PairFile, neighbors};
pub use spheres::{SphereFormat, spheres};
pub use temporary::discard_drafts;

/// How a table of whole numbers is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TableFormat {
    /// Text with a header line.
    Csv,
    /// NumPy arrays.
    Npy,
}

impl TableFormat {
    /// The format that a file name's extension stands for; the one before `.gz` or `.zst`, where that is the last.
    pub fn from_extension(path: &Path) -> Option<Self> {
        match encoder::uncompressed(path).extension().and_then(OsStr::to_str)? {
            "csv" => Some(Self::Csv),
            "npy" => Some(Self::Npy),
            _ => None,
        }
    }
}

/// A header of the NumPy format, always of the same length.
fn npy_header(kind: &str, shape: &str) -> [u8; NPY_HEADER] {
    const START: &[u8] = b"\x93NUMPY\x01\x00\x76\x00";
    const _: () = assert!(START.len() + 0x76 == NPY_HEADER);
    let order = if cfg!(target_endian = "big") { '>' } else { '<' };
    let text = format!("{{'descr': '{order}{kind}', 'fortran_order': False, 'shape': {shape}, }}");
    let mut header = [b' '; NPY_HEADER];
    header[..START.len()].copy_from_slice(START);
    header[START.len()..][..text.len()].copy_from_slice(text.as_bytes());
    header[NPY_HEADER - 1] = b'\n';
    header
}

/// Long enough for any shape of two 64-bit numbers; a multiple of 64, as the format asks.
const NPY_HEADER: usize = 128;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_have_one_length_whatever_the_shape() {
        for shape in ["(0, 2)".to_owned(), format!("({}, 2)", u64::MAX), format!("({},)", u64::MAX)] {
            let header = npy_header("u8", &shape);
            let text = std::str::from_utf8(&header[10..]).unwrap();
            assert!(text.contains(&format!("'shape': {shape}, }} ")), "{text}");
            assert!(text.ends_with(" \n"));
        }
    }
}
