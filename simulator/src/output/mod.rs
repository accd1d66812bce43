//! The files of a run, in a directory of their own: `series.csv`, `frames.xyz`, `frame-000000000.npy` and so on,
//! `symbols.csv` where messages are sent, and `checkpoint`.

mod forecast;
mod frames;
mod lock;
pub mod series;
mod symbols;

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

pub(crate) use forecast::{Forecast, next};
pub(crate) use lock::Lock;

use crate::scenario::Output;
use crate::{Error, Model, Simulator};

/// The open files of a run.
#[derive(Debug)]
pub(crate) struct Files {
    directory: PathBuf,
    output: Output,
    series: Growing,
    xyz: Option<Growing>,
    _lock: Lock,
}

impl Files {
    /// New files of a new run.
    pub(crate) fn create(
        directory: &Path,
        output: Output,
        (model, seed): (&Model, u64),
        lock: Lock,
    ) -> Result<Self, Error> {
        let series = Growing::create(directory.join("series.csv"))?;
        let xyz = output.xyz.then(|| Growing::create(directory.join("frames.xyz"))).transpose()?;
        let mut files = Self { directory: directory.to_owned(), output, series, xyz, _lock: lock };
        files.series.put(|out| series::header(out, model))?;
        if symbols::any(model) {
            let mut sent = Growing::create(directory.join("symbols.csv"))?;
            sent.put(|out| symbols::write(out, model, seed))?;
            sent.sync()?;
        }
        Ok(files)
    }

    /// The files of a run that goes on, as long as they were at the checkpoint.
    pub(crate) fn reopen(
        directory: &Path,
        output: Output,
        lengths: &[u64],
        lock: Lock,
    ) -> Result<Self, Error> {
        let length = |k: usize| lengths.get(k).copied().unwrap_or(0);
        let series = Growing::reopen(directory.join("series.csv"), length(0))?;
        let xyz = output.xyz.then(|| Growing::reopen(directory.join("frames.xyz"), length(1))).transpose()?;
        Ok(Self { directory: directory.to_owned(), output, series, xyz, _lock: lock })
    }

    /// Writes what is due after the steps done so far.
    pub(crate) fn record(&mut self, simulation: &Simulator) -> Result<(), Error> {
        let step = simulation.step_count();
        if step.is_multiple_of(self.output.every) {
            self.series.put(|out| series::row(out, simulation))?;
        }
        if self.output.has_frame(step) {
            let state = simulation.state()?;
            if let Some(xyz) = &mut self.xyz {
                xyz.put(|out| frames::xyz(out, simulation.model(), &state))?;
            }
            if self.output.npy {
                let path = self.directory.join(format!("frame-{step:09}.npy"));
                let mut frame = Growing::create(path)?;
                frame.put(|out| frames::npy(out, simulation.model(), &state.particles))?;
                frame.sync()?;
            }
        }
        Ok(())
    }

    /// Sees to it that all is on the disk, and says how long each file is.
    pub(crate) fn sync(&mut self) -> Result<Vec<u64>, Error> {
        let mut lengths = vec![self.series.sync()?];
        lengths.extend(self.xyz.as_mut().map(Growing::sync).transpose()?);
        Ok(lengths)
    }
}

/// A file that grows.
#[derive(Debug)]
struct Growing {
    path: PathBuf,
    out: BufWriter<File>,
}

impl Growing {
    fn create(path: PathBuf) -> Result<Self, Error> {
        let file = File::create(&path).map_err(|source| Error::Write { path: path.clone(), source })?;
        Ok(Self { path, out: BufWriter::new(file) })
    }

    /// A file that exists, cut to a length.
    fn reopen(path: PathBuf, length: u64) -> Result<Self, Error> {
        let cut = || -> io::Result<File> {
            let mut file = OpenOptions::new().write(true).open(&path)?;
            if file.metadata()?.len() < length {
                let message =
                    format!("it is shorter than the {length} bytes that the checkpoint goes on from");
                return Err(io::Error::new(io::ErrorKind::InvalidData, message));
            }
            file.set_len(length)?;
            file.seek(SeekFrom::End(0))?;
            Ok(file)
        };
        let file = cut().map_err(|source| Error::Write { path: path.clone(), source })?;
        Ok(Self { path, out: BufWriter::new(file) })
    }

    fn put(&mut self, write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> Result<(), Error> {
        write(&mut self.out).map_err(|source| Error::Write { path: self.path.clone(), source })
    }

    fn sync(&mut self) -> Result<u64, Error> {
        let length = self.out.flush().and_then(|()| self.out.get_ref().sync_data());
        let length = length.and_then(|()| self.out.get_ref().metadata()).map(|metadata| metadata.len());
        length.map_err(|source| Error::Write { path: self.path.clone(), source })
    }
}

/// A directory for a new run, locked. One that holds a run already is refused.
///
/// # Errors
/// [`Error::Write`].
pub(crate) fn prepare(directory: &Path, overwrite: bool) -> Result<Lock, Error> {
    let refused = |source| Error::Write { path: directory.to_owned(), source };
    fs::create_dir_all(directory).map_err(refused)?;
    let lock = Lock::take(directory)?;
    if !overwrite && directory.join("checkpoint").exists() {
        let message = "it holds a run already; continue that with --resume, replace it with --overwrite, or choose \
                       another directory";
        return Err(refused(io::Error::new(io::ErrorKind::AlreadyExists, message)));
    }
    Ok(lock)
}
