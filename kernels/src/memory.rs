use crate::Error;

/// Reserves memory for `count` more values, which the error calls `what`.
///
/// # Errors
/// Returns [`Error::OutOfMemory`] if the system refuses the memory.
pub fn try_reserve<T>(buffer: &mut Vec<T>, count: usize, what: &'static str) -> Result<(), Error> {
    let bytes = (buffer.len() as u64).saturating_add(count as u64).saturating_mul(size_of::<T>() as u64);
    buffer.try_reserve(count).map_err(|_| Error::OutOfMemory { what, bytes })
}
