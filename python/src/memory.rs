//! Fallible allocation of memory whose size depends on the input.

use lazygrid::Error;

/// Collects values that `what` names in the error.
pub(crate) fn try_collect<T>(
    values: impl ExactSizeIterator<Item = T>,
    what: &'static str,
) -> Result<Vec<T>, Error> {
    let mut all = Vec::new();
    let bytes = (values.len() * size_of::<T>()) as u64;
    all.try_reserve_exact(values.len()).map_err(|_| Error::OutOfMemory { what, bytes })?;
    all.extend(values);
    Ok(all)
}
