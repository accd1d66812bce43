use std::fs;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use crate::Error;
use crate::output::animation::PAGE_MARK;
use crate::output::options::Output;
use crate::output::report::{REPORT, TABLES, is_plot, remove_own_plots, remove_report};
use crate::output::{ANIMATED, ARRIVALS, Lock, OCCUPANCY, PLOTS, RELEASES, SERIES, SYMBOLS, XYZ};

/// Files of runs, replicas, sweeps and reports except frames, plots and tables.
const RESULTS: [&str; 16] = [
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
    MEAN,
    SWEEP,
    ANIMATION,
    ARROW[0],
    ARROW[1],
    REPORT,
];
pub(crate) const MEAN: &str = "mean.csv";
pub(crate) const SWEEP: &str = "sweep.csv";
/// Number of the first [`RESULTS`], which `--resume` continues.
const RESUMABLE: usize = 3;
const ANIMATION: &str = "animation.html";
/// Copies of the logs.
const ARROW: [&str; 2] = ["arrivals.arrow", "releases.arrow"];
/// Key and value in the schema of these copies.
pub(super) const ARROW_MARK: [&str; 2] = ["lazygrid", "copy of a log of lazygrid simulate"];
/// Bytes that contain a file's mark: two lines of a page, or the schema of a copy.
const MARKED_BYTES: u64 = 4096;

/// Creates and locks the directory. Refuses one with files of a run, unless `overwrite`.
pub(crate) fn prepare(directory: &Path, overwrite: bool) -> Result<Lock, Error> {
    let refused = |source| Error::Write { path: directory.to_owned(), source };
    if directory.exists() && !directory.is_dir() {
        let message = "it is a file; choose a directory for the output";
        return Err(refused(io::Error::new(io::ErrorKind::NotADirectory, message)));
    }
    fs::create_dir_all(directory).map_err(refused)?;
    let lock = Lock::acquire(directory)?;
    let (resumable, others) = RESULTS.split_at(RESUMABLE);
    let holds = |name: &&str| directory.join(name).exists();
    if !overwrite && resumable.iter().any(holds) {
        let message = "it holds a run already; continue that with --resume, replace it with --overwrite, or choose \
                       another directory";
        return Err(refused(io::Error::new(io::ErrorKind::AlreadyExists, message)));
    }
    match (!overwrite).then(|| foreign_result(directory, others)).transpose()?.flatten() {
        Some(name) => Err(foreign_file(directory, &name)),
        None => Ok(lock),
    }
}

/// Refuses the file `name` of others, which a run would replace.
pub(crate) fn refuse_file(directory: &Path, name: &str) -> Result<(), Error> {
    if is_file(&directory.join(name)) { Err(foreign_file(directory, name)) } else { Ok(()) }
}

/// Refuses a table that begins otherwise than those of runs.
pub(crate) fn refuse_other_table(directory: &Path, name: &str, beginning: &str) -> Result<(), Error> {
    let start = start_of(&directory.join(name), beginning.len() as u64);
    // A table that cannot be read is not known to be a run's.
    if start == beginning.as_bytes() { Ok(()) } else { refuse_file(directory, name) }
}

/// Refuses animation pages and Arrow copies of others that this output would replace.
pub(crate) fn refuse_other_derived(directory: &Path, output: &Output) -> Result<(), Error> {
    let mut others = derived(output.animation.is_some(), output.arrow);
    others.try_for_each(|name| if is_marked(directory, name) { Ok(()) } else { refuse_page(directory, name) })
}

fn derived(has_page: bool, has_copies: bool) -> impl Iterator<Item = &'static str> {
    let page = has_page.then_some(ANIMATION);
    page.into_iter().chain(ARROW.into_iter().filter(move |_| has_copies))
}

fn is_marked(directory: &Path, name: &str) -> bool {
    let path = directory.join(name);
    let mark = if name == ANIMATION { PAGE_MARK } else { ARROW_MARK[1] };
    let start = if is_regular(&path) { start_of(&path, MARKED_BYTES) } else { Vec::new() };
    start.windows(mark.len()).any(|bytes| bytes == mark.as_bytes())
}

/// Returns at most `length` bytes, none if the file cannot be read.
pub(crate) fn start_of(path: &Path, length: u64) -> Vec<u8> {
    let mut start = Vec::new();
    // Opening a pipe would wait.
    let open = if path.is_file() { fs::File::open(path) } else { Err(io::ErrorKind::NotFound.into()) };
    match open.and_then(|file| file.take(length).read_to_end(&mut start)) {
        Ok(_) => start,
        Err(_) => Vec::new(),
    }
}

fn foreign_file(directory: &Path, name: &str) -> Error {
    let message = format!(
        "it holds a file {name} of no run that can be continued; move the file; a new run may also replace it with \
         --overwrite, or use another directory"
    );
    foreign_error(directory, message)
}

