//! Refusals of work that exceeds the available memory.

use lazygrid_io::lacking_memory;

use crate::Error;

/// Refuses `what` if it needs more bytes than are available.
///
/// # Errors
/// [`Error::TooLittleMemory`].
pub(crate) fn check_available(what: &str, needed: u64, remedy: &'static str) -> Result<(), Error> {
    let Some(available) = lacking_memory(needed) else {
        return Ok(());
    };
    let (what, limit) = (what.to_owned(), available.limit.name());
    Err(Error::TooLittleMemory { what, needed, available: available.bytes, limit, remedy })
}
