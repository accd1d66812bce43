use std::marker::PhantomData;
use std::sync::atomic::AtomicU32;

use crate::{Error, memory};

/// A slice that several threads write, each element by one thread only.
pub(crate) struct DisjointSlice<'a, T> {
    start: *mut T,
    len: usize,
    slice: PhantomData<&'a mut [T]>,
}

// SAFETY: the only access is `write`, whose caller promises that no two threads write one element; values move to other
// threads, hence `T: Send`.
unsafe impl<T: Send> Sync for DisjointSlice<'_, T> {}

impl<'a, T: Copy> DisjointSlice<'a, T> {
    pub(crate) fn new(slice: &'a mut [T]) -> Self {
        Self { start: slice.as_mut_ptr(), len: slice.len(), slice: PhantomData }
    }

    /// # Safety
    /// `at` must be below the slice's length, and no other thread may write `at` while `self` lives.
    #[inline(always)]
    pub(crate) unsafe fn write(&self, at: usize, value: T) {
        debug_assert!(at < self.len);
        // SAFETY: inside the slice and without concurrent access, by the caller's promise.
        unsafe { self.start.add(at).write(value) };
    }
}

pub(crate) fn shared(numbers: &mut [u32]) -> &[AtomicU32] {
    let len = numbers.len();
    const { assert!(align_of::<AtomicU32>() == align_of::<u32>()) };
    // SAFETY: an `AtomicU32` has the size and values of a `u32`, and here its alignment; `numbers` is borrowed exclusively
    // while the result lives.
    unsafe { std::slice::from_raw_parts(numbers.as_mut_ptr().cast(), len) }
}

/// The last of the ascending `ends` is the slice's length.
pub(crate) fn split_at<T>(
    mut slice: &mut [T],
    ends: impl ExactSizeIterator<Item = usize>,
) -> Result<Vec<&mut [T]>, Error> {
    let mut from = 0;
    let cut = |end: usize| {
        let (head, tail) = std::mem::take(&mut slice).split_at_mut(end - from);
        (slice, from) = (tail, end);
        head
    };
    memory::try_collect(ends.map(cut), "parts of a buffer")
}

/// Moves the `filled` ranges (start, length) together.
pub(crate) fn close_gaps<T: Copy>(values: &mut Vec<T>, filled: impl Iterator<Item = (usize, usize)>) {
    let mut end = 0;
    for (start, count) in filled {
        if start != end {
            values.copy_within(start..start + count, end);
        }
        end += count;
    }
    values.truncate(end);
}
