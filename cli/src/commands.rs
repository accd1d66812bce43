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

/// Most threads of llvmpipe.
const MAX_DRIVER_THREADS: u64 = 32;

/// Returns the bytes of a software driver's threads: stacks of 8 MiB, and code.
fn memory_of_driver_threads() -> u64 {
    let cores = std::thread::available_parallelism().map_or(1, |cores| cores.get() as u64);
    cores.min(MAX_DRIVER_THREADS) * (10 << 20)
}