/// Refuses the file `name`, which has no mark.
pub(super) fn refuse_page(directory: &Path, name: &str) -> Result<(), Error> {
    let message = format!(
        "it holds a file {name} that was written by another version or by another program; move it, or start over with \
         --overwrite"
    );
    if is_file(&directory.join(name)) { Err(foreign_error(directory, message)) } else { Ok(()) }
}

fn foreign_error(directory: &Path, message: String) -> Error {
    let source = io::Error::new(io::ErrorKind::AlreadyExists, message);
    Error::Write { path: directory.to_owned(), source }
}

/// Links count as files, also broken ones.
pub(super) fn is_file(path: &Path) -> bool {
    fs::symlink_metadata(path).is_ok_and(|data| !data.is_dir())
}

/// Links are not regular files.
pub(super) fn is_regular(path: &Path) -> bool {
    fs::symlink_metadata(path).is_ok_and(|data| data.is_file())
}

fn foreign_result(directory: &Path, results: &[&str]) -> Result<Option<String>, Error> {
    if let Some(name) = results.iter().chain(&TABLES).find(|name| directory.join(name).is_file()) {
        return Ok(Some((*name).to_owned()));
    }
    if let Some(frame) = first_file(directory, is_frame)? {
        return Ok(Some(frame));
    }
    let plot = first_file(&directory.join(PLOTS), is_plot)?;
    Ok(plot.map(|name| format!("{PLOTS}/{name}")))
}

fn first_file(directory: &Path, has_name: impl Fn(&str) -> bool) -> Result<Option<String>, Error> {
    let mut first: Option<String> = None;
    for entry in entries(directory)? {
        let name = entry?.file_name();
        let Some(name) = name.to_str().filter(|name| has_name(name) && is_file(&directory.join(name))) else {
            continue;
        };
        if first.as_deref().is_none_or(|first| name < first) {
            first = Some(name.to_owned());
        }
    }
    Ok(first)
}

fn entries(directory: &Path) -> Result<impl Iterator<Item = Result<fs::DirEntry, Error>>, Error> {
    let read = |source| Error::Read { path: directory.to_owned(), source };
    let entries = match fs::read_dir(directory) {
        Err(error) if matches!(error.kind(), io::ErrorKind::NotFound | io::ErrorKind::NotADirectory) => None,
        entries => Some(entries.map_err(read)?),
    };
    Ok(entries.into_iter().flatten().map(move |entry| entry.map_err(read)))
}

fn is_frame(name: &str) -> bool {
    let step = name.strip_prefix("frame-").and_then(|rest| rest.strip_suffix(".npy"));
    step.is_some_and(|step| step.len() >= 9 && step.bytes().all(|byte| byte.is_ascii_digit()))
}

/// Returns the ascending numbers after `prefix` in names of entries.
pub(crate) fn numbered(directory: &Path, prefix: &str) -> Result<Vec<u32>, Error> {
    let mut numbers = Vec::new();
    for entry in entries(directory)? {
        let name = entry?.file_name();
        numbers.extend(name.to_str().and_then(|name| name.strip_prefix(prefix)?.parse::<u32>().ok()));
    }
    numbers.sort_unstable();
    numbers.dedup();
    Ok(numbers)
}

/// Removes the files of a run, those that `--resume` continues first, but no directories of replicas and points.
pub(crate) fn remove_results(directory: &Path) -> Result<(), Error> {
    remove_own_plots(directory)?;
    RESULTS.into_iter().chain(TABLES).try_for_each(|name| remove_file(directory.join(name)))?;
    remove_where(directory, is_frame)
}

/// Removes the files of replicas, which could count as done in a later run.
pub(crate) fn remove_replicas(directory: &Path) -> Result<(), Error> {
    let replicas = numbered(directory, "replica-")?.into_iter();
    replicas
        .map(|replica| replica_directory(directory, replica))
        .try_for_each(|replica| remove_results(&replica))
}

pub(crate) fn replica_directory(directory: &Path, replica: u32) -> PathBuf {
    directory.join(format!("replica-{replica:04}"))
}

/// Removes the report, animation page and Arrow copies of a run. Files of others stay.
pub(crate) fn remove_derived(directory: &Path, is_animated: bool, has_logs: bool) -> Result<(), Error> {
    remove_report(directory)?;
    let mut marked = derived(is_animated, has_logs).filter(|name| is_marked(directory, name));
    marked.try_for_each(|name| remove_file(directory.join(name)))
}

pub(super) fn remove_where(directory: &Path, is_result: impl Fn(&str) -> bool) -> Result<(), Error> {
    for entry in entries(directory)? {
        let entry = entry?;
        if entry.file_name().to_str().is_some_and(&is_result) {
            remove_file(entry.path())?;
        }
    }
    Ok(())
}

/// Leaves directories and devices alone.
pub(super) fn remove_file(path: PathBuf) -> Result<(), Error> {
    match path.is_file() {
        true => fs::remove_file(&path).map_err(|source| Error::Write { path, source }),
        false => Ok(()),
    }
}
