use std::fs;
use std::path::Path;

use lazygrid_bench::gpu_results::{GpuRun, document};

use crate::command::args::GpuResults;
use crate::command::failure::Failure;

pub(crate) fn run(args: &GpuResults) -> Result<(), Failure> {
    let runs = args.runs.iter().map(|path| read(path)).collect::<Result<Vec<_>, _>>()?;
    let text = document(&runs, lazygrid_bench::COMMIT);
    fs::write(&args.output, text).map_err(|error| failed(&args.output, &error.to_string()))
}

fn read(path: &Path) -> Result<GpuRun, Failure> {
    let text = fs::read_to_string(path).map_err(|error| failed(path, &error.to_string()))?;
    GpuRun::parse(&text).map_err(|reason| failed(path, &reason))
}

fn failed(path: &Path, reason: &str) -> Failure {
    Failure::GpuResults(format!("{}: {reason}", path.display()))
}
