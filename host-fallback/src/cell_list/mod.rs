//! Hierarchical cell list: every sphere in the one cell of its centre, at the level of its size.
//!
//! Mapping a sphere to every cell it overlaps, as the paper's grids do, costs several entries per sphere; here it
//! is one. All levels are sorted together, since a level's cells follow the coarser level's in one numbering. Each
//! sphere then looks at the cells around it: at its own level only at spheres later in the order, at coarser levels
//! at all. A pair is thus met once, from its finer sphere or, within a level, from its earlier one.
//!
//! `crowding` estimates, `levels` plans, `sort` builds, `search` finds.

mod crowding;
mod grid;
mod levels;
mod search;
mod sort;

use crate::classes::CLASSES;
use crate::compare::{Columns, Output, Vector};
use crate::input::Input;
use crate::memory::{push, with_growth};
use crate::report::Report;
use crate::survey::Class;
use crate::{Error, Survey};
pub(crate) use crowding::{Crowding, Outlook};
use grid::Grid;
use levels::CELLS_PER_SPHERE;
pub(crate) use levels::Levels;
pub(crate) use sort::Entry;
use sort::Sorter;

/// Table entries per level at most, so that 32 bits number the entries of all levels.
const MAX_CELLS: u64 = 1 << 26;
/// How much wider than planned cells may be where that spares a folded table, in which cells are found more slowly: the
/// plan knows the extent of space, but not how many cells it straddles.
const WIDER: [f64; 5] = [1.0, 1.04, 1.08, 1.13, 1.2];

/// The structure and its buffers, which survive between calls.
#[derive(Debug, Default)]
pub(crate) struct CellList {
    /// Coarsest first.
    levels: Vec<Placed>,
    /// The spheres, level by level and cell by cell.
    columns: Columns,
    /// Where each cell's spheres start in `columns`; one more than there are cells.
    starts: Vec<u32>,
    sorter: Sorter,
    plan: Option<Planned>,
    /// Estimated time of a search by one thread, in nanoseconds.
    time: f32,
}

/// A plan, and what it was made of.
#[derive(Debug)]
struct Planned {
    classes: [Class; CLASSES],
    crowding: Crowding,
    levels: Levels,
}

impl Planned {
    /// The plan for spheres of these sizes that are so crowded: the `last` one, if it is.
    fn of(last: Option<Self>, survey: &Survey, crowding: &Crowding) -> Self {
        match last {
            Some(last) if last.classes == survey.classes && last.crowding == *crowding => last,
            _ => {
                let levels = Levels::plan(survey, crowding);
                Self { classes: survey.classes, crowding: crowding.clone(), levels }
            }
        }
    }
}

/// One level of the plan, placed in the table.
#[derive(Clone, Debug)]
struct Placed {
    grid: Grid,
    /// Table entry of its first cell.
    base: usize,
    /// The spheres of this level in the columns.
    members: std::ops::Range<usize>,
}

impl Placed {
    /// How many rows of cells its spheres look at on another level.
    fn effort(&self, other: &Self) -> f64 {
        self.members.len() as f64 * other.grid.rows_around(self.grid.reach())
    }
}

/// Where each sphere belongs in the table.
#[derive(Clone, Copy)]
struct Places<'p> {
    levels: &'p [Placed],
    of_class: &'p [u8; CLASSES],
    /// How many spheres are of the first of two sets. The second one's levels follow those of the first.
    split: Option<usize>,
}

impl Places<'_> {
    /// How many entries the table has.
    fn cells(&self) -> usize {
        self.levels.last().map_or(0, |level| level.base + level.grid.cells() as usize)
    }

    /// The table entry of sphere `id`.
    #[inline(always)]
    fn cell_of<V: Vector>(&self, vector: V, id: usize, [x, y, z, radius]: [f32; 4]) -> u32 {
        let level = match self.levels {
            [only] => only,
            levels => {
                let of_second = self.split.is_some_and(|split| id >= split);
                let first = if of_second { levels.len() / 2 } else { 0 };
                &levels[first + usize::from(self.of_class[Survey::class_of(radius)])]
            }
        };
        (level.base + level.grid.index(level.grid.cell_of(vector, [x, y, z]))) as u32
    }
}

/// How many spheres of the first set each level has; none where there is one set.
struct Members(Option<[u32; CLASSES]>);

