use engine::{Exclusions, InputError, Pair};

use crate::pointer::{array, check};
use crate::status::{Status, guarded, without_detector};
use crate::{Failure, OutPtr};

/// `lazygrid_exclusions`: pairs that a search never reports.
#[derive(Debug)]
pub struct ExclusionsHandle(pub Exclusions);

/// Creates exclusions and writes their handle to `exclusions`.
///
/// # Safety
/// The header's conditions: `exclusions` is NULL or can be written to.
unsafe fn create(
    exclusions: *mut *mut ExclusionsHandle,
    list: impl FnOnce() -> Result<Exclusions, Failure>,
) -> Status {
    without_detector(|| {
        // SAFETY: by this function's condition.
        let out = unsafe { OutPtr::new(exclusions, "exclusions", std::ptr::null_mut()) }?;
        out.put(Box::into_raw(Box::new(ExclusionsHandle(list()?))));
        Ok(())
    })
}

/// Reads the `count` pairs at `at`.
///
/// # Safety
/// The header's conditions: `at` is NULL or points to `count` pairs, which no thread changes while the result is in use.
unsafe fn pairs<'a>(at: *const Pair, count: usize) -> Result<impl Iterator<Item = (u32, u32)> + 'a, Failure> {
    if count > isize::MAX as usize / size_of::<Pair>() {
        return Err(Failure::argument(format!("{count} pairs are more than memory can hold")));
    }
    // SAFETY: `count` pairs by this function's condition, no larger than an `isize`, and any bits are one.
    Ok(unsafe { array(at, count, "pairs") }?.iter().map(|pair| (pair.i, pair.j)))
}

/// Creates exclusions among one set.
///
/// # Safety
/// The header's conditions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lazygrid_exclusions_create(
    count_of_spheres: usize,
    pairs_at: *const Pair,
    count: usize,
    exclusions: *mut *mut ExclusionsHandle,
) -> Status {
    // SAFETY: by this function's condition.
    let list = || Ok(Exclusions::new(count_of_spheres, unsafe { pairs(pairs_at, count) }?)?);
    // SAFETY: by this function's condition.
    unsafe { create(exclusions, list) }
}

/// Creates exclusions across two sets.
///
/// # Safety
/// The header's conditions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lazygrid_exclusions_across(
    first: usize,
    second: usize,
    pairs_at: *const Pair,
    count: usize,
    exclusions: *mut *mut ExclusionsHandle,
) -> Status {
    // SAFETY: by this function's condition.
    let list = || Ok(Exclusions::across(first, second, unsafe { pairs(pairs_at, count) }?)?);
    // SAFETY: by this function's condition.
    unsafe { create(exclusions, list) }
}

/// Creates exclusions from compressed sparse rows.
///
/// # Safety
/// The header's conditions.
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
        // SAFETY: this number of values is there by this function's condition, and takes at most `isize::MAX` bytes.
        let offsets = unsafe { array(offsets, count_of_spheres + 1, "offsets") }?;
        let mut starts = Vec::new();
        let bytes = size_of_val(offsets) as u64;
        let refused = |_| engine::Error::OutOfMemory { what: "the offsets of exclusions", bytes };
        starts.try_reserve_exact(offsets.len()).map_err(refused)?;
        starts.extend(offsets.iter().map(|&offset| usize::try_from(offset).unwrap_or(usize::MAX)));
        let count = starts.last().copied().unwrap_or(0);
        if count > isize::MAX as usize / size_of::<u32>() {
            return Err(Failure::argument(format!(
                "the last offset is {count}, more indices than memory can hold; it must be the number of indices"
            )));
        }
        // SAFETY: this number of values is there by this function's condition, and takes at most `isize::MAX` bytes.
        Ok(Exclusions::from_csr(&starts, unsafe { array(indices, count, "indices") }?)?)
    };
    // SAFETY: by this function's condition.
    unsafe { create(exclusions, list) }
}

/// Frees exclusions.
///
/// # Safety
/// The header's conditions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lazygrid_exclusions_destroy(exclusions: *mut ExclusionsHandle) {
    guarded(|| {
        if !exclusions.is_null() {
            // SAFETY: `create` made it by `Box::into_raw`, and it is freed once.
            drop(unsafe { Box::from_raw(exclusions) });
        }
        0
    });
}

/// Borrows the exclusions; `None` if NULL.
///
/// # Errors
/// If the pointer is not aligned.
///
/// # Safety
/// The header's conditions: `exclusions` is NULL or exclusions that are not destroyed while the result is in use.
pub unsafe fn borrow<'a>(exclusions: *const ExclusionsHandle) -> Result<Option<&'a Exclusions>, Failure> {
    if exclusions.is_null() {
        return Ok(None);
    }
    check(exclusions, "query.exclusions")?;
    // SAFETY: `create` made it, no thread changes it, and it lives by this function's condition.
    Ok(Some(unsafe { &(*exclusions).0 }))
}
