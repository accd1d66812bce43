//! Writers of files that appear only when complete.

mod atomic_file;
mod base64;
mod encoder;
pub mod frames;
mod pairs;
mod spheres;
mod temporary;
mod text;

use std::ffi::OsStr;
use std::path::Path;

pub use atomic_file::{AtomicFile, CompleteFile};
pub use base64::base64;
pub use pairs::{Output, PairFile, neighbors};
pub use spheres::{SphereFormat, spheres};
pub use temporary::remove_temporaries;

/// A format of integer tables.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TableFormat {
    /// Text with a header.
    Csv,
    /// NumPy arrays.
    Npy,
}

impl TableFormat {
    /// Returns the format of an extension, before `.gz` or `.zst`.
    pub fn from_extension(path: &Path) -> Option<Self> {
        match encoder::uncompressed(path).extension().and_then(OsStr::to_str)? {
            "csv" => Some(Self::Csv),
            "npy" => Some(Self::Npy),
            _ => None,
        }
    }
}

/// Returns a NumPy header in native byte order. `kind` is a type such as `u4`, `shape` a Python tuple.
pub fn npy_header(kind: &str, shape: &str) -> Vec<u8> {
    header_of(&number(kind), shape)
}

fn header_of(descr: &str, shape: &str) -> Vec<u8> {
    const START: &[u8] = b"\x93NUMPY\x01\x00";
    let before = START.len() + size_of::<u16>();
    let text = format!("{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}");
    let length = (before + text.len() + 1).next_multiple_of(64) - before;
    let text = format!("{text:<0$}\n", length - 1);
    [START, &(length as u16).to_le_bytes(), text.as_bytes()].concat()
}

fn number(kind: &str) -> String {
    let order = if cfg!(target_endian = "big") { '>' } else { '<' };
    format!("'{order}{kind}'")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_are_as_the_format_asks() {
        for (shape, length) in [("(0, 2)", 128), ("(18446744073709551615, 2)", 128), ("(7,)", 128)] {
            let header = npy_header("u8", shape);
            assert_eq!((header.len(), &header[..10]), (length, &b"\x93NUMPY\x01\x00\x76\x00"[..]));
            let text = std::str::from_utf8(&header[10..]).unwrap();
            assert!(text.contains(&format!("'shape': {shape}, }} ")) && text.ends_with(" \n"), "{text}");
        }
        assert_eq!(frames::npy_frame_header(usize::MAX).len(), frames::npy_frame_header(0).len());
    }
}
