//! Hierarchical cell list: every sphere is in the cell of its center, at the level of its size.
//!
//! All levels are sorted together, coarse levels first. Each sphere searches the cells around it, at its own level for
//! later spheres only, and at coarser levels. So a pair is found once, from its finer sphere or, within a level, from
//! its earlier one.
//!
//! Groups of spheres, such as two sets or species with the same partners, have separate levels. Spheres search only
//! levels of groups that pair with theirs, each two levels from one side.

mod density;
mod grid;
mod group_members;
mod levels;
mod search;
mod sort;
#[cfg(test)]
mod tests;

use std::ops::Range;

use crate::compare::{Columns, Output, SimdWidth};
use crate::input::Grouping;
use crate::input::SearchInput;
use crate::input::SizeClass;
use crate::memory::{try_push, with_growth};
use crate::report::Report;
use crate::size_class::SIZE_CLASSES;
use crate::{Error, InputStats};
pub(crate) use density::{DensityCache, DensityProfile};
use grid::CellGrid;
use group_members::GroupMembers;
use levels::CELLS_PER_SPHERE;
pub(crate) use levels::LevelPlan;
pub(crate) use sort::SortRecord;
use sort::Sorter;

const MAX_CELLS_PER_LEVEL: u64 = 1 << 26;
/// Factors on the planned cell size that avoid a folded table, which is slower.
const WIDER: [f64; 5] = [1.0, 1.04, 1.08, 1.13, 1.2];

#[derive(Debug, Default)]
pub(crate) struct CellList {
    levels: Vec<LevelGrid>,
    columns: Columns,
    starts: Vec<u32>,
    targets: Vec<Target>,
    members: Vec<GroupMembers>,
    /// `true` if touching effective radii decide pairs.
    touch_decides: bool,
    sorter: Sorter,
    plan: Option<CachedPlan>,
    time: f32,
}

#[derive(Debug)]
struct CachedPlan {
    classes: [SizeClass; SIZE_CLASSES],
    density: DensityProfile,
    levels: LevelPlan,
}

impl CachedPlan {
    fn of(last: Option<Self>, stats: &InputStats, density: &DensityProfile) -> Self {
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
    base: usize,
    members: Range<usize>,
    pairs_within: bool,
    targets: Range<usize>,
}

impl LevelGrid {
    fn effort(&self, other: &Self, cap: f64) -> f64 {
        self.members.len() as f64 * other.grid.rows_around(self.grid.reach().min(cap))
    }
}

#[derive(Clone, Copy, Debug)]
struct Target {
    level: usize,
    /// No searching sphere pairs with one of the level at a greater distance.
    cap: f32,
}

#[derive(Clone, Copy)]
struct CellLocator<'p> {
    levels: &'p [LevelGrid],
    of_class: &'p [u8; SIZE_CLASSES],
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
                let first = self.grouping.of(id) * (levels.len() / self.grouping.count());
                &levels[first + usize::from(self.of_class[InputStats::class_of(radius)])]
            }
        };
        (level.base + level.grid.index(level.grid.cell_of(vector, [x, y, z]))) as u32
    }
}

/// Returns the most cells of each level, so that 32 bits number the cells of all.
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
        let last = self.plan.take();
        let planned = report.time("plan", || CachedPlan::of(last, &input.stats, density_cache.density()));
        let plan = &self.plan.insert(planned).levels;
        self.time = plan.cost;
        let grouping = input.grouping(density_cache.is_separate());
        let is_divided = grouping.count() > 1;
        if is_divided {
            report.time("plan", || GroupMembers::count(&mut self.members, input, &grouping))?;
        }
        self.levels.clear();
        let (mut base, mut from) = (0, 0);
        for k in 0..grouping.count() * plan.levels.len() {
            let (group, of) = (k / plan.levels.len(), k % plan.levels.len());
            let members = if is_divided { self.members.get(group) } else { None };
            let grid =
                Self::grid(input, (plan, of), members, max_cells(grouping.count() * plan.levels.len()));
            let cells = grid.cells() as usize;
            let to =
                from + members.map_or(plan.levels[of].spheres, |own| own.of_level(plan, of).count) as usize;
            let pairs_within = grouping.meeting(group, group).is_some();
            let level = LevelGrid { grid, base, members: from..to, pairs_within, targets: 0..0 };
            try_push(&mut self.levels, level, "levels")?;
            (base, from) = (base + cells, to);
        }
        let members = if is_divided { &self.members[..] } else { &[] };
        link(&mut self.levels, &mut self.targets, members, &grouping, input)?;
        self.touch_decides = grouping.is_by_radii();
        let places = CellLocator { levels: &self.levels, of_class: &plan.of_class, grouping };
        report.time("sort", || self.sorter.sort(input, places, &mut self.columns, &mut self.starts))
    }

    fn grid(
        input: &SearchInput<'_>,
        (plan, of): (&LevelPlan, usize),
        members: Option<&GroupMembers>,
        max_cells: u64,
    ) -> CellGrid {
        let InputStats { min, max, .. } = input.stats;
        let level = &plan.levels[of];
        let (spheres, largest, bounds) = match members {
            None => (level.spheres, level.largest, (min, max)),
            Some(members) => {
                let SizeClass { count, largest } = members.of_level(plan, of);
                (count, largest, members.bounds())
            }
        };
        let most = ((spheres as f32 * CELLS_PER_SPHERE) as u64).min(max_cells);
        let grid = |cell_size| CellGrid::new(cell_size, bounds, input.test.lengths(), largest, most);
        let wider = WIDER.map(|by| level.cell_size * by).into_iter().map(grid).find(|grid| !grid.folded);
        let grid = wider.unwrap_or_else(|| grid(level.cell_size));
        log::trace!("level of {spheres} spheres: cell_size {}, {grid:?}", level.cell_size);
        grid
    }

    pub(crate) fn touch_decides(&self) -> bool {
        self.touch_decides
    }

    /// Number of spheres up to the last one that may pair.
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

/// Decides which of two levels searches the other: within a group the finer one, between groups the one that searches
/// fewer cells. `members` is empty for one group.
fn link(
    levels: &mut [LevelGrid],
    targets: &mut Vec<Target>,
    members: &[GroupMembers],
    grouping: &Grouping<'_>,
    input: &SearchInput<'_>,
) -> Result<(), Error> {
    targets.clear();
    let per_group = levels.len() / grouping.count();
    for own in 0..levels.len() {
        let start = targets.len();
        for other in (0..levels.len()).filter(|other| *other != own) {
            let [a, b] = [own, other].map(|level| level / per_group);
            let (Some(meeting), false) = (grouping.meeting(a, b), levels[other].members.is_empty()) else {
                continue;
            };
            let reach = match members {
                [] => f64::INFINITY,
                _ if input.test.frame().is_some() || grouping.sets().is_some() => f64::INFINITY,
                members => members[a].reach(&members[b], meeting),
            };
            let [cap, back] = [other, own].map(|level| reach - f64::from(levels[level].grid.largest()));
            let [forth, back] =
                [levels[own].effort(&levels[other], cap), levels[other].effort(&levels[own], back)];
            let is_from_own =
                if a == b { own > other } else { forth < back || (forth == back && own < other) };
            if is_from_own {
                try_push(targets, Target { level: other, cap: (cap as f32).next_up() }, "levels")?;
            }
        }
        levels[own].targets = start..targets.len();
    }
    Ok(())
}
