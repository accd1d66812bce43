//! Checks of single kernels, each against a plain sequential function.

use std::fmt::Debug;

use lazygrid::Error;
use lazygrid::gpu::GpuDevice;
use lazygrid_kernels::kernel::Variant;
use thiserror::Error;

use crate::{Effort, axes, calls, grid, homes, list, nested, primitives, runs, shares, skin};

/// Numbers of spheres: around the size of a workgroup, and many workgroups.
pub(crate) const SIZES: [usize; 7] = [0, 1, 255, 256, 257, 1023, 20_000];

/// The failure of a check.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum KernelError {
    /// A result differs from the expected one.
    #[error("{0}")]
    WrongResult(String),
    /// The device failed.
    #[error(transparent)]
    Device(#[from] Error),
}

/// A check of one or more kernels.
#[derive(Clone, Copy, Debug)]
pub struct KernelCheck {
    /// The name of the check.
    pub name: &'static str,
    /// The names of the checked kernels.
    pub kernels: &'static [&'static str],
    /// The function that runs the check.
    pub run: Run,
}

const fn one(name: &'static str, kernels: &'static [&'static str], run: Run) -> KernelCheck {
    KernelCheck { name, kernels, run }
}

/// A check function.
pub type Run = fn(&GpuDevice, Effort) -> Result<(), KernelError>;

/// All checks, in the order in which a call runs the kernels.
pub const CHECKS: [KernelCheck; 34] = [
    one("start of a call", &["call_begin"], |own, _| calls::call_begin(own)),
    one("wrapped coordinates", &["spheres_wrap"], |own, _| calls::spheres_wrap(own)),
    one("bounds", &["bounds_reduce"], |own, _| calls::bounds_reduce(own)),
    one("grid", &["grid_configure"], |own, _| grid::grid_configure(own)),
    one("occupancy table", &["density_clear"], |own, _| nested::density_clear(own)),
    one("cells", &["cells_find"], |own, _| nested::cells_find(own)),
    one("deeper levels", &["levels_refine"], |own, _| nested::levels_refine(own)),
    one("keys of levels", &["levels_settle"], |own, _| nested::levels_settle(own)),
    one("entries", &["entries_emit"], |own, _| nested::entries_emit(own)),
    one("number of entries", &["entries_close"], |own, _| calls::entries_close(own)),
    one("prefix scan", &["scan_reduce", "scan_spine", "scan_spread"], |own, effort| {
        sizes(effort).try_for_each(|size| primitives::scan(own, size))
    }),
    one("prefix scan of few values", &["scan_once"], |own, _| primitives::scan_once(own)),
    one("radix sort", &["radix_count", "radix_scan", "radix_scatter"], |own, effort| {
        sizes(effort).try_for_each(|size| primitives::sort(own, size))
    }),
    one("size classes and bounds", &["spheres_survey"], |own, _| list::spheres_survey(own)),
    one("cells of a cell list", &["list_configure"], |own, effort| {
        homes::list_configure(own)?;
        axes::cells_along_axes(own, effort)
    }),
    one("cells of few spheres", &["list_begin"], |own, _| list::list_begin(own)),
    one("occupancy of the first cells", &["density_count"], |own, _| homes::density_count(own)),
    one("cells and ranks", &["homes_count"], |own, _| homes::homes_count(own)),
    one("cells as sort keys", &["homes_key"], |own, _| homes::homes_key(own)),
    one("starts of cells", &["cells_index"], |own, _| list::cells_index(own)),
    one("spheres in cell order", &["spheres_place", "spheres_gather"], |own, _| list::spheres_place(own)),
    one("first candidates", &["list_search"], |own, _| shares::list_search(own)),
    one("dispatch of the search of further candidates", &["shares_open"], |own, _| shares::shares_open(own)),
    one("further candidates", &["shares_search"], |own, _| shares::shares_search(own)),
    one("near pairs in runs", &["runs_search"], |own, _| runs::runs_search(own)),
    one("dispatch of the search of far pairs in runs", &["crowded_open"], |own, _| calls::crowded_open(own)),
    one("far pairs in runs", &["crowded_search"], |own, _| runs::crowded_search(own)),
    one("displacements", &["skin_measure"], |own, _| skin::skin_measure(own)),
    one("rebuild of the candidate list", &["skin_decide"], |own, _| skin::skin_decide(own)),
    one("reference positions", &["skin_keep"], |own, _| skin::skin_keep(own)),
    one("dispatch of the candidate test", &["candidates_open"], |own, _| skin::candidates_open(own)),
    one("pairs among candidates", &["candidates_test"], |own, _| skin::candidates_test(own)),
    one("all pairs", &["naive_search"], |own, _| calls::naive_search(own)),
    one("outcome", &["outcome_finish"], |own, _| calls::outcome_finish(own)),
];

fn sizes(effort: Effort) -> impl Iterator<Item = usize> {
    let most = if effort == Effort::Quick { 5000 } else { usize::MAX };
    let large = (effort == Effort::Full).then_some(1 << 24);
    primitives::SIZES.into_iter().filter(move |size| *size < most).chain(large)
}

/// The default variants without and, if the device supports them, with subgroup operations.
pub(crate) fn variants(own: &GpuDevice) -> impl Iterator<Item = Variant> {
    let smallest = own.adapter.has_subgroups.then_some(own.adapter.subgroup_sizes[0]);
    let subgroups = smallest.filter(|&size| size >= 4);
    let with = move |subgroups| Variant { subgroups, ..Variant::default() };
    [None, subgroups].into_iter().take(1 + usize::from(subgroups.is_some())).map(with)
}

/// Maps a float to an unsigned integer with the same order.
pub(crate) fn ordered(x: f32) -> u32 {
    if x.is_sign_negative() { !x.to_bits() } else { x.to_bits() | 1 << 31 }
}

/// Compares a result with the expected one.
pub(crate) fn same<T: PartialEq + Debug>(
    case: impl FnOnce() -> String,
    found: &T,
    expected: &T,
) -> Result<(), KernelError> {
    if found == expected {
        return Ok(());
    }
    let short = |value: &T| {
        let text = format!("{value:?}");
        match text.char_indices().nth(200) {
            Some((end, _)) => format!("{}…", &text[..end]),
            None => text,
        }
    };
    Err(KernelError::WrongResult(format!("{}: {} instead of {}", case(), short(found), short(expected))))
}

#[cfg(test)]
mod tests {
    use lazygrid_kernels::kernel::KERNELS;

    use super::*;

    #[test]
    fn each_kernel_has_one_check() {
        let mut checked: Vec<&str> = CHECKS.iter().flat_map(|check| check.kernels).copied().collect();
        let mut all: Vec<&str> = KERNELS.iter().map(|kernel| kernel.name).collect();
        checked.sort_unstable();
        all.sort_unstable();
        assert_eq!(checked, all);
    }

    #[test]
    fn long_differences_are_shortened() {
        assert_eq!(same(|| "one".to_owned(), &1, &1), Ok(()));
        let fault = same(|| "many".to_owned(), &vec![7; 1000], &vec![8; 1000]).expect_err("they differ");
        let text = fault.to_string();
        assert!(text.starts_with("many: [7, 7") && text.contains("instead of [8, 8") && text.len() < 500);
    }
}
