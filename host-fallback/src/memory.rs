//! Memory of the size of the input or of the result. All of it is asked for here, so that a refusal is an
//! [`Error::OutOfMemory`] and not the end of the program; `clippy.toml` keeps vectors from growing elsewhere.

#![expect(clippy::disallowed_methods, reason = "here is where room is made first")]

use bytemuck::Zeroable;
use bytemuck::allocation::try_zeroed_vec;

use crate::Error;

/// A growing buffer gets room for one part in this many beyond what is asked for.
const GROWTH_DIVISOR: usize = 8;

/// Values that a buffer which has some grows by at least.
const MIN_GROWTH: usize = 64;
/// Values from which a buffer no longer doubles when it grows one by one.
const MAX_DOUBLING_LEN: usize = 4096;

/// The most bytes that a buffer holds which needs `bytes`.
pub(crate) fn with_growth(bytes: u64) -> u64 {
    bytes + bytes / GROWTH_DIVISOR as u64
}

/// Gives a buffer this length; its values are then of no meaning. `what` says what they are.
///
/// New memory comes zeroed from the system and is not touched here: the threads that write it first also spread the
/// cost of its pages.
///
/// # Errors
/// [`Error::OutOfMemory`]; the buffer is then empty.
pub(crate) fn try_resize<T: Zeroable>(
    buffer: &mut Vec<T>,
    len: usize,
    what: &'static str,
) -> Result<(), Error> {
    if buffer.capacity() < len {
        // A buffer that grows once is likely to grow again, a little, as particles are added step by step.
        let room = if buffer.capacity() == 0 { len } else { len + len / GROWTH_DIVISOR };
        drop(std::mem::take(buffer));
        *buffer = try_zeroed_vec(room).map_err(|()| refused::<T>(room, what))?;
    }
    buffer.resize_with(len, T::zeroed);
    Ok(())
}

/// Reserves memory for `count` values after those that a buffer has.
///
/// # Errors
/// [`Error::OutOfMemory`]; the buffer is then as it was.
pub(crate) fn try_reserve<T>(buffer: &mut Vec<T>, count: usize, what: &'static str) -> Result<(), Error> {
    let needed = buffer.len() + count;
    if buffer.capacity() < needed {
        let grown = |capacity: usize| needed.max(capacity + (capacity / GROWTH_DIVISOR).max(MIN_GROWTH));
        let room = if buffer.capacity() == 0 { needed } else { grown(buffer.capacity()) };
        let refused = |_| refused::<T>(room, what);
        buffer.try_reserve_exact(room - buffer.len()).map_err(refused)?;
    }
    Ok(())
}

/// Appends a value.
///
/// # Errors
/// The same as [`try_reserve`].
#[inline]
pub(crate) fn try_push<T>(buffer: &mut Vec<T>, value: T, what: &'static str) -> Result<(), Error> {
    if buffer.len() == buffer.capacity() {
        grow(buffer, what)?;
    }
    buffer.push(value);
    Ok(())
}

/// Makes room for some values more: twice as many if there are few, else [`GROWTH_DIVISOR`].
#[cold]
fn grow<T>(buffer: &mut Vec<T>, what: &'static str) -> Result<(), Error> {
    let len = buffer.len();
    try_reserve(buffer, if len < MAX_DOUBLING_LEN { len.max(4) } else { len / GROWTH_DIVISOR }, what)
}

/// Appends values.
///
/// # Errors
/// The same as [`try_reserve`].
#[inline]
pub(crate) fn try_extend<T>(
    buffer: &mut Vec<T>,
    values: impl ExactSizeIterator<Item = T>,
    what: &'static str,
) -> Result<(), Error> {
    try_reserve(buffer, values.len(), what)?;
    buffer.extend(values);
    Ok(())
}

/// The values as a vector.
///
/// # Errors
/// [`Error::OutOfMemory`].
pub(crate) fn try_collect<T>(
    values: impl ExactSizeIterator<Item = T>,
    what: &'static str,
) -> Result<Vec<T>, Error> {
    let mut collected = Vec::new();
    try_extend(&mut collected, values, what)?;
    Ok(collected)
}

fn refused<T>(len: usize, what: &'static str) -> Error {
    Error::OutOfMemory { what, bytes: len as u64 * size_of::<T>() as u64 }
}
