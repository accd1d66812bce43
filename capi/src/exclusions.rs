use engine::{Exclusions, InputError, Pair};

use crate::input::array;
use crate::out::check;
use crate::status::{Status, guarded, without_detector};
use crate::{Failure, OutPtr};

/// `lazygrid_exclusions`: pairs that are never reported.
#[derive(Debug)]
pub struct ExclusionsHandle(pub Exclusions);

/// Hands a list to C, in the place where it wants it.
///
/// # Safety
/// The header's conditions: `exclusions` is NULL or can be written to.
unsafe fn create(
    exclusions: *mut *mut ExclusionsHandle,
    list: impl FnOnce() -> Result<Exclusions, Failure>,
) -> Status {
    without_detector(|| {
        // SAFETY: this function's own condition.
        let out = unsafe { OutPtr::new(exclusions, "exclusions", std::ptr::null_mut()) }?;
        out.put(Box::into_raw(Box::new(ExclusionsHandle(list()?))));
        Ok(())
    })
}

/// The pairs at `at`.
///
/// # Safety
/// The header's conditions: `at` is NULL or points to `count` pairs, which no thread changes for as long as the result is used.
unsafe fn pairs<'a>(at: *const Pair, count: usize) -> Result<impl Iterator<Item = (u32, u32)> + 'a, Failure> {
    if count > isize::MAX as usize / size_of::<Pair>() {
        return Err(Failure::argument(format!("{count} pairs are more than memory can hold")));
    }
    // SAFETY: `count` pairs by this function's condition, no larger than an `isize`, and any bits are one.
    Ok(unsafe { array(at, count, "pairs") }?.iter().map(|pair| (pair.i, pair.j)))
}

/// A list of pairs of one set.
///
/// # Safety
/// The header's conditions: `pairs` is NULL or points to `count` pairs, `exclusions` is NULL or can be written to.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lazygrid_exclusions_create(
    count_of_spheres: usize,
    pairs_at: *const Pair,
    count: usize,
    exclusions: *mut *mut ExclusionsHandle,
) -> Status {
    // SAFETY: this function's own condition, for both.
    let list = || Ok(Exclusions::new(count_of_spheres, unsafe { pairs(pairs_at, count) }?)?);
    // SAFETY: as above.
    unsafe { create(exclusions, list) }
}

/// A list of pairs of one sphere of each of two sets.
///
/// # Safety
/// The same as [`lazygrid_exclusions_create`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lazygrid_exclusions_across(
    first: usize,
    second: usize,
    pairs_at: *const Pair,
    count: usize,
    exclusions: *mut *mut ExclusionsHandle,
) -> Status {
    let list = || {
        let (first, second) = (first, second);
        // SAFETY: this function's own condition.
        Ok(Exclusions::across(first, second, unsafe { pairs(pairs_at, count) }?)?)
    };
    // SAFETY: this function's own condition.
    unsafe { create(exclusions, list) }
}

/// A list of the pairs of compressed rows.
///
/// # Safety
/// The header's conditions: `offsets` is NULL or points to one more value than there are spheres, `indices` is NULL or points to as
/// many as the last of them says, `exclusions` is NULL or can be written to.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lazygrid_exclusions_from_csr(
    count_of_spheres: usize,
    offsets: *const u64,
    indices: *const u32,
    exclusions: *mut *mut ExclusionsHandle,
) -> Status {
    let list = || {
        if count_of_spheres >= isize::MAX as usize / size_of::<u64>() {
            return Err(InputError::TooManySpheres { count: count_of_spheres as u64 }.into());
        }
        // SAFETY: this number of values by this function's condition, and no larger than an `isize`.
        let offsets = unsafe { array(offsets, count_of_spheres + 1, "offsets") }?;
        let starts: Vec<usize> =
            offsets.iter().map(|&offset| usize::try_from(offset).unwrap_or(usize::MAX)).collect();
        let count = starts.last().copied().unwrap_or(0);
        if count > isize::MAX as usize / size_of::<u32>() {
            return Err(Failure::argument(format!(
                "the last of the offsets is {count}, more than memory can hold; it must be the number of indices"
            )));
        }
        // SAFETY: this number of values by this function's condition, and no larger than an `isize`.
        Ok(Exclusions::from_csr(&starts, unsafe { array(indices, count, "indices") }?)?)
    };
    // SAFETY: this function's own condition.
    unsafe { create(exclusions, list) }
}

/// Frees a list.
///
/// # Safety
/// The header's conditions: `exclusions` is NULL or a list that no thread uses from now on.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lazygrid_exclusions_destroy(exclusions: *mut ExclusionsHandle) {
    guarded(|| {
        if !exclusions.is_null() {
            // SAFETY: `create` made it by `Box::into_raw`, and it is given back once.
            drop(unsafe { Box::from_raw(exclusions) });
        }
        0
    });
}

/// The list at `exclusions`, if there is one.
///
/// # Errors
/// Fails if it is not aligned.
///
/// # Safety
/// The header's conditions: `exclusions` is NULL or a list that is not destroyed for as long as the result lives.
pub unsafe fn borrow<'a>(exclusions: *const ExclusionsHandle) -> Result<Option<&'a Exclusions>, Failure> {
    if exclusions.is_null() {
        return Ok(None);
    }
    check(exclusions, "query.exclusions")?;
    // SAFETY: `create` made it, no thread changes it, and it lives by this function's condition.
    Ok(Some(unsafe { &(*exclusions).0 }))
}
