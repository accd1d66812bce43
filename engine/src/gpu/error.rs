use crate::Error;

/// Makes room for so many values behind those that a buffer on the host has.
///
/// # Errors
/// [`Error::OutOfMemory`].
pub(super) fn make_room<T>(buffer: &mut Vec<T>, count: usize, what: &'static str) -> Result<(), Error> {
    let bytes = (buffer.len() + count) as u64 * size_of::<T>() as u64;
    buffer.try_reserve(count).map_err(|_| Error::OutOfMemory { what, bytes })
}
