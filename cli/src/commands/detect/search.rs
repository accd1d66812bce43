use std::ops::ControlFlow;
use std::path::Path;
use std::time::{Duration, Instant};

use lazygrid::{Config, Detector, Query, Skin, Space};
use lazygrid_io::read::Frame;
use lazygrid_io::write::{self, AtomicFile, Output, PairFile};

use crate::args::Detect;
use crate::commands::detect::input::name;
use crate::error::CliError;
use crate::progress::Progress;

/// 8 MiB of pairs.
const CHUNK: usize = 1 << 20;

pub(crate) struct FrameDetector {
    config: Config,
    space: Space,
    pub(crate) detector: Detector,
}

impl FrameDetector {
    pub(crate) fn new(config: Config) -> Result<Self, CliError> {
        let detector = Detector::new(config.clone()).map_err(CliError::Setting)?;
        Ok(Self { config, space: Space::UNBOUNDED, detector })
    }

    /// Returns the bytes without a candidate list, which is dropped if memory is short.
    pub(crate) fn least_memory(&self, frame: &Frame) -> Result<u64, CliError> {
        let config = self.config.clone().space(frame.space).skin(Skin::Off).threads(1);
        let detector = Detector::new(config).map_err(CliError::Setting)?;
        let spheres = frame.len() as u64;
        let is_f64 = frame.doubles.is_some();
        Ok(if is_f64 { detector.memory_for_f64(spheres) } else { detector.memory_for(spheres) })
    }

    pub(crate) fn detector(&mut self, space: Space) -> Result<&mut Detector, CliError> {
        if space != self.space {
            self.detector = Detector::new(self.config.clone().space(space)).map_err(CliError::Setting)?;
            self.space = space;
        }
        Ok(&mut self.detector)
    }
}

pub(crate) struct Search<'a> {
    pub(crate) args: &'a Detect,
    pub(crate) frame: usize,
    pub(crate) query: Query<'a>,
    pub(crate) ids: Option<&'a [i64]>,
    pub(crate) detector: &'a mut Detector,
    pub(crate) progress: &'a Progress,
    pub(crate) writing: Duration,
}

impl Search<'_> {
    pub(crate) fn run(&mut self, output: Option<&Output>) -> Result<Vec<AtomicFile>, CliError> {
        let failure = failure_in(&self.args.file, self.frame);
        self.progress.say(format!("searching {} spheres", self.query.len()));
        match output {
            None if self.args.count => drop(self.detector.count(self.query).map_err(failure)?),
            None if self.args.neighbors => drop(self.detector.neighbors(self.query).map_err(failure)?),
            None => drop(self.detector.pairs(self.query).map_err(failure)?),
            Some(output) if self.args.neighbors => {
                let lists = self.detector.neighbors(self.query).map_err(failure)?;
                self.progress.say("writing");
                return timed(&mut self.writing, || Ok(write::neighbors(output, lists, self.ids)?));
            }
            Some(output) => {
                let create = |pairs: u64| PairFile::create(output, pairs, self.ids);
                let file = match self.detector.pairs(self.query) {
                    Ok(pairs) => {
                        self.progress.say(format!("writing {} pairs", pairs.len()));
                        timed(&mut self.writing, || {
                            let mut file = create(pairs.len() as u64)?;
                            file.add(pairs).map(|()| file)
                        })?
                    }
                    Err(lazygrid::Error::TooManyPairs { found, .. }) => {
                        let file = create(found)?;
                        self.stream(file, found)?
                    }
                    Err(error) => return Err(failure(error)),
                };
                return Ok(vec![file.finish()?]);
            }
        }
        Ok(Vec::new())
    }

    fn stream<'f>(&mut self, mut file: PairFile<'f>, found: u64) -> Result<PairFile<'f>, CliError> {
        let Self { detector, writing, progress, .. } = self;
        let (mut failed, mut written) = (None, 0);
        let streamed = detector.stream(self.query, CHUNK, |pairs| match timed(writing, || file.add(pairs)) {
            Ok(()) => {
                written += pairs.len();
                progress.say(format!("writing, {written} of {found} pairs"));
                ControlFlow::Continue(())
            }
            Err(error) => {
                failed = Some(error);
                ControlFlow::Break(())
            }
        });
        streamed.map_err(failure_in(&self.args.file, self.frame))?;
        failed.map_or(Ok(file), |error| Err(error.into()))
    }
}

fn timed<T>(time: &mut Duration, work: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let result = work();
    *time += start.elapsed();
    result
}

fn failure_in(file: &Path, frame: usize) -> impl Fn(lazygrid::Error) -> CliError + Copy {
    move |source| CliError::Detection { path: name(file).to_owned(), frame, source }
}
