//! XXH64, the checksum of files that a run resumes from.
//!
//! Two of a million files share a 64-bit checksum with a probability of 3 × 10⁻⁸; 32 bits would collide.

use std::hash::Hasher;
use std::io::{self, BufReader, Read, Write};

use twox_hash::XxHash64;

const BUFFER_BYTES: usize = 1 << 16;

pub(crate) fn xxh64(bytes: &[u8]) -> u64 {
    XxHash64::oneshot(0, bytes)
}

#[derive(Clone, Debug)]
pub(crate) struct Digest {
    length: u64,
    hasher: XxHash64,
}

impl Digest {
    pub(crate) fn new() -> Self {
        Self { length: 0, hasher: XxHash64::with_seed(0) }
    }

    pub(crate) fn from_reader(reader: impl Read, length: u64) -> io::Result<Self> {
        let mut sink = DigestWriter::new(io::sink(), Self::new());
        io::copy(&mut BufReader::with_capacity(BUFFER_BYTES, reader.take(length)), &mut sink)?;
        Ok(sink.digest)
    }

    pub(crate) fn length(&self) -> u64 {
        self.length
    }

    pub(crate) fn checksum(&self) -> u64 {
        self.hasher.finish()
    }

    pub(crate) fn add(&mut self, bytes: &[u8]) {
        self.length += bytes.len() as u64;
        self.hasher.write(bytes);
    }
}

/// Needs a buffer in front of it: short writes are slow to digest.
#[derive(Debug)]
pub(crate) struct DigestWriter<W> {
    inner: W,
    digest: Digest,
}

impl<W> DigestWriter<W> {
    pub(crate) fn new(inner: W, digest: Digest) -> Self {
        Self { inner, digest }
    }

    pub(crate) fn inner(&self) -> &W {
        &self.inner
    }

    pub(crate) fn digest(&self) -> &Digest {
        &self.digest
    }
}

impl<W: Write> Write for DigestWriter<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.inner.write(bytes)?;
        self.digest.add(&bytes[..written]);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checkpoints depend on the algorithm. Expected: `xxhsum -H64`.
    #[test]
    fn checksum_of_known_text_is_xxh64() {
        assert_eq!(xxh64(b""), 0xef46_db37_51d8_e999);
        assert_eq!(xxh64(b"abc"), 0x44bc_2cf5_ad77_0999);
    }

    #[test]
    fn digest_in_chunks_equals_digest_at_once() {
        let bytes: Vec<u8> = (0..1000_u32).flat_map(|k| (k * k).to_le_bytes()).collect();
        let mut writer = DigestWriter::new(Vec::new(), Digest::new());
        for chunk in bytes.chunks(37) {
            writer.write_all(chunk).expect("memory takes all");
        }
        assert_eq!(writer.digest().checksum(), xxh64(&bytes));
        assert_eq!(writer.digest().length(), 4000);
        let head = Digest::from_reader(&bytes[..], 1500).expect("memory is read");
        assert_eq!((head.length(), head.checksum()), (1500, xxh64(&bytes[..1500])));
        let mut writer = DigestWriter::new(Vec::new(), head);
        writer.write_all(&bytes[1500..]).expect("memory takes all");
        assert_eq!(writer.digest().checksum(), xxh64(&bytes));
    }
}
