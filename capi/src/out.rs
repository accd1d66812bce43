use crate::Failure;

/// A place where the caller wants a value.
pub struct OutPtr<T>(*mut T);

impl<T> OutPtr<T> {
    /// The place `at`, which holds `empty` from now on, so that a call that fails leaves that.
    ///
    /// # Errors
    /// Fails if `at` is NULL or not aligned; `name` is its name in the message.
    ///
    /// # Safety
    /// If `at` is neither, it can be written to for as long as the result lives, and nobody else does.
    pub unsafe fn new(at: *mut T, name: &str, empty: T) -> Result<Self, Failure> {
        check(at, name)?;
        let out = Self(at);
        out.put(empty);
        Ok(out)
    }

    /// Writes `value`.
    pub fn put(&self, value: T) {
        // SAFETY: `new` has seen that the place is aligned and not NULL, and asks its caller for the rest. What was
        // there is not dropped: C may have left it without a value.
        unsafe { self.0.write(value) }
    }
}

/// Whether a pointer can be followed, as far as it shows.
///
/// # Errors
/// Fails if it is NULL or not aligned.
pub fn check<T>(pointer: *const T, name: &str) -> Result<(), Failure> {
    if pointer.is_null() {
        return Err(Failure::argument(format!("`{name}` is NULL; it must point to what is asked for")));
    }
    if !pointer.is_aligned() {
        let message = format!("`{name}` is at {pointer:p}; it must be a multiple of {}", align_of::<T>());
        return Err(Failure::argument(message));
    }
    Ok(())
}
