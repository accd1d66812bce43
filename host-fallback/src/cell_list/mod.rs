//! Hierarchical cell list: every sphere is in the cell of its center, at the level of its size.
//!
//! All levels are sorted together, coarse ones first. Each sphere searches the cells around it for later spheres at its
//! own level and for all at coarser ones. So a pair is found once, from its finer or, within a level, earlier sphere.
//!
//! Groups of spheres, such as two sets or species with the same partners, have separate levels. Of two levels whose
//! groups pair, one searches the other. A group that pairs much farther with others than within itself may have grids
//! for its own distances; others search these with larger radii.

mod density;
mod density_cache;
mod grid;
mod group_members;
mod levels;
mod search;
mod sort;
#[cfg(test)]
mod tests;

use std::ops::Range;

use crate::compare::{Columns, Output, PairTest, SimdWidth};
use crate::input::{CenterBounds, Grouping, SearchInput, SizeClass};
use crate::memory::{try_push, with_growth};
use crate::report::Report;
use crate::size_class::SIZE_CLASSES;
use crate::{Error, InputStats};
pub(crate) use density::DensityProfile;
pub(crate) use density_cache::DensityCache;
use grid::CellGrid;
use group_members::GroupMembers;
pub(crate) use levels::LevelPlan;
use levels::{CELLS_PER_SPHERE, MAX_LEVELS};
pub(crate) use sort::SortRecord;
use sort::Sorter;

const MAX_CELLS_PER_LEVEL: u64 = 1 << 26;
/// Far more than the rounding of a sum of two radii.
const SUM_ROUNDING: f64 = 1.0 / (1 << 21) as f64;
/// Factors on the planned cell size that avoid a slower, folded table.
const SIZE_FACTORS: [f64; 5] = [1.0, 1.04, 1.08, 1.13, 1.2];

#[derive(Debug, Default)]
pub(crate) struct CellList {
    levels: Vec<LevelGrid>,
    columns: Columns,
    starts: Vec<u32>,
    targets: Vec<Target>,
    members: Vec<GroupMembers>,
    groups: Vec<GroupLevels>,
    touch_decides: bool,
    sorter: Sorter,
    plan: Option<CachedPlan>,
    /// Estimated nanoseconds of a search.
    time: f32,
}

#[derive(Clone, Copy, Debug)]
struct GroupLevels {
    first: usize,
    of_class: [u8; SIZE_CLASSES],
}

#[derive(Debug)]
struct CachedPlan {
    classes: [SizeClass; SIZE_CLASSES],
    density: DensityProfile,
    levels: LevelPlan,
}

impl CachedPlan {
    fn from_last(last: Option<Self>, stats: &InputStats, density: &DensityProfile) -> Self {
        match last {
            Some(last) if last.classes == stats.classes && last.density == *density => last,
            _ => {
                let levels = LevelPlan::plan(stats, density);
                Self { classes: stats.classes, density: density.clone(), levels }
            }
        }
    }
}

#[derive(Clone, Debug)]
struct LevelGrid {
    grid: CellGrid,
    /// Cells of earlier levels.
    base: usize,
    group: usize,
    members: Range<usize>,
    /// Largest effective radius; the grid is for radii within the group.
    effective: f32,
    pairs_within: bool,
    targets: Range<usize>,
}

/// Spheres search a level with their own radius plus `excess`, at most `cap`.
#[derive(Clone, Copy, Debug)]
struct SearchRadius {
    /// Effective radii may exceed the grid's largest radius by this.
    excess: f32,
    /// Largest distance of a pair, less the grid's largest radius.
    cap: f32,
}

impl SearchRadius {
    #[inline(always)]
    fn for_radius(self, radius: f32) -> f32 {
        (radius + self.excess).min(self.cap)
    }
}

#[derive(Clone, Copy, Debug)]
struct Target {
    level: usize,
    radius: SearchRadius,
}

impl LevelGrid {
    fn own_radius(&self) -> SearchRadius {
        SearchRadius { excess: 0.0, cap: self.grid.largest() }
    }

