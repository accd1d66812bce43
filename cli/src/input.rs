use std::fs::File;
use std::io;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use indicatif::ProgressBar;
use lazygrid_io::Error;
use lazygrid_io::read::{Frame, Frames};

use crate::args::Detect;
use crate::failure::Failure;
use crate::progress;

/// The frames of the file that are asked for.
pub(crate) struct Input {
    path: PathBuf,
    frames: Frames,
    /// How many frames were read.
    read: usize,
    wanted: Option<usize>,
    bar: ProgressBar,
}

/// A frame, its number in the file, and how long it took to read.
pub(crate) struct Numbered {
    pub(crate) number: usize,
    pub(crate) frame: Frame,
    pub(crate) time: Duration,
}

impl Input {
    pub(crate) fn open(args: &Detect) -> Result<Self, Failure> {
        let path = args.file.clone();
        let open = || -> io::Result<_> {
            let file = File::open(&path)?;
            let metadata = file.metadata()?;
            Ok((file, metadata.is_file().then_some(metadata.len())))
        };
        let (file, length) = open().map_err(|source| Error::Read { path: path.clone(), source })?;
        let bar = progress::reading(length);
        let frames = Frames::new(&path, bar.wrap_read(file), length, args.options())?;
        Ok(Self { path, frames, read: 0, wanted: args.frame, bar })
    }

    /// The next frame that is asked for. Says so where there is none at all.
    pub(crate) fn next(&mut self) -> Result<Option<Numbered>, Failure> {
        let start = Instant::now();
        while self.wanted.is_none_or(|wanted| wanted >= self.read) {
            let Some(frame) = self.frames.next().transpose()? else { return self.end() };
            let number = self.read;
            self.read += 1;
            if self.wanted.is_none_or(|wanted| wanted == number) {
                return Ok(Some(Numbered { number, frame, time: start.elapsed() }));
            }
        }
        self.end()
    }

    fn end(&self) -> Result<Option<Numbered>, Failure> {
        self.bar.finish_and_clear();
        match self.wanted {
            Some(frame) if frame >= self.read => {
                return Err(Failure::NoFrame { path: self.path.clone(), frame, frames: self.read });
            }
            None if self.read == 0 => return Err(Failure::Empty { path: self.path.clone() }),
            _ => {}
        }
        for species in self.frames.species().unused_radii() {
            log::warn!(
                "{}: no sphere is of species '{species}', for which a radius was given",
                self.path.display()
            );
        }
        Ok(None)
    }

    /// How many species were met so far.
    pub(crate) fn species_met(&self) -> usize {
        self.frames.species().names().len()
    }

    /// Does what would disturb the progress bar.
    pub(crate) fn beside_the_bar<T>(&self, work: impl FnOnce() -> T) -> T {
        self.bar.suspend(work)
    }
}
