use std::io::{self, BufReader, Cursor, Read};
use std::path::Path;
use std::sync::Arc;

use super::Format;
use super::gzip::GzipReader;
use super::zstd::ZstdReader;
use crate::error::{Error, Location, Position};

pub(super) struct Source {
    pub(super) path: Arc<Path>,
    input: Box<dyn Read + Send>,
    pub(super) length: Option<u64>,
}

impl Source {
    pub(super) fn new(
        path: &Path,
        input: impl Read + Send + 'static,
        length: Option<u64>,
    ) -> Result<Self, Error> {
        const GZIP: &[u8] = b"\x1F\x8B";
        const ZSTANDARD: &[u8] = b"\x28\xB5\x2F\xFD";
        const BUFFER: usize = 1 << 18;
        // Zstandard files may begin with a frame to skip.
        let is_skippable = |head: &[u8]| matches!(head, [0x50..=0x5F, 0x2A, 0x4D, 0x18, ..]);
        let mut source = Self::uncompressed(path, input, length);
        let head = source.look(6)?;
        if let Some(program) = other_compression(&head) {
            return Err(Error::Compression { path: path.to_owned(), program });
        }
        let compressed = |source: &mut Self| {
            source.length = None;
            BufReader::with_capacity(BUFFER, std::mem::replace(&mut source.input, Box::new(io::empty())))
        };
        if head.starts_with(GZIP) {
            source.input = Box::new(GzipReader::new(compressed(&mut source)));
        } else if head.starts_with(ZSTANDARD) || is_skippable(&head) {
            source.input = Box::new(ZstdReader::new(compressed(&mut source)));
        }
        Ok(source)
    }

    pub(super) fn uncompressed(path: &Path, input: impl Read + Send + 'static, length: Option<u64>) -> Self {
        Self { path: path.into(), input: Box::new(input), length }
    }

    pub(super) fn guess(&mut self) -> Result<Format, Error> {
        const HEAD: usize = 4096;
        let head = self.look(HEAD)?;
        Format::from_content(&head).ok_or_else(|| Error::UnknownFormat { path: self.path.to_path_buf() })
    }

    fn look(&mut self, bytes: usize) -> Result<Vec<u8>, Error> {
        let mut head = vec![0; bytes];
        let length = self.fill(&mut head)?;
        head.truncate(length);
        let rest = std::mem::replace(&mut self.input, Box::new(io::empty()));
        self.input = Box::new(Cursor::new(head.clone()).chain(rest));
        Ok(head)
    }

    pub(super) fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Error> {
        loop {
            match self.input.read(buffer) {
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                result => {
                    return result.map_err(|source| Error::Read { path: self.path.to_path_buf(), source });
                }
            }
        }
    }

    /// Reads less only at the end.
    pub(super) fn fill(&mut self, buffer: &mut [u8]) -> Result<usize, Error> {
        let mut filled = 0;
        while filled < buffer.len() {
            match self.read(&mut buffer[filled..])? {
                0 => break,
                read => filled += read,
            }
        }
        Ok(filled)
    }

    pub(super) fn at(&self, at: Position) -> Location {
        Location { path: self.path.clone(), at }
    }

    #[cfg(test)]
    pub(super) fn from_bytes(name: &str, bytes: impl AsRef<[u8]> + Send + 'static) -> Self {
        let length = bytes.as_ref().len() as u64;
        Self::new(Path::new(name), Cursor::new(bytes), Some(length)).unwrap()
    }
}

/// Returns the program that compressed content with this head, of those that no reader decompresses.
fn other_compression(head: &[u8]) -> Option<&'static str> {
    let known: [(&[u8], _); 4] =
        [(b"\xFD7zXZ\0", "xz"), (b"BZh", "bzip2"), (b"PK\x03\x04", "zip"), (b"\x04\x22\x4D\x18", "lz4")];
    known.into_iter().find(|(magic, _)| head.starts_with(magic)).map(|(_, program)| program)
}
