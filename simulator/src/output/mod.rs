//! The files of a run in its directory, which `docs/simulator.md` describes.

pub mod animation;
pub(crate) mod append_file;
mod arrivals;
#[cfg(feature = "arrow")]
mod arrow;
mod disk_estimate;
mod frames;
mod lock;
mod log_estimate;
pub(crate) mod occupancy;
pub(crate) mod options;
pub mod series;
mod symbols;
pub mod table;

use std::fs;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

pub(crate) use disk_estimate::{DiskEstimate, next_bytes};
pub(crate) use lock::Lock;
pub(crate) use log_estimate::{LOGGED_ARRIVALS, LOGGED_STEPS};

use append_file::AppendFile;

use crate::output::append_file::FileRecord;
use crate::output::options::Output;
use crate::{Error, Model, RunView};

const SERIES: &str = "series.csv";
const SYMBOLS: &str = "symbols.csv";
const XYZ: &str = "frames.xyz";
const ARRIVALS: &str = "arrivals.csv";
const RELEASES: &str = "releases.csv";
const OCCUPANCY: &str = "occupancy.csv";
const ANIMATED: &str = "animation.frames";

/// Files of runs, replicas, sweeps and reports, apart from frames and plots.
const RESULTS: [&str; 20] = [
    "checkpoint",
    "replicas.csv",
    "points.csv",
    SERIES,
    SYMBOLS,
    XYZ,
    ARRIVALS,
    RELEASES,
    OCCUPANCY,
    ANIMATED,
    "mean.csv",
    "sweep.csv",
    "animation.html",
    "arrivals.arrow",
    "releases.arrow",
    "report.html",
    "impulse-response.csv",
    "interference.csv",
    "bit-errors.csv",
    "by-symbol.csv",
];
/// Number of the first [`RESULTS`], which `--resume` continues.
const RESUMABLE: usize = 3;
const PLOTS: &str = "plots";
/// First of the last [`RESULTS`], which are made of a run's other files.
const DERIVED: usize = 12;

#[derive(Debug)]
pub(crate) struct Files {
    directory: PathBuf,
    output: Output,
    series: AppendFile,
    symbols: Option<AppendFile>,
    xyz: Option<AppendFile>,
    logs: Option<Logs>,
    animation: Option<AppendFile>,
    /// `true` if files made of these may be of fewer steps.
    has_derived: bool,
    _lock: Lock,
}

#[derive(Debug)]
struct Logs {
    arrivals: AppendFile,
    releases: AppendFile,
    /// Exists if receivers hold particles.
    occupancy: Option<AppendFile>,
    seed: u64,
    /// First step whose releases are not logged.
    next_step: u32,
}

impl Files {
    pub(crate) fn create(
        directory: &Path,
        output: Output,
        model: &Model,
        seed: u64,
        lock: Lock,
    ) -> Result<Self, Error> {
        let series = AppendFile::create(directory.join(SERIES))?;
        let xyz = output.xyz.then(|| AppendFile::create(directory.join(XYZ))).transpose()?;
        let mut logs = None;
        if model.logs_arrivals {
            let [mut arrivals, mut releases] = [
                AppendFile::create(directory.join(ARRIVALS))?,
                AppendFile::create(directory.join(RELEASES))?,
            ];
            arrivals.put(arrivals::header)?;
            releases.put(arrivals::header_of_releases)?;
            let holds = occupancy::is_logged(model);
            let mut occupancy = holds.then(|| AppendFile::create(directory.join(OCCUPANCY))).transpose()?;
            occupancy.iter_mut().try_for_each(|file| file.put(occupancy::header))?;
            logs = Some(Logs { arrivals, releases, occupancy, seed, next_step: 0 });
        }
        let animated = output.animation.is_some();
        let animation = animated.then(|| AppendFile::create(directory.join(ANIMATED))).transpose()?;
        let directory = directory.to_owned();
        let symbols = symbols::any(model).then(|| AppendFile::create(directory.join(SYMBOLS))).transpose()?;
        let has_derived = false;
        let mut files =
            Self { directory, output, series, symbols, xyz, logs, animation, has_derived, _lock: lock };
        files.series.put(|out| series::header(out, model))?;
        if let Some(symbols) = &mut files.symbols {
            symbols.put(|out| symbols::write(out, model, seed))?;
        }
        Ok(files)
    }

