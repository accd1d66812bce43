use crate::Error;

/// Reserves memory for `count` values after those that a buffer has. `what` names them in the error.
///
/// # Errors
/// [`Error::OutOfMemory`].
pub fn try_reserve<T>(buffer: &mut Vec<T>, count: usize, what: &'static str) -> Result<(), Error> {
    let bytes = (buffer.len() as u64).saturating_add(count as u64).saturating_mul(size_of::<T>() as u64);
    buffer.try_reserve(count).map_err(|_| Error::OutOfMemory { what, bytes })
}
