pub(crate) mod exclusions;
pub(crate) mod input;
pub(crate) mod search;
pub(crate) mod summary;

use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use lazygrid::Backend;
use lazygrid_io::read::{Frame, Precision, SortError};
use lazygrid_io::write::{AtomicFile, Output};
use lazygrid_io::{AvailableMemory, lacking_memory};
use same_file::Handle;

use self::exclusions::ExclusionFile;
use self::input::{IndexedFrame, Input};
use self::search::{FrameDetector, Search};
use self::summary::Summary;
use crate::args::{Detect, FRAME};
use crate::commands::check_memory_of_driver;
use crate::error::CliError;
use crate::printer::Printer;
use crate::{check_output, print};

/// Bytes that a software driver maps after its device is open (llvmpipe): compiled kernels, and memory for them.
const KERNELS: u64 = 128 << 20;

pub(crate) fn run(args: &Detect) -> Result<(), CliError> {
    let output = args.output()?;
    let config = args.config()?;
    if args.is_on_gpu() {
        check_memory_of_driver("the search on a GPU")?;
    }
    let mut frames = FrameDetector::new(config)?;
    let mut excluded = ExclusionFile::read(args)?;
    let mut input = Input::open(args)?;
    if output.as_ref().is_some_and(|output| output.path.is_none()) {
        check_output()?;
    }
    let to_stdout = output.as_ref().is_some_and(|output| output.path.is_none());
    let has_frame_number = output.as_ref().is_some_and(has_number);
    // The output keeps its temporary name until no second frame appears.
    let (mut files, mut printer) = (Vec::new(), Printer::default());
    while let Some(IndexedFrame { number, mut frame, time }) = input.next()? {
        // Bytes on standard output cannot be withdrawn.
        if !files.is_empty() || (to_stdout && !input.is_last()?) {
            return Err(CliError::SeveralFrames { path: input::name(&args.file).to_owned() });
        }
        let output = output.as_ref().map(|output| numbered(output, number));
        output.as_ref().map_or(Ok(()), |output| refuse_inputs(args, output))?;
        if args.ids {
            let spheres = frame.len();
            let refused = |error| unsorted(args, number, spheres, error);
            input.in_pool(|| frame.sort_by_id()).map_err(refused)?;
        }
        refuse_too_little_memory(args, number, &frame, &frames)?;
        let exclusions = excluded.as_mut().map(|excluded| excluded.exclusions(&frame, number)).transpose()?;
        let query = exclusions::query(&frame, exclusions.as_ref());
        let mut search = Search {
            args,
            frame: number,
            query: query.map_err(|error| CliError::Setting(error.into()))?,
            ids: frame.ids.as_deref(),
            detector: frames.detector(frame.space)?,
            progress: &input.progress,
            writing: Duration::ZERO,
        };
        files = search.run(output.as_ref())?;
        let writing = search.writing;
        if has_frame_number || to_stdout {
            AtomicFile::commit_all(files.drain(..))?;
        }
        let is_product = output.is_none();
        let summary = Summary {
            frame: number,
            step: frame.step,
            space: frame.space,
            space_given: args.periodic.is_some(),
            precision: if frame.doubles.is_some() { Precision::F64 } else { Precision::F32 },
            report: frames.detector.report(),
            species: if frame.species.is_some() { input.species_met() } else { 0 },
            read: time,
            write: output.is_some().then_some(writing),
            output: output.map(|output| output.name().to_owned()),
        };
        let text = if args.json { summary.json() } else { summary.to_string() };
        input.progress.hidden_during(|| match (to_stdout, is_product) {
            (true, _) => print_aside(&text),
            (false, true) => print(text),
            (false, false) => {
                printer.print(text);
                Ok(())
            }
        })?;
    }
    excluded.as_ref().inspect(|excluded| excluded.warn_of_unmet());
    AtomicFile::commit_all(files)?;
    printer.finish()
}

fn unsorted(args: &Detect, frame: usize, spheres: usize, error: SortError) -> CliError {
    let path = input::name(&args.file).to_owned();
    match error {
        SortError::RepeatedId(id) => CliError::IdTwice { path, frame, id },
        _ => CliError::NoMemoryToSort { path, frame, spheres },
    }
}

fn print_aside(text: &str) -> Result<(), CliError> {
    let _ = io::stderr().write_all(text.as_bytes());
    Ok(())
}

fn refuse_too_little_memory(
    args: &Detect,
    frame: usize,
    read: &Frame,
    frames: &FrameDetector,
) -> Result<(), CliError> {
    let spheres = read.len();
    let is_on_cpu = frames.detector.report().backend == Backend::Cpu;
    if !is_on_cpu && !args.has_software_adapter()? {
        return Ok(());
    }
    let needed = match frames.least_memory(read)? {
        least if is_on_cpu => least,
        // The search refuses what exceeds the device's limits.
        u64::MAX => return Ok(()),
        least => least.saturating_add(KERNELS),
    };
    match lacking_memory(needed) {
        None => Ok(()),
        Some(AvailableMemory { bytes: available, limit }) => {
            let (path, limit) = (input::name(&args.file).to_owned(), limit.name());
            let remedy = if read.doubles.is_some() { ", read it with --precision f32" } else { "" };
            Err(CliError::TooLittleMemory { path, frame, spheres, needed, available, limit, remedy })
        }
    }
}

/// Refuses an output that is an input file under any name.
fn refuse_inputs(args: &Detect, output: &Output) -> Result<(), CliError> {
    let spheres = input::handle(&args.file).map(|handle| (input::name(&args.file), handle));
    let excluded = args.exclude.as_deref();
    let excluded = excluded.and_then(|path| Some((path, input::handle_of_file(path)?)));
    spheres.into_iter().chain(excluded).try_for_each(|(path, read)| refuse_input(args, output, path, &read))
}

fn refuse_input(args: &Detect, output: &Output, path: &Path, read: &Handle) -> Result<(), CliError> {
    let same = |written: Option<Handle>| written.is_some_and(|written| written == *read);
    let refused = match output.path {
        None => same(Handle::stdout().ok()).then(|| output.name().to_owned()),
        Some(_) => {
            let files = output.files(args.neighbors, args.ids);
            files.into_iter().find(|file| same(input::handle_of_file(file)))
        }
    };
    refused.map_or(Ok(()), |output| Err(CliError::OutputIsInput { input: path.to_owned(), output }))
}

fn has_number(output: &Output) -> bool {
    output.path.as_ref().and_then(|path| path.to_str()).is_some_and(|path| path.contains(FRAME))
}

fn numbered(output: &Output, frame: usize) -> Output {
    let with_number = |path: &Path| match path.to_str() {
        Some(text) => PathBuf::from(text.replace(FRAME, &frame.to_string())),
        None => path.to_owned(),
    };
    Output { path: output.path.as_deref().map(with_number), ..output.clone() }
}
