use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use lazygrid_io::Error;
use lazygrid_io::arguments::unused_radius;
use lazygrid_io::read::{Frame, Frames};
use rayon::ThreadPool;
use same_file::Handle;

use crate::args::{Detect, STANDARD};
use crate::error::CliError;
use crate::progress::Progress;

pub(crate) struct Input {
    path: PathBuf,
    frames: Frames,
    /// `None` uses the process's threads.
    pool: Option<ThreadPool>,
    read: usize,
    wanted: Option<usize>,
    pub(crate) progress: Progress,
}

pub(crate) struct IndexedFrame {
    pub(crate) number: usize,
    pub(crate) frame: Frame,
    pub(crate) time: Duration,
}

impl Input {
    pub(crate) fn open(args: &Detect) -> Result<Self, CliError> {
        let path = name(&args.file).to_owned();
        let (input, length) =
            open(&args.file).map_err(|source| Error::Read { path: path.clone(), source })?;
        let progress = Progress::new(length);
        progress.say("reading");
        let frames = Frames::new(&path, progress.wrap(input), length, args.options()?)?;
        let pool = args.threads.and_then(|threads| {
            let useful = std::thread::available_parallelism().map_or(threads, |cores| cores.min(threads));
            lazygrid::thread_pool(useful.get()).ok()
        });
        Ok(Self { path, frames, pool, read: 0, wanted: args.frame, progress })
    }

    pub(crate) fn next(&mut self) -> Result<Option<IndexedFrame>, CliError> {
        let start = Instant::now();
        while self.wanted.is_none_or(|wanted| wanted >= self.read) {
            self.progress.say("reading");
            let Self { frames, pool, .. } = self;
            let Some(frame) = in_pool(pool.as_ref(), || frames.next()).transpose()? else {
                return self.end();
            };
            let number = self.read;
            self.read += 1;
            if self.wanted.is_none_or(|wanted| wanted == number) {
                return Ok(Some(IndexedFrame { number, frame, time: start.elapsed() }));
            }
        }
        self.end()
    }

    pub(crate) fn in_pool<T: Send>(&self, work: impl FnOnce() -> T + Send) -> T {
        in_pool(self.pool.as_ref(), work)
    }

    pub(crate) fn is_last(&mut self) -> Result<bool, CliError> {
        Ok(self.wanted.is_some() || self.frames.at_end()?)
    }

    fn end(&self) -> Result<Option<IndexedFrame>, CliError> {
        match self.wanted {
            Some(frame) if frame >= self.read => {
                return Err(CliError::NoFrame { path: self.path.clone(), frame, frames: self.read });
            }
            None if self.read == 0 => return Err(CliError::Empty { path: self.path.clone() }),
            _ => {}
        }
        for species in self.frames.species().unused_radii() {
            log::warn!("{}", unused_radius(&self.path, species));
        }
        Ok(None)
    }

    pub(crate) fn species_met(&self) -> usize {
        self.frames.species().names().len()
    }
}

fn in_pool<T: Send>(pool: Option<&ThreadPool>, work: impl FnOnce() -> T + Send) -> T {
    match pool {
        Some(pool) => pool.install(work),
        None => work(),
    }
}

pub(crate) fn name(file: &Path) -> &Path {
    if file == Path::new(STANDARD) { Path::new("standard input") } else { file }
}

fn open(path: &Path) -> io::Result<(Box<dyn Read + Send>, Option<u64>)> {
    if path == Path::new(STANDARD) {
        return Ok((Box::new(io::stdin()), None));
    }
    let file = File::open(path)?;
    let metadata = file.metadata()?;
    Ok((Box::new(file), metadata.is_file().then_some(metadata.len())))
}

pub(crate) fn handle(path: &Path) -> Option<Handle> {
    if path == Path::new(STANDARD) { file_handle(Handle::stdin()) } else { handle_of_file(path) }
}

/// `None` for terminals and other things that no output replaces. Opening a FIFO once more would block.
pub(crate) fn handle_of_file(path: &Path) -> Option<Handle> {
    let is_file = std::fs::metadata(path).is_ok_and(|metadata| metadata.is_file());
    is_file.then(|| Handle::from_path(path).ok()).flatten()
}

fn file_handle(handle: io::Result<Handle>) -> Option<Handle> {
    handle.ok().filter(|handle| handle.as_file().metadata().is_ok_and(|metadata| metadata.is_file()))
}
