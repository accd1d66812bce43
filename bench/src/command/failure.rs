use std::io;
use std::path::PathBuf;

use thiserror::Error;

#[derive(Debug, Error)]
pub(crate) enum Failure {
    #[error("{0}")]
    Figures(String),
    #[error("{errors} measurements gave a wrong answer or failed; see {}", report.display())]
    WrongAnswers { errors: usize, report: PathBuf },
    #[error(
        "the new run is worse: {broken} measurements broken, {lost} lost, {slower} slower, {larger} larger"
    )]
    Worse { broken: usize, lost: usize, slower: usize, larger: usize },
    #[error("{0}")]
    GpuResults(String),
    #[error("{0}")]
    Kernels(String),
    #[error("drivers rejected {variants} kernel variants")]
    Rejected { variants: usize },
    #[error("cannot write to standard output: {0}")]
    Stdout(io::Error),
}