    /// Changes no file unless all begin as recorded.
    pub(crate) fn reopen(
        directory: &Path,
        output: Output,
        (model, seed): (&Model, u64),
        (records, done): (&[FileRecord], u32),
        lock: Lock,
    ) -> Result<Self, Error> {
        let reopen = |name: &str| {
            let Some(record) = records.iter().find(|record| record.name == name) else {
                let message =
                    format!("it is of a run without {name}; resume with the output that the run began with");
                return Err(Error::Checkpoint { path: directory.join("checkpoint"), message });
            };
            AppendFile::reopen(directory, record)
        };
        let series = reopen(SERIES)?;
        let symbols = symbols::any(model).then(|| reopen(SYMBOLS)).transpose()?;
        let xyz = output.xyz.then(|| reopen(XYZ)).transpose()?;
        let mut logs = None;
        if model.logs_arrivals {
            let [arrivals, releases] = [reopen(ARRIVALS)?, reopen(RELEASES)?];
            let occupancy = occupancy::is_logged(model).then(|| reopen(OCCUPANCY)).transpose()?;
            logs = Some(Logs { arrivals, releases, occupancy, seed, next_step: done + 1 });
        }
        let animation = output.animation.is_some().then(|| reopen(ANIMATED)).transpose()?;
        let directory = directory.to_owned();
        let has_derived = true;
        let mut files =
            Self { directory, output, series, symbols, xyz, logs, animation, has_derived, _lock: lock };
        files.growing().try_for_each(AppendFile::cut)?;
        Ok(files)
    }

    fn growing(&mut self) -> impl Iterator<Item = &mut AppendFile> {
        let Self { series, symbols, xyz, logs, animation, .. } = self;
        let logs = logs.iter_mut().flat_map(|Logs { arrivals, releases, occupancy, .. }| {
            [arrivals, releases].into_iter().chain(occupancy)
        });
        [series].into_iter().chain(symbols).chain(xyz).chain(logs).chain(animation)
    }

    pub(crate) fn record(&mut self, simulation: &impl RunView) -> Result<(), Error> {
        let step = simulation.step_count();
        if step.is_multiple_of(self.output.every) {
            self.series.put(|out| series::row(out, simulation))?;
        }
        if let Some(Logs { arrivals, releases, occupancy, seed, next_step }) = &mut self.logs {
            arrivals.put(|out| arrivals::rows(out, simulation))?;
            let steps = std::mem::replace(next_step, step + 1)..=step;
            releases.put(|out| arrivals::rows_of_releases(out, simulation.model(), *seed, steps))?;
            if let Some(occupancy) = occupancy.as_mut().filter(|_| step.is_multiple_of(self.output.every)) {
                let state = simulation.state()?;
                occupancy.put(|out| occupancy::rows(out, simulation.model(), &state))?;
            }
        }
        if let (Some(animation), Some(frames)) = (self.output.animated(step), &mut self.animation) {
            let state = simulation.state()?;
            frames.put(|out| animation::append(out, simulation.model(), &state, animation.particles))?;
        }
        if self.output.has_frame(step) {
            let state = simulation.state()?;
            if let Some(xyz) = &mut self.xyz {
                xyz.put(|out| frames::xyz(out, simulation.model(), &state))?;
            }
            if self.output.npy {
                let path = self.directory.join(format!("frame-{step:09}.npy"));
                let mut frame = AppendFile::create(path)?;
                frame.put(|out| frames::npy(out, simulation.model(), &state.particles))?;
                frame.sync()?;
            }
        }
        Ok(())
    }

    pub(crate) fn sync(&mut self) -> Result<Vec<FileRecord>, Error> {
        if std::mem::take(&mut self.has_derived) {
            remove_derived(&self.directory)?;
        }
        self.growing().map(AppendFile::sync).collect()
    }

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
}

pub(crate) fn check(directory: &Path, records: &[FileRecord]) -> Result<(), Error> {
    records.iter().try_for_each(|record| AppendFile::reopen(directory, record).map(drop))
}

/// Also locks the directory. Refuses one with files of a run, unless `overwrite`.
pub(crate) fn prepare(directory: &Path, overwrite: bool) -> Result<Lock, Error> {
    let refused = |source| Error::Write { path: directory.to_owned(), source };
    fs::create_dir_all(directory).map_err(refused)?;
    let lock = Lock::take(directory)?;
    let (resumable, others) = RESULTS.split_at(RESUMABLE);
    let holds = |name: &&str| directory.join(name).exists();
    if !overwrite && resumable.iter().any(holds) {
        let message = "it holds a run already; continue that with --resume, replace it with --overwrite, or choose \
                       another directory";
        return Err(refused(io::Error::new(io::ErrorKind::AlreadyExists, message)));
    }
    if let Some(name) = (!overwrite).then(|| foreign_result(directory, others)).transpose()?.flatten() {
        let message = format!(
            "it holds a file {name} of no run that can be continued; replace the file with --overwrite, or choose another \
             directory"
        );
        return Err(refused(io::Error::new(io::ErrorKind::AlreadyExists, message)));
    }
    Ok(lock)
}

