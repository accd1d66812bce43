use std::ptr;

use engine::{Error, ListOptions, NeighborList, Pair};

use crate::detector::{DetectorHandle, HandleState};
use crate::input::{self, CQuery};
use crate::search::search;
use crate::status::Status;
use crate::{Failure, OutPtr};

/// `lazygrid_list`: a neighbor list with geometry.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct CNeighborList {
    pub length: u64,
    pub offsets: *const u64,
    pub pairs: *const Pair,
    pub shifts: *const [i32; 3],
    pub vectors: *const [f64; 3],
    pub distances: *const f64,
}

/// Options by their names in the header, and their bits.
pub const OPTIONS: [(&str, u32); 6] =
    [("HALF", 1), ("OPEN", 2), ("SELF", 4), ("SHIFTS", 8), ("VECTORS", 16), ("DISTANCES", 32)];

fn options(bits: u32) -> Result<ListOptions, Failure> {
    let known = OPTIONS.iter().fold(0, |known, (_, bit)| known | bit);
    if bits & !known != 0 {
        return Err(Failure::argument(format!(
            "the options are {bits}; combine the bits of LAZYGRID_LIST_..., which are {known} together"
        )));
    }
    let has = |name: &str| OPTIONS.iter().any(|(other, bit)| *other == name && bits & bit != 0);
    let mut options = if has("HALF") { ListOptions::half() } else { ListOptions::full() };
    for (name, set) in [
        ("OPEN", ListOptions::open as fn(ListOptions) -> ListOptions),
        ("SELF", ListOptions::with_self),
        ("SHIFTS", ListOptions::shifts),
        ("VECTORS", ListOptions::vectors),
        ("DISTANCES", ListOptions::distances),
    ] {
        if has(name) {
            options = set(options);
        }
    }
    Ok(options)
}

impl CNeighborList {
    const EMPTY: Self = Self {
        length: 0,
        offsets: ptr::null(),
        pairs: ptr::null(),
        shifts: ptr::null(),
        vectors: ptr::null(),
        distances: ptr::null(),
    };

    fn new(list: &NeighborList<'_>, options: u32) -> Self {
        fn requested<T>(values: &[T], is_requested: bool) -> *const T {
            if is_requested { values.as_ptr() } else { ptr::null() }
        }
        let [.., (_, shifts), (_, vectors), (_, distances)] = OPTIONS;
        Self {
            length: list.len() as u64,
            offsets: list.offsets().as_ptr(),
            pairs: list.pairs().as_ptr(),
            shifts: requested(list.shifts(), options & shifts != 0),
            vectors: requested(list.vectors(), options & vectors != 0),
            distances: requested(list.distances(), options & distances != 0),
        }
    }
}

/// Finds the neighbor list of a query, with geometry.
///
/// # Safety
/// The header's conditions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lazygrid_neighbor_list(
    detector: *mut DetectorHandle,
    query: *const CQuery,
    options_of_list: u32,
    list: *mut CNeighborList,
) -> Status {
    // SAFETY: by this function's condition.
    let list = unsafe { OutPtr::new(list, "list", CNeighborList::EMPTY) };
    let work = |state: &mut HandleState| {
        let (list, options) = (list?, options(options_of_list)?);
        // SAFETY: by this function's condition.
        let query = unsafe { input::borrow(query) }?;
        let found = state.detector.neighbor_list(query, options).inspect_err(|error| {
            if let Error::TooManyPairs { found, .. } = error {
                list.put(CNeighborList { length: *found, ..CNeighborList::EMPTY });
            }
        })?;
        list.put(CNeighborList::new(&found, options_of_list));
        Ok(())
    };
    // SAFETY: by this function's condition.
    unsafe { search(detector, work) }
}
