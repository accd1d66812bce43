//! The files of a run; see `docs/simulator.md`.

pub mod animation;
pub(crate) mod append_file;
mod arrivals;
#[cfg(feature = "arrow")]
mod arrow;
mod directory;
mod disk_estimate;
mod draft;
mod frames;
mod lock;
mod log_estimate;
pub(crate) mod occupancy;
pub(crate) mod options;
mod report;
pub mod series;
mod symbols;
pub mod table;

use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};

pub(crate) use directory::{
    MEAN, SWEEP, numbered, prepare, refuse_file, refuse_other_derived, refuse_other_table, remove_derived,
    remove_replicas, remove_results, replica_directory, start_of,
};
pub(crate) use disk_estimate::{DiskEstimate, next_bytes};
pub(crate) use lock::{Lock, has_begun};
pub(crate) use log_estimate::{LOGGED_ARRIVALS, LOGGED_STEPS};
pub use report::{Report, TableWriter, write_report};
pub(crate) use report::{TABLES, refuse_foreign_files, refuse_foreign_page, remove_report};

use append_file::AppendFile;
use draft::Draft;

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
const PLOTS: &str = "plots";

#[derive(Debug)]
pub(crate) struct Files {
    directory: PathBuf,
    output: Output,
    series: AppendFile,
    symbols: Option<AppendFile>,
    xyz: Option<AppendFile>,
    logs: Option<Logs>,
    animation: Option<AppendFile>,
    /// Derived files may have fewer steps.
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

#[derive(Clone, Copy, Debug)]
pub(crate) struct WrittenRun<'a> {
    pub(crate) model: &'a Model,
    pub(crate) seed: u64,
    pub(crate) records: &'a [FileRecord],
    pub(crate) step_count: u32,
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
            arrivals.append(arrivals::header)?;
            releases.append(arrivals::header_of_releases)?;
            let holds = occupancy::is_logged(model);
            let mut occupancy = holds.then(|| AppendFile::create(directory.join(OCCUPANCY))).transpose()?;
            occupancy.iter_mut().try_for_each(|file| file.append(occupancy::header))?;
            logs = Some(Logs { arrivals, releases, occupancy, seed, next_step: 0 });
        }
        let animated = output.animation.is_some();
        let animation = animated.then(|| AppendFile::create(directory.join(ANIMATED))).transpose()?;
        let directory = directory.to_owned();
        let symbols = symbols::any(model).then(|| AppendFile::create(directory.join(SYMBOLS))).transpose()?;
        let has_derived = false;
        let mut files =
            Self { directory, output, series, symbols, xyz, logs, animation, has_derived, _lock: lock };
        files.series.append(|out| series::header(out, model))?;
        if let Some(symbols) = &mut files.symbols {
            symbols.append(|out| symbols::write(out, model, seed))?;
        }
        Ok(files)
    }

    /// Changes no file unless all begin as recorded, and derived files are not of others.
    pub(crate) fn reopen(
        directory: &Path,
        output: Output,
        run: WrittenRun<'_>,
        lock: Lock,
    ) -> Result<Self, Error> {
        let WrittenRun { model, seed, records, step_count } = run;
        let reopen = |name: &str| {
            let Some(record) = records.iter().find(|record| record.name == name) else {
                let message =
                    format!("it is of a run without {name}; resume with the output that the run began with");
                return Err(Error::Checkpoint { path: directory.join("checkpoint"), message });
            };
            AppendFile::reopen(directory, record)
        };
        refuse_other_derived(directory, &output)?;
        let series = reopen(SERIES)?;
        let symbols = symbols::any(model).then(|| reopen(SYMBOLS)).transpose()?;
        let xyz = output.xyz.then(|| reopen(XYZ)).transpose()?;
        let mut logs = None;
        if model.logs_arrivals {
            let [arrivals, releases] = [reopen(ARRIVALS)?, reopen(RELEASES)?];
            let occupancy = occupancy::is_logged(model).then(|| reopen(OCCUPANCY)).transpose()?;
            logs = Some(Logs { arrivals, releases, occupancy, seed, next_step: step_count + 1 });
        }
        let animation = output.animation.is_some().then(|| reopen(ANIMATED)).transpose()?;
        let directory = directory.to_owned();
        let has_derived = true;
        let mut files =
            Self { directory, output, series, symbols, xyz, logs, animation, has_derived, _lock: lock };
        files.append_files().try_for_each(AppendFile::truncate)?;
        Ok(files)
    }

    fn append_files(&mut self) -> impl Iterator<Item = &mut AppendFile> {
        let Self { series, symbols, xyz, logs, animation, .. } = self;
        let logs = logs.iter_mut().flat_map(|Logs { arrivals, releases, occupancy, .. }| {
            [arrivals, releases].into_iter().chain(occupancy)
        });
        [series].into_iter().chain(symbols).chain(xyz).chain(logs).chain(animation)
    }

    pub(crate) fn record(&mut self, simulation: &impl RunView) -> Result<(), Error> {
        let step = simulation.step_count();
        if step.is_multiple_of(self.output.every) {
            self.series.append(|out| series::row(out, simulation))?;
        }
        if let Some(Logs { arrivals, releases, occupancy, seed, next_step }) = &mut self.logs {
            arrivals.append(|out| arrivals::rows(out, simulation))?;
            let steps = std::mem::replace(next_step, step + 1)..=step;
            releases.append(|out| arrivals::rows_of_releases(out, simulation.model(), *seed, steps))?;
            if let Some(occupancy) = occupancy.as_mut().filter(|_| step.is_multiple_of(self.output.every)) {
                let state = simulation.state()?;
                occupancy.append(|out| occupancy::rows(out, simulation.model(), &state))?;
            }
        }
        if let (Some(animation), Some(frames)) = (self.output.animated(step), &mut self.animation) {
            let state = simulation.state()?;
            frames.append(|out| animation::append(out, simulation.model(), &state, animation.particles))?;
        }
        if self.output.has_frame(step) {
            let state = simulation.state()?;
            if let Some(xyz) = &mut self.xyz {
                xyz.append(|out| frames::xyz(out, simulation.model(), &state))?;
            }
            if self.output.npy {
                let path = self.directory.join(format!("frame-{step:09}.npy"));
                let mut frame = AppendFile::create(path)?;
                frame.append(|out| frames::npy(out, simulation.model(), &state.particles))?;
                frame.sync()?;
            }
        }
        Ok(())
    }

    pub(crate) fn sync(&mut self) -> Result<Vec<FileRecord>, Error> {
        if std::mem::take(&mut self.has_derived) {
            remove_derived(&self.directory, self.animation.is_some(), self.logs.is_some())?;
        }
        self.append_files().map(AppendFile::sync).collect()
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

/// Replaces a file once its new content is complete.
///
/// # Errors
/// [`Error::Write`].
pub fn write_atomically(
    path: &Path,
    content: impl FnOnce(&mut BufWriter<&mut tempfile::NamedTempFile>) -> io::Result<()>,
) -> Result<(), Error> {
    Draft::write(path, content)?.publish()
}
