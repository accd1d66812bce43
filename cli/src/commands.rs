pub(crate) mod calibrate;
pub(crate) mod check;
pub(crate) mod detect;
pub(crate) mod devices;
pub(crate) mod generate;
pub(crate) mod page;
pub(crate) mod simulate;

use lazygrid_io::{AvailableMemory, lacking_memory};

use crate::error::CliError;

/// Refuses `what` if it needs more bytes than are available. An allocation refused later would end the process.
///
/// # Errors
/// Returns [`CliError::TooLittleMemoryFor`].
fn check_memory(what: &'static str, needed: u64) -> Result<(), CliError> {
    match lacking_memory(needed) {
        None => Ok(()),
        Some(AvailableMemory { bytes: available, limit }) => {
            Err(CliError::TooLittleMemoryFor { what, needed, available, limit: limit.name() })
        }
    }
}
