use std::io;
use std::path::PathBuf;

use thiserror::Error;

/// The reason why a command failed.
#[derive(Debug, Error)]
pub(crate) enum Failure {
    #[error("{0}")]
    Figures(String),
    #[error("{errors} measurements have a wrong answer or failed; {} names them", report.display())]
    WrongAnswers { errors: usize, report: PathBuf },
    #[error(
        "the new run is worse: {broken} measurements broke, {lost} are lost, {slower} slower, {larger} larger"
    )]
    Worse { broken: usize, lost: usize, slower: usize, larger: usize },
    #[error("{0}")]
    Kernels(String),
    #[error("{texts} texts of kernels were refused")]
    Refused { texts: usize },
    #[error("cannot write to standard output: {0}")]
    Stdout(io::Error),
}
