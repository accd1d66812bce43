pub(crate) mod calibrate;
pub(crate) mod check;
pub(crate) mod detect;
pub(crate) mod devices;
pub(crate) mod generate;
pub(crate) mod page;
pub(crate) mod simulate;

use lazygrid_io::{AvailableMemory, lacking_address_space, lacking_memory, memory_of_driver};

use crate::error::CliError;

/// Refuses `what` if memory is short, as a refused allocation would end the process.
fn check_memory(what: &'static str, needed: u64) -> Result<(), CliError> {
    refuse_if_lacking(what, needed, lacking_memory(needed))
}

/// Address space that glibc reserves for the heaps of other threads.
const THREAD_HEAP_BYTES: u64 = 2 * (128 << 20);

/// Refuses `what` if memory is short for it and for a few threads.
fn check_memory_with_threads(what: &'static str, needed: u64) -> Result<(), CliError> {
    let (needed, lacking) = lacking_with_threads(needed);
    refuse_if_lacking(what, needed, lacking)
}

/// Returns the bytes that are needed or mapped, and the memory if it is less.
fn lacking_with_threads(needed: u64) -> (u64, Option<AvailableMemory>) {
    match lacking_memory(needed) {
        Some(available) => (needed, Some(available)),
        None => {
            let mapped = needed.saturating_add(THREAD_HEAP_BYTES);
            (mapped, lacking_address_space(mapped))
        }
    }
}

/// Refuses `what` if a software driver could not map its memory.
fn check_memory_of_driver(what: &'static str) -> Result<(), CliError> {
    let needed = memory_of_driver();
    refuse_if_lacking(what, needed, lacking_address_space(needed))
}

fn refuse_if_lacking(
    what: &'static str,
    needed: u64,
    lacking: Option<AvailableMemory>,
) -> Result<(), CliError> {
    match lacking {
        None => Ok(()),
        Some(AvailableMemory { bytes: available, limit }) => {
            Err(CliError::TooLittleMemoryFor { what, needed, available, limit: limit.name() })
        }
    }
}
