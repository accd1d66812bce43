use crate::Error;

/// Makes room for so many values behind those that a buffer on the host has. `what` says what they are.
///
/// # Errors
/// [`Error::OutOfMemory`].
pub fn make_room<T>(buffer: &mut Vec<T>, count: usize, what: &'static str) -> Result<(), Error> {
    let bytes = (buffer.len() as u64).saturating_add(count as u64).saturating_mul(size_of::<T>() as u64);
    buffer.try_reserve(count).map_err(|_| Error::OutOfMemory { what, bytes })
}
