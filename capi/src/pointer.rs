//! Pointers of C as references, after every possible check.

use std::slice;

use crate::Failure;

/// A non-null, aligned pointer to which a result is written.
pub struct OutPtr<T>(*mut T);

impl<T> OutPtr<T> {
    /// Takes `at` and writes `empty` to it, which a failing call leaves there.
    ///
    /// # Errors
    /// If `at` is NULL or not aligned; messages call it `name`.
    ///
    /// # Safety
    /// If `at` is neither, it can be written to for as long as the result lives, and no other code writes to it.
    pub unsafe fn new(at: *mut T, name: &str, empty: T) -> Result<Self, Failure> {
        check(at, name)?;
        let out = Self(at);
        out.put(empty);
        Ok(out)
    }

    pub fn put(&self, value: T) {
        // SAFETY: `new` has checked that the pointer is aligned and not NULL, and requires the rest from its caller. The
        // old value is not dropped, as C may have left it uninitialized.
        unsafe { self.0.write(value) }
    }
}

/// Checks that a pointer is neither NULL nor misaligned.
///
/// # Errors
/// If it is; messages call it `name`.
pub fn check<T>(pointer: *const T, name: &str) -> Result<(), Failure> {
    if pointer.is_null() {
        return Err(Failure::argument(format!("`{name}` is NULL; pass the address of a value")));
    }
    if !pointer.is_aligned() {
        let message = format!("`{name}` is at {pointer:p}; it must be a multiple of {}", align_of::<T>());
        return Err(Failure::argument(message));
    }
    Ok(())
}

/// Returns the `count` values at `at`. Does not read `at` if `count` is 0.
///
/// # Errors
/// If `at` is NULL or not aligned, unless `count` is 0.
///
/// # Safety
/// If `count` is not 0 and `at` is neither NULL nor misaligned: `count` values are there, any bits are a value, no code
/// changes them for as long as the result lives, and they take at most `isize::MAX` bytes.
pub unsafe fn array<'a, T: Copy>(at: *const T, count: usize, name: &str) -> Result<&'a [T], Failure> {
    if count == 0 {
        return Ok(&[]);
    }
    check(at, name)?;
    // SAFETY: not NULL and aligned, as checked above; the rest is this function's condition.
    Ok(unsafe { slice::from_raw_parts(at, count) })
}
