//! Fallible allocation of memory whose size depends on input or result; `clippy.toml` forbids growing vectors
//! elsewhere.

#![expect(clippy::disallowed_methods, reason = "memory is reserved first")]

use bytemuck::Zeroable;
use bytemuck::allocation::try_zeroed_vec;

use crate::Error;

/// A full buffer grows by its size divided by this.
const GROWTH_DIVISOR: usize = 8;
const MIN_GROWTH: usize = 64;
/// Buffers double up to this length when they grow value by value.
const MAX_DOUBLING_LEN: usize = 4096;

/// Buffers may have grown once more.
pub(crate) fn with_growth(bytes: u64) -> u64 {
    bytes + bytes / GROWTH_DIVISOR as u64
}

/// Prefetches `values[at]` on x86-64. Ignores an index out of range.
#[inline(always)]
pub(crate) fn prefetch<T>(values: &[T], at: usize) {
    prefetch_address(values.as_ptr().wrapping_add(at).cast());
}

/// The row may lie in two cache lines.
#[inline(always)]
pub(crate) fn prefetch_row<T>(rows: &[[T; 4]], k: usize) {
    prefetch(rows.as_flattened(), 4 * k);
    prefetch(rows.as_flattened(), 4 * k + 3);
}

#[inline(always)]
pub(crate) fn prefetch_address(address: *const u8) {
    #[cfg(target_arch = "x86_64")]
    // SAFETY: every x86-64 processor has SSE; nothing is read or written, and an invalid address is ignored.
    unsafe {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        _mm_prefetch::<_MM_HINT_T0>(address.cast());
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = address;
}

/// Sets the length of a buffer; values are then arbitrary. After an error the buffer is empty.
///
/// New memory comes zeroed from the system and is not written here: threads share its page faults.
pub(crate) fn try_resize<T: Zeroable>(
    buffer: &mut Vec<T>,
    len: usize,
    what: &'static str,
) -> Result<(), Error> {
    if buffer.capacity() < len {
        // A buffer that has grown once often grows again by a little.
        let capacity = if buffer.capacity() == 0 { len } else { len + len / GROWTH_DIVISOR };
        drop(std::mem::take(buffer));
        *buffer = try_zeroed_vec(capacity).map_err(|()| refused::<T>(capacity, what))?;
    }
    buffer.resize_with(len, T::zeroed);
    Ok(())
}

/// After an error the buffer is unchanged.
pub(crate) fn try_reserve<T>(buffer: &mut Vec<T>, count: usize, what: &'static str) -> Result<(), Error> {
    let needed = buffer.len() + count;
    if buffer.capacity() < needed {
        let grown = |capacity: usize| needed.max(capacity + (capacity / GROWTH_DIVISOR).max(MIN_GROWTH));
        let capacity = if buffer.capacity() == 0 { needed } else { grown(buffer.capacity()) };
        let refused = |_| refused::<T>(capacity, what);
        buffer.try_reserve_exact(capacity - buffer.len()).map_err(refused)?;
    }
    Ok(())
}

#[inline]
pub(crate) fn try_push<T>(buffer: &mut Vec<T>, value: T, what: &'static str) -> Result<(), Error> {
    if buffer.len() == buffer.capacity() {
        grow(buffer, what)?;
    }
    buffer.push(value);
    Ok(())
}

#[cold]
fn grow<T>(buffer: &mut Vec<T>, what: &'static str) -> Result<(), Error> {
    let len = buffer.len();
    try_reserve(buffer, if len < MAX_DOUBLING_LEN { len.max(4) } else { len / GROWTH_DIVISOR }, what)
}

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