    /// `search_cutoff` is the largest distance of a candidate.
    fn search_of(&self, other: &Self, search_cutoff: f64) -> (SearchRadius, f64) {
        let largest = f64::from(other.grid.largest());
        let (excess, cap) = match self.group == other.group {
            true => (0.0, (search_cutoff - largest).min(f64::from(self.grid.largest()))),
            false => (f64::from(other.effective) - largest, search_cutoff - largest),
        };
        let most = f64::from(self.effective) + excess;
        let rounding = if excess > 0.0 { SUM_ROUNDING * most } else { 0.0 };
        let radius = SearchRadius { excess: (excess + rounding) as f32, cap: (cap as f32).next_up() };
        (radius, self.members.len() as f64 * other.grid.rows_around(most.min(cap)))
    }
}

#[derive(Clone, Copy)]
struct CellLocator<'p> {
    test: &'p PairTest<'p>,
    levels: &'p [LevelGrid],
    groups: &'p [GroupLevels],
    grouping: Grouping<'p>,
}

impl CellLocator<'_> {
    fn cells(&self) -> usize {
        self.levels.last().map_or(0, |level| level.base + level.grid.cells() as usize)
    }

    #[inline(always)]
    fn cell_of<V: SimdWidth>(&self, vector: V, id: usize, [x, y, z, radius]: [f32; 4]) -> u32 {
        let level = match self.levels {
            [only] => only,
            levels => {
                let GroupLevels { first, of_class } = &self.groups[self.grouping.group_of(id)];
                let radius = self.grouping.radius(self.test, id, radius);
                &levels[first + usize::from(of_class[InputStats::class_of(radius)])]
            }
        };
        (level.base + level.grid.index(level.grid.cell_of(vector, [x, y, z]))) as u32
    }
}

/// With this limit, 32 bits number the cells of all levels.
fn max_cells(levels: usize) -> u64 {
    MAX_CELLS_PER_LEVEL.min(u64::from(u32::MAX) / levels.max(1) as u64)
}

impl CellList {
    pub(crate) fn build(
        &mut self,
        input: &SearchInput<'_>,
        density_cache: &DensityCache,
        report: &mut Report,
    ) -> Result<(), Error> {
        let grouping = input.grouping(density_cache.division());
        if grouping.count() > 1 {
            report.time("plan", || GroupMembers::count(&mut self.members, input, &grouping))?;
        } else {
            self.members.clear();
        }
        report.time("plan", || self.plan_levels(input, density_cache, &grouping))?;
        link(&mut self.levels, &mut self.targets, &self.members, &grouping, input)?;
        self.touch_decides = grouping.is_by_radii();
        let cells = CellLocator { test: &input.test, levels: &self.levels, groups: &self.groups, grouping };
        report.time("sort", || self.sorter.sort(input, cells, &mut self.columns, &mut self.starts))
    }

    /// Each group has a plan if radii within some group are below effective radii.
    fn plan_levels(
        &mut self,
        input: &SearchInput<'_>,
        density_cache: &DensityCache,
        grouping: &Grouping<'_>,
    ) -> Result<(), Error> {
        self.levels.clear();
        self.groups.clear();
        self.time = 0.0;
        if grouping.is_narrow() {
            for group in 0..grouping.count() {
                let members = &self.members[group];
                let stats = input.stats.with_classes(members.classes);
                let density = density_cache.density_of(group).clone().within(input.extent(members.bounds()));
                let plan = LevelPlan::plan(&stats, &density);
                self.time += plan.cost;
                self.add_levels(input, &plan, grouping, group)?;
            }
            return Ok(());
        }
        let plan = CachedPlan::from_last(self.plan.take(), &input.stats, density_cache.density());
        self.time = plan.levels.cost;
        for group in 0..grouping.count() {
            self.add_levels(input, &plan.levels, grouping, group)?;
        }
        self.plan = Some(plan);
        Ok(())
    }

    fn add_levels(
        &mut self,
        input: &SearchInput<'_>,
        plan: &LevelPlan,
        grouping: &Grouping<'_>,
        group: usize,
    ) -> Result<(), Error> {
        let levels = if grouping.is_narrow() { MAX_LEVELS } else { plan.levels.len() };
        let max_cells = max_cells(grouping.count() * levels);
        let groups = GroupLevels { first: self.levels.len(), of_class: plan.of_class };
        try_push(&mut self.groups, groups, "groups of spheres")?;
        let members = self.members.get(group);
        let pairs_within = grouping.pairs_within(group);
        for (level_index, level) in plan.levels.iter().enumerate() {
            let (class, bounds) = match members {
                None => (SizeClass { count: level.spheres, largest: level.largest }, input.stats.bounds()),
                Some(members) => (members.level_class(plan, level_index), members.bounds()),
            };
            let grid = Self::grid(input, level.cell_size, class, bounds, max_cells);
            let last = self.levels.last();
            let base = last.map_or(0, |last| last.base + last.grid.cells() as usize);
            let from = last.map_or(0, |last| last.members.end);
            let effective = match members {
                Some(own) if grouping.is_narrow() => own.effective,
                _ => grid.largest(),
            };
            let members = from..from + class.count as usize;
            let level = LevelGrid { grid, base, group, members, effective, pairs_within, targets: 0..0 };
            try_push(&mut self.levels, level, "levels")?;
        }
        Ok(())
    }

