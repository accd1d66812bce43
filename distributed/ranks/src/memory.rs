//! Fallible buffers.

use lazygrid::Error;

pub(crate) fn try_collect<T>(
    count: usize,
    values: impl Iterator<Item = T>,
    what: &'static str,
) -> Result<Vec<T>, Error> {
    let mut all = Vec::new();
    try_reserve(&mut all, count, what)?;
    all.extend(values);
    Ok(all)
}

#[inline]
pub(crate) fn try_push<T>(all: &mut Vec<T>, value: T, what: &'static str) -> Result<(), Error> {
    if all.len() == all.capacity() {
        try_reserve(all, 1, what)?;
    }
    all.push(value);
    Ok(())
}

fn try_reserve<T>(all: &mut Vec<T>, count: usize, what: &'static str) -> Result<(), Error> {
    let bytes = (all.len() as u64).saturating_add(count as u64).saturating_mul(size_of::<T>() as u64);
    all.try_reserve(count).map_err(|_| Error::OutOfMemory { what, bytes })
}
