use std::ffi::OsString;

use pyo3::prelude::*;

/// Run the command line, which begins with the program's name, and return the exit code.
///
/// ``closed`` tells that the program began without standard output, so that writing to it fails.
#[pyfunction]
#[pyo3(signature = (arguments, *, closed=false))]
pub(crate) fn command(py: Python<'_>, arguments: Vec<OsString>, closed: bool) -> u8 {
    if closed {
        lazygrid_cli::set_output_closed();
    }
    py.detach(|| lazygrid_cli::run(arguments))
}
