//! Division of long searches into dispatches that end before a driver's watchdog acts.
//!
//! # Correctness
//!
//! 1. A divided kernel derives its work only from the number of its workgroup, plus
//!    [`SearchParams::first_workgroup`](lazygrid_kernels::layout::SearchParams::first_workgroup).
//! 2. A part begins where its predecessor ends.
//! 3. A part has at most one row: a dispatch of several rows may have more workgroups than requested, which would
//!    belong to the next part.

use std::time::Duration;

use lazygrid_kernels::kernel as k;
use lazygrid_kernels::layout::SearchParams;

use super::dispatches::Dispatch;

/// A tenth of the shortest watchdog of a driver (2 s on Windows).
pub(crate) const MAX_DISPATCH_TIME: Duration = Duration::from_millis(200);

pub(crate) fn tests_within_limit(tests_per_second: f64) -> u64 {
    ((tests_per_second * MAX_DISPATCH_TIME.as_secs_f64()) as u64).max(1)
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct WorkBudget {
    /// Maximum number of distance tests per dispatch, unless a single workgroup has more.
    pub(crate) tests: u64,
    pub(crate) row: u32,
}

impl WorkBudget {
    pub(crate) fn groups_per_dispatch(&self, groups: u32, tests_per_group: u64) -> u32 {
        let fitting = self.tests / tests_per_group.max(1);
        match fitting >= groups.into() {
            true => groups,
            false => fitting.clamp(1, self.row.max(1).into()) as u32,
        }
    }

    pub(crate) fn divide(&self, dispatch: Dispatch, tests_per_group: u64) -> impl Iterator<Item = Dispatch> {
        let groups = dispatch.groups;
        let step = self.groups_per_dispatch(groups, tests_per_group).max(1);
        (0..groups).step_by(step as usize).map(move |first| Dispatch {
            groups: step.min(groups - first),
            first_group: first,
            ..dispatch.clone()
        })
    }

    pub(crate) fn tiles(&self) -> u32 {
        let tile = u64::from(k::WORKGROUP_SIZE).pow(2);
        u32::try_from((self.tests / tile).max(1)).unwrap_or(SearchParams::UNLIMITED)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::plan::GpuPhase;

    fn divided(groups: u32, tests_per_group: u64, budget: WorkBudget) -> Vec<(u32, u32)> {
        let whole = Dispatch::new(&k::NAIVE_SEARCH, groups, GpuPhase::Search);
        budget.divide(whole, tests_per_group).map(|part| (part.first_group, part.groups)).collect()
    }

    #[test]
    fn parts_cover_each_workgroup_once_within_the_budget() {
        for groups in [0, 1, 2, 7, 100, 65_535, 65_536, 1_000_000] {
            for tests_per_group in [1, 10, 65_536] {
                for tests in [1, 9, 100, 1 << 20, u64::MAX] {
                    let budget = WorkBudget { tests, row: 65_535 };
                    let parts = divided(groups, tests_per_group, budget);
                    let mut next = 0;
                    for &(first, count) in &parts {
                        assert_eq!(first, next);
                        let is_within = u64::from(count) * tests_per_group <= tests || count == 1;
                        assert!(is_within, "{count} × {tests_per_group} tests of {tests}");
                        assert!(parts.len() == 1 || count <= budget.row, "{count} workgroups");
                        next += count;
                    }
                    assert_eq!(next, groups);
                }
            }
        }
    }

    #[test]
    fn work_within_the_budget_is_one_dispatch() {
        let budget = WorkBudget { tests: 1000, row: 10 };
        assert_eq!(divided(100, 10, budget), [(0, 100)]);
        assert_eq!(divided(101, 10, budget).len(), 11);
        assert_eq!(divided(3, 5000, budget), [(0, 1), (1, 1), (2, 1)]);
    }

    #[test]
    fn budgets_follow_the_rate() {
        assert_eq!(tests_within_limit(1e10), 2_000_000_000);
        assert_eq!(tests_within_limit(0.0), 1);
        assert_eq!(tests_within_limit(f64::INFINITY), u64::MAX);
        let tiles = |tests| WorkBudget { tests, row: 1 }.tiles();
        assert_eq!([1, 65_536, 1 << 20].map(tiles), [1, 1, 16]);
        assert_eq!(tiles(u64::MAX), SearchParams::UNLIMITED);
    }
}
