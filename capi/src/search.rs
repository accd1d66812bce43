use std::cell::Cell;
use std::ffi::c_void;
use std::ops::ControlFlow;
use std::ptr;

use engine::{Error, Neighbors, Pair};

use crate::detector::{DetectorHandle, HandleState, with_detector};
use crate::input::{self, CQuery};
use crate::status::{BUSY, Status};
use crate::{Failure, OutPtr};

thread_local! {
    /// `true` while this thread runs a callback.
    static IN_CALLBACK: Cell<bool> = const { Cell::new(false) };
}

/// Runs a search, unless this thread runs a callback: other pool threads may wait for the callback to return, and a
/// search with any detector would wait for them.
///
/// # Safety
/// The conditions of [`with_detector`].
pub unsafe fn search(
    detector: *const DetectorHandle,
    work: impl FnOnce(&mut HandleState) -> Result<(), Failure>,
) -> Status {
    if IN_CALLBACK.get() {
        return BUSY;
    }
    // SAFETY: by this function's condition.
    unsafe { with_detector(detector, work) }
}

/// Finds the overlapping pairs of one set, or across two sets.
///
/// # Safety
/// The header's conditions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lazygrid_pairs(
    detector: *mut DetectorHandle,
    query: *const CQuery,
    pairs: *mut *const Pair,
    count: *mut u64,
) -> Status {
    // SAFETY: by this function's condition.
    let (pairs, count) =
        unsafe { (OutPtr::new(pairs, "pairs", ptr::null()), OutPtr::new(count, "count", 0)) };
    let work = |state: &mut HandleState| {
        let (pairs, count) = (pairs?, count?);
        // SAFETY: by this function's condition.
        let query = unsafe { input::borrow(query) }?;
        put_pairs(state.detector.pairs(query), &pairs, &count)
    };
    // SAFETY: by this function's condition.
    unsafe { search(detector, work) }
}

/// Writes the address and the number of the pairs; if there are too many, only their number.
fn put_pairs(
    found: Result<&[Pair], Error>,
    pairs: &OutPtr<*const Pair>,
    count: &OutPtr<u64>,
) -> Result<(), Failure> {
    let found = found.inspect_err(|error| {
        if let Error::TooManyPairs { found, .. } = error {
            count.put(*found);
        }
    })?;
    pairs.put(found.as_ptr());
    count.put(found.len() as u64);
    Ok(())
}

/// Counts the pairs.
///
/// # Safety
/// The header's conditions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lazygrid_count(
    detector: *mut DetectorHandle,
    query: *const CQuery,
    count: *mut u64,
) -> Status {
    // SAFETY: by this function's condition.
    let count = unsafe { OutPtr::new(count, "count", 0) };
    let work = |state: &mut HandleState| {
        let count = count?;
        // SAFETY: by this function's condition.
        let query = unsafe { input::borrow(query) }?;
        count.put(state.detector.count(query)?);
        Ok(())
    };
    // SAFETY: by this function's condition.
    unsafe { search(detector, work) }
}

/// Finds the pairs as neighbor lists.
///
/// # Safety
/// The header's conditions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lazygrid_neighbors(
    detector: *mut DetectorHandle,
    query: *const CQuery,
    offsets: *mut *const u64,
    indices: *mut *const u32,
) -> Status {
    // SAFETY: by this function's condition.
    let (offsets, indices) = unsafe {
        (OutPtr::new(offsets, "offsets", ptr::null()), OutPtr::new(indices, "indices", ptr::null()))
    };
    let work = |state: &mut HandleState| {
        let (offsets, indices) = (offsets?, indices?);
        // SAFETY: by this function's condition.
        let query = unsafe { input::borrow(query) }?;
        let HandleState { detector, found, .. } = state;
        put_lists(detector.neighbors(query), found, &offsets, &indices)
    };
    // SAFETY: by this function's condition.
    unsafe { search(detector, work) }
}

/// Writes the addresses of the lists; if there are too many pairs, that of their number.
fn put_lists(
    lists: Result<Neighbors<'_>, Error>,
    found: &mut u64,
    offsets: &OutPtr<*const u64>,
    indices: &OutPtr<*const u32>,
) -> Result<(), Failure> {
    let lists = lists.inspect_err(|error| {
        if let Error::TooManyPairs { found: pairs, .. } = error {
            *found = *pairs;
            offsets.put(ptr::from_ref(found));
        }
    })?;
    offsets.put(lists.offsets().as_ptr());
    indices.put(lists.indices().as_ptr());
    Ok(())
}

/// `lazygrid_pair_callback`: receives pairs and returns 0 to continue.
pub type PairCallback = unsafe extern "C" fn(context: *mut c_void, pairs: *const Pair, count: usize) -> i32;

struct Consumer {
    consume: PairCallback,
    context: *mut c_void,
}

// SAFETY: by the header, the library calls the callback, with its context, from other threads than the caller's, and the
// caller allows that. The pointer is only passed on.
unsafe impl Send for Consumer {}

impl Consumer {
    /// Refuses a `consume` of NULL and a `chunk` of 0.
    fn new(consume: Option<PairCallback>, context: *mut c_void, chunk: usize) -> Result<Self, Failure> {
        let consume = consume.ok_or_else(|| Failure::argument("`consume` is NULL; pass a function"))?;
        if chunk == 0 {
            return Err(Failure::argument("`chunk` is 0; it must be at least 1"));
        }
        Ok(Self { consume, context })
    }

    fn take(&mut self, pairs: &[Pair]) -> ControlFlow<()> {
        IN_CALLBACK.set(true);
        // SAFETY: a function of this type by the header. The pairs live until it returns.
        let answer = unsafe { (self.consume)(self.context, pairs.as_ptr(), pairs.len()) };
        IN_CALLBACK.set(false);
        match answer {
            0 => ControlFlow::Continue(()),
            _ => ControlFlow::Break(()),
        }
    }
}

/// Passes the pairs to a callback in chunks.
///
/// # Safety
/// The header's conditions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lazygrid_stream(
    detector: *mut DetectorHandle,
    query: *const CQuery,
    chunk: usize,
    consume: Option<PairCallback>,
    context: *mut c_void,
    delivered: *mut u64,
) -> Status {
    // SAFETY: by this function's condition.
    let delivered = unsafe { OutPtr::new(delivered, "delivered", 0) };
    let work = |state: &mut HandleState| {
        let delivered = delivered?;
        // SAFETY: by this function's condition.
        let query = unsafe { input::borrow(query) }?;
        let mut consumer = Consumer::new(consume, context, chunk)?;
        delivered.put(state.detector.stream(query, chunk, move |pairs| consumer.take(pairs))?);
        Ok(())
    };
    // SAFETY: by this function's condition.
    unsafe { search(detector, work) }
}
