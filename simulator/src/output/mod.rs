//! The files of a run, in a directory of their own: `series.csv`, `frames.xyz`, `frame-000000000.npy` and so on,
//! `symbols.csv` where messages are sent, `arrivals.csv` and `releases.csv` (and the same as `.arrow`), `animation.html` where they are asked
//! for, and `checkpoint`.

mod arrivals;
#[cfg(feature = "arrow")]
mod arrow;
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

use crate::animation;
use crate::results::series::Series;
use crate::scenario::Output;
use crate::{Error, Model, Standing};

/// The frames from which the animation is made.
const ANIMATED: &str = "animation.frames";

/// The open files of a run.
#[derive(Debug)]
pub(crate) struct Files {
    directory: PathBuf,
    output: Output,
    series: Growing,
    xyz: Option<Growing>,
    logs: Option<Logs>,
    animation: Option<Growing>,
    _lock: Lock,
}

/// Who was released and who arrived.
#[derive(Debug)]
struct Logs {
    arrivals: Growing,
    releases: Growing,
    seed: u64,
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
        let mut logs = None;
        if model.logs_arrivals {
            let [mut arrivals, mut releases] = [
                Growing::create(directory.join("arrivals.csv"))?,
                Growing::create(directory.join("releases.csv"))?,
            ];
            arrivals.put(arrivals::header)?;
            releases.put(arrivals::header_of_releases)?;
            logs = Some(Logs { arrivals, releases, seed });
        }
        let animated = output.animation.is_some();
        let animation = animated.then(|| Growing::create(directory.join(ANIMATED))).transpose()?;
        let directory = directory.to_owned();
        let mut files = Self { directory, output, series, xyz, logs, animation, _lock: lock };
        files.series.put(|out| series::header(out, model))?;
        if symbols::any(model) {
            let mut sent = Growing::create(files.directory.join("symbols.csv"))?;
            sent.put(|out| symbols::write(out, model, seed))?;
            sent.sync()?;
        }
        Ok(files)
    }

    /// The files of a run that goes on, as long as they were at the checkpoint.
    pub(crate) fn reopen(
        directory: &Path,
        output: Output,
        (model, seed): (&Model, u64),
        lengths: &[u64],
        lock: Lock,
    ) -> Result<Self, Error> {
        let mut lengths = lengths.iter().copied();
        let mut reopen =
            |name: &str| Growing::reopen(directory.join(name), lengths.next().unwrap_or_default());
        let series = reopen("series.csv")?;
        let xyz = output.xyz.then(|| reopen("frames.xyz")).transpose()?;
        let mut logs = None;
        if model.logs_arrivals {
            let [arrivals, releases] = [reopen("arrivals.csv")?, reopen("releases.csv")?];
            logs = Some(Logs { arrivals, releases, seed });
        }
        let animation = output.animation.is_some().then(|| reopen(ANIMATED)).transpose()?;
        Ok(Self { directory: directory.to_owned(), output, series, xyz, logs, animation, _lock: lock })
    }

    /// Writes what is due after the steps done so far.
    pub(crate) fn record(&mut self, simulation: &impl Standing) -> Result<(), Error> {
        let step = simulation.step_count();
        if step.is_multiple_of(self.output.every) {
            self.series.put(|out| series::row(out, simulation))?;
        }
        if let Some(Logs { arrivals, releases, seed }) = &mut self.logs {
            arrivals.put(|out| arrivals::rows(out, simulation))?;
            releases.put(|out| arrivals::rows_of_releases(out, simulation, *seed))?;
        }
        if let (Some(animation), Some(frames)) = (self.output.animated(step), &mut self.animation) {
            let state = simulation.state()?;
            frames.put(|out| animation::append(out, (simulation.model(), &state), animation.particles))?;
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
        if let Some(Logs { arrivals, releases, .. }) = &mut self.logs {
            lengths.extend([arrivals.sync()?, releases.sync()?]);
        }
        lengths.extend(self.animation.as_mut().map(Growing::sync).transpose()?);
        Ok(lengths)
    }

    /// Makes Arrow files of the log so far, where they are asked for.
    pub(crate) fn convert(&self, model: &Model) -> Result<(), Error> {
        match self.output.arrow && self.logs.is_some() {
            #[cfg(feature = "arrow")]
            true => arrow::convert(&self.directory, model),
            #[cfg(not(feature = "arrow"))]
            true => {
                let _ = model;
                Err(Error::NoArrow)
            }
            false => Ok(()),
        }
    }

    /// Makes the page that plays the run so far, where it is animated.
    pub(crate) fn animate(&self, model: &Model, title: &str) -> Result<(), Error> {
        let Some(frames) = &self.animation else { return Ok(()) };
        let path = self.directory.join("animation.html");
        let series = Series::read(&self.series.path)?;
        replace(&path, |out| animation::page(out, (model, title), &frames.path, &series))
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
    let holds = |name: &str| directory.join(name).exists();
    if !overwrite && (holds("checkpoint") || holds("replicas.csv")) {
        let message = "it holds a run already; continue that with --resume, replace it with --overwrite, or choose \
                       another directory";
        return Err(refused(io::Error::new(io::ErrorKind::AlreadyExists, message)));
    }
    Ok(lock)
}

/// Takes away files of an earlier run that would be taken for those of this one.
///
/// # Errors
/// [`Error::Write`].
pub(crate) fn forget(directory: &Path, names: &[&str]) -> Result<(), Error> {
    for name in names {
        let path = directory.join(name);
        match fs::remove_file(&path) {
            Err(source) if source.kind() != io::ErrorKind::NotFound => {
                return Err(Error::Write { path, source });
            }
            _ => {}
        }
    }
    Ok(())
}

/// Writes a file in place of the one before, which is untouched until this one is complete.
///
/// # Errors
/// [`Error::Write`].
pub(crate) fn replace(
    path: &Path,
    content: impl FnOnce(&mut BufWriter<&mut tempfile::NamedTempFile>) -> io::Result<()>,
) -> Result<(), Error> {
    let write = || -> io::Result<()> {
        let directory = path.parent().filter(|parent| *parent != Path::new("")).unwrap_or(Path::new("."));
        let mut builder = tempfile::Builder::new();
        builder.prefix(".draft-");
        // A temporary file is private by default, but the file that it becomes is an ordinary one.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let mut file = builder.tempfile_in(directory)?;
        let mut out = BufWriter::new(&mut file);
        content(&mut out)?;
        out.flush()?;
        drop(out);
        file.as_file().sync_data()?;
        file.persist(path)?;
        Ok(())
    };
    write().map_err(|source| Error::Write { path: path.to_owned(), source })
}