impl Members {
    fn count(input: &Input<'_>, plan: &Levels) -> Self {
        Self(input.split.map(|split| {
            let mut first = [0; CLASSES];
            for id in 0..split as u32 {
                let (_, radius) = input.rule.effective(id);
                first[usize::from(plan.of_class[Survey::class_of(radius)])] += 1;
            }
            first
        }))
    }

    /// How many spheres the `k`th level has, counting those of the first set before those of the second.
    fn of(&self, k: usize, plan: &Levels) -> u32 {
        let level = k % plan.levels.len();
        match &self.0 {
            None => plan.levels[level].spheres,
            Some(first) if k < plan.levels.len() => first[level],
            Some(first) => plan.levels[level].spheres - first[level],
        }
    }
}

impl CellList {
    /// Plans and builds for these spheres, which are so crowded.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    pub(crate) fn build(
        &mut self,
        input: &Input<'_>,
        crowding: &Crowding,
        report: &mut Report,
    ) -> Result<(), Error> {
        let Survey { min, max, .. } = input.survey;
        let lengths = input.rule.lengths();
        let last = self.plan.take();
        let plan =
            &self.plan.insert(report.time("plan", || Planned::of(last, &input.survey, crowding))).levels;
        let (mut base, mut from) = (0, 0);
        self.time = plan.cost;
        self.levels.clear();
        let sets = if input.split.is_some() { 2 } else { 1 };
        let members = Members::count(input, plan);
        for (k, level) in (0..sets).flat_map(|_| &plan.levels).enumerate() {
            let most = ((level.spheres as f32 * CELLS_PER_SPHERE) as u64).min(MAX_CELLS);
            let grid = |edge| Grid::new(edge, (min, max), lengths, level.largest, most);
            let wider = WIDER.map(|by| level.edge * by).into_iter().map(grid).find(|grid| !grid.folded);
            let grid = wider.unwrap_or_else(|| grid(level.edge));
            log::trace!("level of {} spheres: edge {}, {grid:?}", level.spheres, level.edge);
            let (cells, to) = (grid.cells() as usize, from + members.of(k, plan) as usize);
            push(&mut self.levels, Placed { grid, base, members: from..to }, "levels")?;
            (base, from) = (base + cells, to);
        }
        let places = Places { levels: &self.levels, of_class: &plan.of_class, split: input.split };
        report.time("sort", || self.sorter.sort(input, places, &mut self.columns, &mut self.starts))
    }

    /// How long one thread is expected to search, in nanoseconds.
    pub(crate) fn time(&self) -> f32 {
        self.time
    }

    /// Finds all pairs.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    pub(crate) fn search<'o, O: Output>(
        &self,
        input: &Input<'_>,
        output: &'o O,
    ) -> Result<O::Sink<'o>, Error> {
        search::search(self, input, output)
    }

    /// The spheres in the order of the list. They are known by their places in it from then on; `order` says
    /// whose places those are.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    pub(crate) fn renumber(&mut self, order: &mut Vec<u32>) -> Result<(), Error> {
        self.columns.renumber(order)
    }

    /// What is noted of each sphere, place by place: room that the list has no use for until it is built again.
    pub(crate) fn notes(&self) -> &[Entry] {
        self.sorter.entries()
    }

    /// The same, to be written.
    pub(crate) fn notes_mut(&mut self) -> &mut [Entry] {
        self.sorter.entries_mut()
    }

    /// An upper estimate of the bytes held for `spheres` spheres.
    pub(crate) fn memory_for(spheres: u64) -> u64 {
        let cells = (CELLS_PER_SPHERE as u64 * spheres).max(64);
        with_growth(spheres * (Columns::BYTES_PER_SPHERE + Sorter::BYTES_PER_SPHERE) + 4 * cells)
    }
}

#[cfg(test)]
mod tests {
    use lazygrid_kernels::{Algorithm, Pair, Space, Sphere};

    use super::{CellList, Crowding};
    use crate::compare::Rule;
    use crate::input::Input;
    use crate::judged::judge;
    use crate::threads::Threads;
    use crate::{HostDetector, Order, Report, Settings, Simd, Survey};

    fn pairs(spheres: &[Sphere], algorithm: Algorithm, simd: Simd) -> Vec<Pair> {
        let settings = Settings { algorithm, simd, order: Order::Canonical, ..Settings::default() };
        let mut detector = HostDetector::new(settings).expect("the settings are in range");
        detector.pairs(spheres).expect("the spheres are valid").to_vec()
    }

