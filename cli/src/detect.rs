use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use lazygrid::{Config, Detector, Space, Spheres};
use lazygrid_host::Error::TooManyPairs;
use lazygrid_io::write::{self, Draft, PairFile, TableFormat};

use crate::args::Detect;
use crate::failure::Failure;
use crate::input::{Input, Numbered};
use crate::summary::Summary;
use crate::{print, progress};

/// Pairs per chunk where a result is streamed, 8 MiB.
const CHUNK: usize = 1 << 20;
/// Stands for the number of the frame in the name of an output.
const FRAME: &str = "{frame}";

/// Reads frame after frame, finds the pairs of each with one detector, and says what was found.
pub(crate) fn run(args: &Detect) -> Result<(), Failure> {
    let mut engine = Engine::new(args.config())?;
    let mut input = Input::open(args)?;
    let own_output = args.output.as_ref().is_some_and(|(path, _)| path.to_string_lossy().contains(FRAME));
    // The output of a file with one frame keeps its temporary name until it is clear that there is no other.
    let mut drafts = Vec::new();
    while let Some(Numbered { number, frame, time }) = input.next()? {
        if !drafts.is_empty() {
            return Err(Failure::SeveralFrames { path: args.file.clone() });
        }
        let output = args.output.as_ref().map(|(path, format)| (numbered(path, number), *format));
        if let Some((path, format)) = &output {
            refuse_input(args, path, *format)?;
        }
        let spheres = Spheres::from(&frame.spheres);
        let spinner = progress::working("searching", spheres.len());
        let detector = engine.detector(frame.space)?;
        let mut search = Search { args, frame: number, spheres, detector, writing: Duration::ZERO };
        drafts = search.run(output.as_ref())?;
        let writing = search.writing;
        spinner.finish_and_clear();
        if own_output {
            publish(&mut drafts)?;
        }
        let summary = Summary {
            frame: number,
            step: frame.step,
            space: frame.space,
            space_given: args.periodic.is_some(),
            report: engine.detector.report(),
            species: if frame.species.is_some() { input.species_met() } else { 0 },
            read: time,
            write: output.is_some().then_some(writing),
            output: output.map(|(path, _)| path),
        };
        input.beside_the_bar(|| print(if args.json { summary.json() } else { summary.to_string() }))?;
    }
    publish(&mut drafts)
}

fn publish(drafts: &mut Vec<Draft>) -> Result<(), Failure> {
    drafts.drain(..).try_for_each(|draft| Ok(draft.publish()?))
}

/// The detector for the frames of a file, whose box may change from one to the next.
struct Engine {
    config: Config,
    space: Space,
    detector: Detector,
}

impl Engine {
    fn new(config: Config) -> Result<Self, Failure> {
        let detector = Detector::new(config.clone()).map_err(Failure::Setting)?;
        Ok(Self { config, space: Space::UNBOUNDED, detector })
    }

    /// The detector for this space; a new one where the last frame's was another.
    fn detector(&mut self, space: Space) -> Result<&mut Detector, Failure> {
        if space != self.space {
            self.detector = Detector::new(self.config.clone().space(space)).map_err(Failure::Setting)?;
            self.space = space;
        }
        Ok(&mut self.detector)
    }
}

/// The search of one frame.
struct Search<'a> {
    args: &'a Detect,
    frame: usize,
    spheres: Spheres<'a>,
    detector: &'a mut Detector,
    /// Time spent writing.
    writing: Duration,
}

impl Search<'_> {
    /// Finds what is asked for and writes it to `output`; the files are yet to be published.
    fn run(&mut self, output: Option<&(PathBuf, TableFormat)>) -> Result<Vec<Draft>, Failure> {
        let failure = failure_in(&self.args.file, self.frame);
        match output {
            None if self.args.count => drop(self.detector.count(self.spheres).map_err(failure)?),
            None if self.args.neighbors => drop(self.detector.neighbors(self.spheres).map_err(failure)?),
            None => drop(self.detector.pairs(self.spheres).map_err(failure)?),
            Some((path, format)) if self.args.neighbors => {
                let lists = self.detector.neighbors(self.spheres).map_err(failure)?;
                return timed(&mut self.writing, || Ok(write::neighbors(path, *format, lists)?));
            }
            Some((path, format)) => {
                let create = |pairs: u64| PairFile::create(path, *format, pairs);
                let file = match self.detector.pairs(self.spheres) {
                    Ok(pairs) => timed(&mut self.writing, || {
                        let mut file = create(pairs.len() as u64)?;
                        file.add(pairs).map(|()| file)
                    })?,
                    Err(lazygrid::Error::Host(TooManyPairs { found, .. })) => self.stream(create(found)?)?,
                    Err(error) => return Err(failure(error)),
                };
                return Ok(vec![file.finish()]);
            }
        }
        Ok(Vec::new())
    }

    /// Writes more pairs than a list may hold, chunk by chunk.
    fn stream(&mut self, mut file: PairFile) -> Result<PairFile, Failure> {
        let Self { detector, writing, .. } = self;
        let mut failed = None;
        let streamed =
            detector.stream(self.spheres, CHUNK, |pairs| match timed(writing, || file.add(pairs)) {
                Ok(()) => ControlFlow::Continue(()),
                Err(error) => {
                    failed = Some(error);
                    ControlFlow::Break(())
                }
            });
        streamed.map_err(failure_in(&self.args.file, self.frame))?;
        failed.map_or(Ok(file), |error| Err(error.into()))
    }
}

/// Refuses an output that would replace the input, under whichever name.
fn refuse_input(args: &Detect, output: &Path, format: TableFormat) -> Result<(), Failure> {
    let files = write::files_of(output, format, args.neighbors);
    let same = files.into_iter().find(|file| same_file::is_same_file(file, &args.file).unwrap_or(false));
    same.map_or(Ok(()), |output| Err(Failure::OutputIsInput { input: args.file.clone(), output }))
}

/// Runs `work` and adds the time it takes.
fn timed<T>(time: &mut Duration, work: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let result = work();
    *time += start.elapsed();
    result
}

fn failure_in(file: &Path, frame: usize) -> impl Fn(lazygrid::Error) -> Failure + Copy {
    move |source| Failure::Detection { path: file.to_owned(), frame, source }
}

/// The path of this frame's output.
fn numbered(path: &Path, frame: usize) -> PathBuf {
    match path.to_str() {
        Some(text) => text.replace(FRAME, &frame.to_string()).into(),
        None => path.to_owned(),
    }
}