    fn grid(
        input: &SearchInput<'_>,
        cell_size: f64,
        SizeClass { count, largest }: SizeClass,
        bounds: CenterBounds,
        max_cells: u64,
    ) -> CellGrid {
        let most = ((count as f32 * CELLS_PER_SPHERE) as u64).min(max_cells);
        let grid = |factor| CellGrid::new(cell_size * factor, bounds, input.test.lengths(), largest, most);
        let wider = SIZE_FACTORS.into_iter().map(grid).find(|grid| !grid.folded);
        let grid = wider.unwrap_or_else(|| grid(1.0));
        log::trace!("level of {count} spheres: cell_size {cell_size}, {grid:?}");
        grid
    }

    pub(crate) fn touch_decides(&self) -> bool {
        self.touch_decides
    }

    pub(crate) fn paired(&self) -> usize {
        let searched = self.targets.iter().map(|target| &self.levels[target.level]);
        let own = self.levels.iter().filter(|level| level.pairs_within || !level.targets.is_empty());
        searched.chain(own).map(|level| level.members.end).max().unwrap_or(0)
    }

    pub(crate) fn time(&self) -> f32 {
        self.time
    }

    pub(crate) fn search<'o, O: Output>(
        &self,
        input: &SearchInput<'_>,
        output: &'o O,
    ) -> Result<O::Sink<'o>, Error> {
        search::search(self, input, output)
    }

    pub(crate) fn renumber(&mut self, order: &mut Vec<u32>) -> Result<(), Error> {
        self.columns.renumber(order)
    }

    pub(crate) fn notes(&self) -> &[SortRecord] {
        self.sorter.entries()
    }

    pub(crate) fn notes_mut(&mut self) -> &mut [SortRecord] {
        self.sorter.entries_mut()
    }

    pub(crate) fn memory_for(spheres: u64) -> u64 {
        let cells = (CELLS_PER_SPHERE as u64 * spheres).max(64);
        with_growth(spheres * (Columns::BYTES_PER_SPHERE + Sorter::BYTES_PER_SPHERE) + 4 * cells)
    }
}

pub(crate) struct CellListBuilder<'c> {
    pub(crate) list: &'c mut CellList,
    pub(crate) density_cache: &'c DensityCache,
}

impl CellListBuilder<'_> {
    pub(crate) fn build(
        &mut self,
        input: &SearchInput<'_>,
        report: &mut Report,
    ) -> Result<&mut CellList, Error> {
        self.list.build(input, self.density_cache, report)?;
        Ok(self.list)
    }
}

/// Within a group the finer level searches; between groups, the level with fewer cells to search. `members` is empty
/// for one group.
fn link(
    levels: &mut [LevelGrid],
    targets: &mut Vec<Target>,
    members: &[GroupMembers],
    grouping: &Grouping<'_>,
    input: &SearchInput<'_>,
) -> Result<(), Error> {
    targets.clear();
    for own in 0..levels.len() {
        let start = targets.len();
        for other in (0..levels.len()).filter(|other| *other != own) {
            let [a, b] = [own, other].map(|level| levels[level].group);
            let (Some(group_interaction), false) =
                (grouping.group_interaction(a, b), levels[other].members.is_empty())
            else {
                continue;
            };
            let cutoff = match members.is_empty() || grouping.sets().is_some() {
                true => f64::INFINITY,
                false => members[a].search_cutoff(&members[b], group_interaction, input.test.frame()),
            };
            let (radius, forth) = levels[own].search_of(&levels[other], cutoff);
            let (_, back) = levels[other].search_of(&levels[own], cutoff);
            let is_from_own =
                if a == b { own > other } else { forth < back || (forth == back && own < other) };
            if is_from_own {
                try_push(targets, Target { level: other, radius }, "levels")?;
            }
        }
        levels[own].targets = start..targets.len();
    }
    Ok(())
}