    /// Spheres of sizes down to `2^-sizes` with edges of the scene at `spread`, from a fixed sequence.
    fn scattered(n: u32, sizes: u32, spread: f32) -> Vec<Sphere> {
        let mut state = 7_u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / (1 << 24) as f32 - 0.5
        };
        (0..n)
            .map(|k| {
                let center = [random(), random(), random()].map(|x| spread * x * x.abs());
                Sphere::new(center, 0.5_f32.powi((k % (sizes + 1)) as i32))
            })
            .collect()
    }

    #[test]
    fn every_vector_width_finds_what_all_pairs_find() {
        for (n, sizes, spread) in [(0, 0, 1.0), (1, 0, 1.0), (17, 0, 9.0), (3000, 0, 60.0), (3000, 9, 40.0)] {
            let spheres = scattered(n, sizes, spread);
            let expected = pairs(&spheres, Algorithm::Naive, Simd::Portable);
            for simd in [Simd::Portable, Simd::Avx2, Simd::Avx512] {
                assert_eq!(pairs(&spheres, Algorithm::Naive, simd), expected, "naive, {n}, {simd:?}");
                assert_eq!(pairs(&spheres, Algorithm::CellList, simd), expected, "{n}, {simd:?}");
            }
        }
    }

    #[test]
    fn agrees_with_all_pairs() {
        judge(&Settings { algorithm: Algorithm::CellList, ..Settings::default() });
    }

    /// Cells wider than the reach, most of them away from the seam, and pairs across every face, edge and corner.
    #[test]
    fn a_gas_in_a_periodic_box() {
        let spheres: Vec<_> = scattered(6000, 0, 60.0)
            .into_iter()
            .map(|sphere| Sphere::new((sphere.center * 17.0) % 15.0, 0.5))
            .collect();
        for lengths in [[Some(15.0); 3], [Some(15.0), None, None], [None, Some(15.0), Some(14.0)]] {
            let space = Space::periodic(lengths).expect("a box");
            let pairs = |algorithm, simd| {
                let settings = Settings { algorithm, simd, space, ..Settings::default() };
                let mut detector = HostDetector::new(settings).expect("the settings are in range");
                detector.pairs(&spheres).expect("the spheres are valid").to_vec()
            };
            let expected = pairs(Algorithm::Naive, Simd::Portable);
            for simd in [Simd::Portable, Simd::Avx2, Simd::Avx512] {
                assert!(pairs(Algorithm::CellList, simd) == expected, "{lengths:?}, {simd:?}");
                assert!(pairs(Algorithm::Naive, simd) == expected, "naive, {lengths:?}, {simd:?}");
            }
        }
    }

    #[test]
    fn a_folded_table_finds_what_all_pairs_find() {
        // A chain across space: its bounds hold far more cells than the table may have, and its links cross every
        // seam of the fold.
        let mut at = glam::Vec3::new(-700.0, 400.0, 90.0);
        let mut spheres = scattered(2000, 3, 30.0);
        for sphere in &mut spheres {
            at += sphere.center.abs() * 0.1 + 0.05;
            sphere.center = at;
        }
        let expected = pairs(&spheres, Algorithm::Naive, Simd::Portable);
        assert!(expected.len() > 1000);
        assert_eq!(pairs(&spheres, Algorithm::CellList, Simd::detect()), expected);
    }

    /// Cells as small as the table allows, wherever space begins.
    #[test]
    fn a_few_cells_too_many_are_no_reason_to_fold() {
        // Sums of four are about normally distributed, so that no cells are as good as the smallest.
        let cloud: Vec<_> = scattered(80_000, 0, 1e5)
            .chunks(4)
            .map(|four| Sphere::new(four.iter().map(|sphere| sphere.center).sum::<glam::Vec3>(), 1.0))
            .collect();
        for shift in 0..10 {
            let mut spheres = cloud.clone();
            spheres.iter_mut().for_each(|sphere| sphere.center += 1700.0 * shift as f32);
            let rule = Rule::new((&spheres).into(), None);
            let survey = Survey::of(&rule, Threads::Pool).expect("all are valid");
            let settings = Settings::default();
            let input = Input {
                rule,
                survey,
                settings: &settings,
                simd: Simd::detect(),
                threads: Threads::Pool,
                split: None,
            };
            let mut list = CellList::default();
            let crowding = Crowding::sample(&input).expect("there is memory");
            list.build(&input, &crowding, &mut Report::default()).expect("there is memory");
            assert!(list.levels.iter().all(|level| !level.grid.folded), "{:?}", list.levels);
        }
    }
}
