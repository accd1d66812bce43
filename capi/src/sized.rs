use std::mem::MaybeUninit;
use std::{ptr, slice};

use crate::Failure;
use crate::pointer::check;

/// Largest accepted size of a structure in bytes. A larger value is uninitialized memory.
const MAX_SIZE: usize = 1 << 16;

/// A C structure that begins with its own size, and to which later versions append fields.
///
/// # Safety
/// The first field is the size, a `usize`, and any bits, zeros too, are values of all fields.
pub unsafe trait VersionedStruct: Copy {
    /// Size of the first version.
    const FIRST_SIZE: usize;
    /// Expression by which a program sets the size.
    const REMEDY: &'static str;
}

/// Copies a structure of a program that may know fewer fields, which are then 0, or more than this library.
///
/// # Errors
/// If `at` is NULL or misaligned, if the size is wrong, or if a field that this library does not know is set.
///
/// # Safety
/// The header's conditions: `at` is NULL, or points to a structure that begins with its size and is initialized.
pub unsafe fn read<T: VersionedStruct>(at: *const T, name: &str) -> Result<T, Failure> {
    check(at, name)?;
    // SAFETY: a size is there, by this function's condition; NULL and misaligned pointers were refused.
    let size = unsafe { at.cast::<usize>().read() };
    let known = size_of::<T>();
    if size == known {
        // SAFETY: as many bytes are there, by this function's condition, and any bits are a value by that of the trait.
        return Ok(unsafe { at.read() });
    }
    let (first, remedy) = (T::FIRST_SIZE, T::REMEDY);
    if !(first..=MAX_SIZE).contains(&size) {
        let message = format!("{name}.size is {size}; it must be {first} to {MAX_SIZE}: {remedy}");
        return Err(Failure::argument(message));
    }
    if size > known {
        // SAFETY: `size` initialized bytes are there, by this function's condition.
        let newer = unsafe { slice::from_raw_parts(at.cast::<u8>().add(known), size - known) };
        if newer.iter().any(|byte| *byte != 0) {
            return Err(Failure::argument(format!(
                "{name} has {size} bytes of which this library knows {known}, and one of the others is set; take the \
                 library of the header's version"
            )));
        }
    }
    let mut read = MaybeUninit::<T>::zeroed();
    // SAFETY: both have as many bytes, and they do not overlap. Any bits are a value by the trait's condition.
    Ok(unsafe {
        ptr::copy_nonoverlapping(at.cast::<u8>(), read.as_mut_ptr().cast::<u8>(), size.min(known));
        read.assume_init()
    })
}
