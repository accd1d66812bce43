use std::fs;
use std::path::Path;

use lazygrid_bench::gpu_results::{GpuRun, document};
use lazygrid_io::write::AtomicFile;

use crate::command::args::GpuResults;
use crate::command::failure::Failure;

pub(crate) fn run(args: &GpuResults) -> Result<(), Failure> {
    let runs = args.runs.iter().map(|path| read(path)).collect::<Result<Vec<_>, _>>()?;
    let text = document(&runs, lazygrid_bench::COMMIT);
    write(&args.output, &text).map_err(|error| Failure::GpuResults(error.to_string()))
}

fn write(path: &Path, text: &str) -> Result<(), lazygrid_io::Error> {
    let mut file = AtomicFile::create_or_stdout(path)?;
    file.write_with(|out| out.write_all(text.as_bytes()))?;
    file.commit()
}

fn read(path: &Path) -> Result<GpuRun, Failure> {
    let text = fs::read_to_string(path).map_err(|error| failed(path, &error.to_string()))?;
    GpuRun::parse(&text).map_err(|reason| failed(path, &reason))
}

fn failed(path: &Path, reason: &str) -> Failure {
    Failure::GpuResults(format!("{}: {reason}", path.display()))
}
