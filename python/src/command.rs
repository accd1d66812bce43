use std::ffi::OsString;

use pyo3::prelude::*;

/// Do what the arguments say, of which the first is the program's name, and return the exit code.
#[pyfunction]
pub(crate) fn command(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    py.detach(|| lazygrid_cli::run(arguments))
}