/// Returns the name of a file in `directory` that a run would replace: one of `results`, or else the first frame.
fn foreign_result(directory: &Path, results: &[&str]) -> Result<Option<String>, Error> {
    let is_file = |name: &str| directory.join(name).is_file();
    if let Some(name) = results.iter().find(|name| is_file(name)) {
        return Ok(Some((*name).to_owned()));
    }
    let read = |source| Error::Read { path: directory.to_owned(), source };
    let mut first: Option<String> = None;
    for entry in fs::read_dir(directory).map_err(read)? {
        let name = entry.map_err(read)?.file_name();
        let Some(name) = name.to_str().filter(|name| is_frame(name) && is_file(name)) else { continue };
        if first.as_deref().is_none_or(|first| name < first) {
            first = Some(name.to_owned());
        }
    }
    Ok(first)
}

/// Returns `true` for the names of frames: `frame-STEP.npy`.
fn is_frame(name: &str) -> bool {
    let step = name.strip_prefix("frame-").and_then(|rest| rest.strip_suffix(".npy"));
    step.is_some_and(|step| step.len() >= 9 && step.bytes().all(|byte| byte.is_ascii_digit()))
}

/// Returns the numbers in names of a directory's entries that begin with `prefix`, ascending.
pub(crate) fn numbered(directory: &Path, prefix: &str) -> Result<Vec<u32>, Error> {
    let read = |source| Error::Read { path: directory.to_owned(), source };
    let mut numbers = Vec::new();
    for entry in fs::read_dir(directory).map_err(read)? {
        let name = entry.map_err(read)?.file_name();
        numbers.extend(name.to_str().and_then(|name| name.strip_prefix(prefix)?.parse::<u32>().ok()));
    }
    numbers.sort_unstable();
    numbers.dedup();
    Ok(numbers)
}

/// Removes the files of a run, but not the directories of replicas and points. Begins with the files that `--resume`
/// continues.
pub(crate) fn remove_results(directory: &Path) -> Result<(), Error> {
    remove_plots(directory)?;
    RESULTS.into_iter().try_for_each(|name| remove_file(directory.join(name)))?;
    remove_where(directory, is_frame)
}

/// Removes what is made of a run's finished files: reports, tables and copies in other formats.
pub(crate) fn remove_derived(directory: &Path) -> Result<(), Error> {
    remove_plots(directory)?;
    RESULTS[DERIVED..].iter().try_for_each(|name| remove_file(directory.join(name)))
}

/// Removes the plots that are part of the directory's report, but no files of the user.
fn remove_plots(directory: &Path) -> Result<(), Error> {
    let plots = directory.join(PLOTS);
    let is_directory = fs::symlink_metadata(&plots).is_ok_and(|plots| plots.is_dir());
    let Ok(report) = fs::read_to_string(directory.join("report.html")) else { return Ok(()) };
    if !is_directory {
        return Ok(());
    }
    let is_plot = |svg: String| !svg.is_empty() && report.contains(&svg);
    remove_where(&plots, |name| {
        name.ends_with(".svg") && fs::read_to_string(plots.join(name)).is_ok_and(is_plot)
    })?;
    // Remains if it holds other files.
    let _ = fs::remove_dir(plots);
    Ok(())
}

fn remove_where(directory: &Path, is_result: impl Fn(&str) -> bool) -> Result<(), Error> {
    let read = |source| Error::Read { path: directory.to_owned(), source };
    let entries = match fs::read_dir(directory) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
        entries => entries.map_err(read)?,
    };
    for entry in entries {
        let entry = entry.map_err(read)?;
        if entry.file_name().to_str().is_some_and(&is_result) {
            remove_file(entry.path())?;
        }
    }
    Ok(())
}

/// Removes a file, unless the path is a directory or a device.
fn remove_file(path: PathBuf) -> Result<(), Error> {
    match path.is_file() {
        true => fs::remove_file(&path).map_err(|source| Error::Write { path, source }),
        false => Ok(()),
    }
}

/// Replaces a file once its new content is complete.
///
/// # Errors
/// [`Error::Write`].
pub fn write_atomically(
    path: &Path,
    content: impl FnOnce(&mut BufWriter<&mut tempfile::NamedTempFile>) -> io::Result<()>,
) -> Result<(), Error> {
    let write = || -> io::Result<()> {
        let directory = path.parent().filter(|parent| *parent != Path::new("")).unwrap_or(Path::new("."));
        let mut builder = tempfile::Builder::new();
        builder.prefix(lock::TEMPORARY).rand_bytes(lock::RANDOM);
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
