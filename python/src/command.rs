use std::ffi::OsString;

use pyo3::prelude::*;

/// Run the command line, whose first argument is the program's name, and return the exit code.
#[pyfunction]
pub(crate) fn command(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    py.detach(|| lazygrid_cli::run(arguments))
}
