//! Files of checkpoints, in the layout of `docs/simulator.md`.

use std::io::Write;
use std::path::Path;

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::error::Damage;
use crate::memory::check_available;
use crate::{Error, checksum, output};

/// Begins checkpoints of all versions.
const NAME: &str = "lazygrid checkpoint ";
const VERSION: u32 = 7;
/// Bytes of the longest first line.
const MAX_FIRST_LINE: u64 = 64;
/// Bytes of memory per byte of a file: the file, and its particles. A free particle has 24 bytes and a bound one 28,
/// but 18 or more in the file, in which small numbers of 32 bits take one byte. Growing vectors have capacity for twice
/// their elements: 1 + 2 × 28 / 18 ≈ 4.
const MEMORY_PER_BYTE: u64 = 4;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FileKind {
    Whole,
    Part,
}

impl FileKind {
    fn first_line(self) -> String {
        self.first_line_of(VERSION)
    }

    fn first_line_of(self, version: u32) -> String {
        let kind = match self {
            Self::Whole => "",
            Self::Part => ", part",
        };
        format!("{NAME}{version}{kind}\n")
    }
}

/// Replaces a file once this one is complete. Returns the checksum.
pub(crate) fn write(path: &Path, kind: FileKind, content: &impl Serialize) -> Result<u64, Error> {
    let mut checksum = 0;
    output::write_atomically(path, |out| {
        let mut bytes = kind.first_line().into_bytes();
        let [sum_at, length_at, payload_at] = [0, 8, 16].map(|after| bytes.len() + after);
        bytes.resize(payload_at, 0);
        let mut bytes = postcard::to_extend(content, bytes).map_err(std::io::Error::other)?;
        let length = (bytes.len() - payload_at) as u64;
        bytes[length_at..payload_at].copy_from_slice(&length.to_le_bytes());
        checksum = checksum::xxh64(&bytes[length_at..]);
        bytes[sum_at..length_at].copy_from_slice(&checksum.to_le_bytes());
        out.write_all(&bytes)
    })?;
    Ok(checksum)
}

/// Checks length and checksum before decoding. Returns content and checksum.
pub(crate) fn read<T: DeserializeOwned>(path: &Path, kind: FileKind) -> Result<(T, u64), Error> {
    let read = |source| Error::Read { path: path.to_owned(), source };
    let length = std::fs::metadata(path).map_err(read)?.len();
    let remedy = "run fewer replicas at once (--threads), free memory, or raise the limit";
    check_available("the contents of the checkpoint", length.saturating_mul(MEMORY_PER_BYTE), remedy)?;
    let bytes = std::fs::read(path).map_err(read)?;
    let damaged = |damage| Error::Damaged { path: path.to_owned(), damage };
    let Some(rest) = bytes.strip_prefix(kind.first_line().as_bytes()) else {
        return Err(match version(&bytes) {
            Some(found) if found != VERSION => {
                Error::CheckpointVersion { path: path.to_owned(), found, expected: VERSION }
            }
            _ => damaged(Damage::Header { expected: kind.first_line().trim_end().to_owned() }),
        });
    };
    let Some((&sum, (&length, payload))) =
        split_number(rest).and_then(|(sum, rest)| Some((sum, split_number(rest)?)))
    else {
        let header = (bytes.len() - rest.len() + 16) as u64;
        return Err(damaged(Damage::Length { found: bytes.len() as u64, expected: header }));
    };
    let (found, expected) = (payload.len() as u64, u64::from_le_bytes(length));
    if found != expected {
        let header = (bytes.len() - payload.len()) as u64;
        let expected = header.saturating_add(expected);
        return Err(damaged(Damage::Length { found: bytes.len() as u64, expected }));
    }
    let (found, expected) = (checksum::xxh64(&rest[8..]), u64::from_le_bytes(sum));
    if found != expected {
        return Err(damaged(Damage::Checksum { found, expected }));
    }
    match postcard::take_from_bytes(payload) {
        Ok((content, [])) => Ok((content, found)),
        Ok((_, rest)) => Err(damaged(Damage::Content(format!("{} bytes are left over", rest.len())))),
        Err(error) => Err(damaged(Damage::Content(error.to_string()))),
    }
}

/// Returns `true` for a file of this kind and any version.
pub(crate) fn has_kind(path: &Path, kind: FileKind) -> bool {
    let start = output::start_of(path, MAX_FIRST_LINE);
    version(&start).is_some_and(|version| start.starts_with(kind.first_line_of(version).as_bytes()))
}

fn split_number(bytes: &[u8]) -> Option<(&[u8; 8], &[u8])> {
    bytes.split_first_chunk()
}

fn version(bytes: &[u8]) -> Option<u32> {
    let rest = bytes.strip_prefix(NAME.as_bytes())?;
    let digits = rest.iter().take_while(|byte| byte.is_ascii_digit()).count();
    let ends = matches!(rest.get(digits), Some(b'\n' | b','));
    std::str::from_utf8(&rest[..digits]).ok().filter(|_| ends)?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn file_with_any_damage_is_refused() {
        let directory = tempfile::tempdir().expect("a directory");
        let path = directory.path().join("sealed");
        let content = (3_u8, "text".to_owned(), [0.5_f32, 2.0]);
        let sum = write(&path, FileKind::Part, &content).expect("is written");
        assert_eq!(read(&path, FileKind::Part).expect("is read"), (content, sum));
        let whole = std::fs::read(&path).expect("is there");
        let refused = |bytes: &[u8]| {
            std::fs::write(&path, bytes).expect("is written");
            let error = read::<(u8, String, [f32; 2])>(&path, FileKind::Part).expect_err("is damaged");
            assert!(matches!(error, Error::Damaged { .. } | Error::CheckpointVersion { .. }), "{error}");
            error.to_string()
        };
        for bit in 0..8 * whole.len() {
            let mut bytes = whole.clone();
            bytes[bit / 8] ^= 1 << (bit % 8);
            refused(&bytes);
        }
        for length in 0..whole.len() {
            refused(&whole[..length]);
        }
        let longer = refused(&[&whole[..], b"\0"].concat());
        let lengths = format!("it has {} bytes instead of {}", whole.len() + 1, whole.len());
        assert!(longer.contains(&lengths) && longer.contains("--overwrite"), "{longer}");
        std::fs::write(&path, &whole).expect("is written");
        assert!(read::<(u8, String, [f32; 2])>(&path, FileKind::Whole).is_err());
    }

    #[test]
    fn checkpoint_of_another_version_is_refused_with_its_version() {
        let directory = tempfile::tempdir().expect("a directory");
        let path = directory.path().join("checkpoint");
        for (text, found) in [("lazygrid checkpoint 4\nmore", 4), ("lazygrid checkpoint 12, part\n", 12)] {
            std::fs::write(&path, text).expect("is written");
            let error = read::<u8>(&path, FileKind::Whole).expect_err("is of another version");
            assert!(
                matches!(error, Error::CheckpointVersion { found: reported, .. } if reported == found),
                "{error}"
            );
        }
    }
}
