use std::fs::{File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use crate::Error;
use crate::error::Damage;
use serde::{Deserialize, Serialize};

use crate::checksum::{Digest, DigestWriter};

type Writer = BufWriter<DigestWriter<File>>;

/// An appended file at the checkpoint.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FileRecord {
    pub name: String,
    pub length: u64,
    /// XXH64.
    pub checksum: u64,
}

#[derive(Debug)]
pub(super) struct AppendFile {
    path: PathBuf,
    out: Writer,
}

impl AppendFile {
    pub(super) fn create(path: PathBuf) -> Result<Self, Error> {
        let file = File::create(&path).map_err(|source| Error::Write { path: path.clone(), source })?;
        Ok(Self { path, out: BufWriter::new(DigestWriter::new(file, Digest::new())) })
    }

    /// [`truncate`](Self::truncate) must precede the first write.
    pub(super) fn reopen(directory: &Path, record: &FileRecord) -> Result<Self, Error> {
        let path = directory.join(&record.name);
        let mut file = OpenOptions::new().read(true).write(true).open(&path).map_err(|source| {
            let path = path.clone();
            match source.kind() {
                io::ErrorKind::NotFound => Error::Read { path, source },
                _ => Error::Write { path, source },
            }
        })?;
        let read = Digest::from_reader(&mut file, record.length);
        let digest = read.map_err(|source| Error::Read { path: path.clone(), source })?;
        let damage = match (digest.length(), digest.checksum()) {
            (found, _) if found != record.length => Damage::Length { found, expected: record.length },
            (_, found) if found != record.checksum => Damage::Checksum { found, expected: record.checksum },
            _ => return Ok(Self { path, out: BufWriter::new(DigestWriter::new(file, digest)) }),
        };
        Err(Error::Damaged { path, damage })
    }

    pub(super) fn truncate(&mut self) -> Result<(), Error> {
        let out = self.out.get_ref();
        out.inner().set_len(out.digest().length()).map_err(|source| self.refused(source))
    }

    pub(super) fn append(&mut self, write: impl FnOnce(&mut Writer) -> io::Result<()>) -> Result<(), Error> {
        write(&mut self.out).map_err(|source| self.refused(source))
    }

    pub(super) fn sync(&mut self) -> Result<FileRecord, Error> {
        let synced = self.out.flush().and_then(|()| self.out.get_ref().inner().sync_data());
        synced.map_err(|source| self.refused(source))?;
        let digest = self.out.get_ref().digest();
        let name = self.path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        Ok(FileRecord { name, length: digest.length(), checksum: digest.checksum() })
    }

    fn refused(&self, source: io::Error) -> Error {
        Error::Write { path: self.path.clone(), source }
    }
}
