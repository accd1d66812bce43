#[cfg(feature = "gpu")]
use lazygrid_io::lacking_address_space;
use lazygrid_io::{AvailableMemory, lacking_memory};

use crate::Error;

/// Bytes that are written faster than the system tells the available memory.
const MIN_CHECKED: u64 = 1 << 20;

/// Refuses `what` if it needs more bytes than are available.
///
/// # Errors
/// [`Error::TooLittleMemory`].
pub fn check_available(what: &str, needed: u64, remedy: &'static str) -> Result<(), Error> {
    let lacking = if needed < MIN_CHECKED { None } else { lacking_memory(needed) };
    refuse_if_lacking(what, needed, lacking, remedy)
}

/// Refuses `what` if it maps more bytes than `ulimit -v` leaves.
///
/// # Errors
/// [`Error::TooLittleMemory`].
#[cfg(feature = "gpu")]
pub(crate) fn check_address_space(what: &str, needed: u64, remedy: &'static str) -> Result<(), Error> {
    refuse_if_lacking(what, needed, lacking_address_space(needed), remedy)
}

fn refuse_if_lacking(
    what: &str,
    needed: u64,
    lacking: Option<AvailableMemory>,
    remedy: &'static str,
) -> Result<(), Error> {
    let Some(AvailableMemory { bytes: available, limit }) = lacking else { return Ok(()) };
    Err(Error::TooLittleMemory { what: what.to_owned(), needed, available, limit: limit.name(), remedy })
}
