use std::ops::Range;

use super::grid::CellRange;
use super::{CellList, LevelGrid, SearchRadius, Target};
use crate::Error;
use crate::compare::{
    HitQueue, MAX_LANES, NeighborRows, Output, PairTest, RunQueue, ScanInput, SimdTask, SimdWidth, Sink,
    SphereRun, Xyzr, scan,
};
use crate::input::{SearchInput, search_chunks};

/// A chunk takes some tens of microseconds at moderate density.
const CHUNK_SPHERES: usize = 1 << 10;
/// With at most this mean number of runs per hit, hits are queued.
const RUNS_PER_HIT: usize = 2;

pub(super) fn search<'o, O: Output>(
    list: &CellList,
    input: &SearchInput<'_>,
    output: &'o O,
) -> Result<O::Sink<'o>, Error> {
    let n = list.columns.len();
    search_chunks(output, input, n.div_ceil(CHUNK_SPHERES), usize::MAX, |mut sink, chunk| {
        let range = chunk * CHUNK_SPHERES..n.min((chunk + 1) * CHUNK_SPHERES);
        input.run(ChunkSearch { list, test: &input.test, range, sink: &mut sink });
        Ok(sink)
    })
}

struct ChunkSearch<'p, S> {
    list: &'p CellList,
    test: &'p PairTest<'p>,
    range: Range<usize>,
    sink: &'p mut S,
}

impl<S: Sink> SimdTask for ChunkSearch<'_, S> {
    type Result = ();

    #[inline(always)]
    fn run<V: SimdWidth>(self, vector: V) {
        let Self { list, test, range, sink } = self;
        let mut finder = Finder {
            vector,
            list,
            test,
            sink,
            runs: RunQueue::new(),
            hits: HitQueue::new(),
            has_many_hits: false,
        };
        for level in &list.levels {
            let members = range.start.max(level.members.start)..range.end.min(level.members.end);
            let targets = &list.targets[level.targets.clone()];
            match (level.pairs_within, level.grid.adjoining) {
                (true, true) => finder.cell_by_cell(level, targets, members),
                (true, false) => {
                    for at in members {
                        finder.level(level, at, level.own_radius(), at + 1);
                        finder.others(targets, at);
                    }
                }
                (false, _) if targets.is_empty() => {}
                (false, _) => {
                    for at in members {
                        finder.others(targets, at);
                    }
                }
            }
        }
        finder.work();
    }
}

#[inline(always)]
fn neighbor_rows(list: &CellList, level: &LevelGrid, cell: [u32; 3]) -> (NeighborRows, usize) {
    let [size_x, size_y, size_z] = level.grid.size;
    let own = level.base + level.grid.index(cell);
    let lower_y = if cell[1] > 0 { size_x as usize } else { 0 };
    let higher_y = if cell[1] + 1 < size_y { size_x as usize } else { 0 };
    let higher_z = if cell[2] + 1 < size_z { (size_x * size_y) as usize } else { 0 };
    let rows = [own, own + higher_y, own + higher_z - lower_y, own + higher_z, own + higher_z + higher_y];
    let (low, high) = level.grid.bounds(cell);
    let mut neighbors = NeighborRows { low, high, rows: [[0; 4]; 5] };
    for (row, first) in rows.into_iter().enumerate() {
        let starts = &list.starts[first..first + 3];
        neighbors.rows[row] = [list.starts[first.saturating_sub(1)], starts[0], starts[1], starts[2]];
    }
    (neighbors, neighbors.rows[0][2] as usize)
}

#[inline(always)]
fn wrap(at: u32, size: u32) -> u32 {
    if at < size { at } else { at - size }
}

#[inline(always)]
fn crosses([x, y, z, radius]: Xyzr, (low, high): &([f32; 3], [f32; 3])) -> bool {
    let is_outside = |axis: usize, at: f32| (at - radius < low[axis]) | (at + radius > high[axis]);
    is_outside(0, x) | is_outside(1, y) | is_outside(2, z)
}

/// Returns the cells of one end of a block that are not adjacent to `cell`; none if they contain `cell`.
#[inline(always)]
fn outside(cells: &Range<u32>, cell: u32) -> Range<u32> {
    if cells.contains(&cell) {
        return 0..0;
    }
    let (start, end) = (cells.start, cells.end);
    start + u32::from(start == cell + 1 && start < end)..end - u32::from(end == cell && start < end)
}

struct Finder<'p, V, S> {
    vector: V,
    list: &'p CellList,
    test: &'p PairTest<'p>,
    sink: &'p mut S,
    runs: RunQueue,
    hits: HitQueue,
    has_many_hits: bool,
}

impl<V: SimdWidth, S: Sink> Finder<'_, V, S> {
    /// Spheres of one cell share its neighbor cells.
    #[inline(always)]
    fn cell_by_cell(&mut self, level: &LevelGrid, targets: &[Target], members: Range<usize>) {
        let (boundary, has_distinct_sides) = (level.grid.boundary_bounds(), level.grid.has_distinct_sides());
        let mut at = members.start;
        while at < members.end {
            let [x, y, z, _] = self.list.columns.sphere(at);
            let cell = level.grid.cell_of(self.vector, [x, y, z]);
            let (neighbors, end) = neighbor_rows(self.list, level, cell);
            let end = end.min(members.end);
            let is_at_boundary = level.grid.is_at_boundary(cell);
            if is_at_boundary && !has_distinct_sides {
                for at in at..end {
                    self.level(level, at, level.own_radius(), at + 1);
                    self.others(targets, at);
                }
                at = end;
            }
            while at < end {
                let spheres = at..at + MAX_LANES.min(end - at);
                at = spheres.end;
                self.work_if_full();
                let columns = &self.list.columns;
                self.vector.find_neighbor_runs(columns, spheres.clone(), &neighbors, &mut self.runs);
                if is_at_boundary {
                    for at in spheres.clone() {
                        if crosses(self.list.columns.sphere(at), &boundary) {
                            self.across_boundary(level, at, cell);
                        }
                    }
                }
                if !targets.is_empty() {
                    for at in spheres {
                        self.others(targets, at);
                    }
                }
            }
        }
    }

    #[inline(always)]
    fn others(&mut self, targets: &[Target], at: usize) {
        for &Target { level, radius } in targets {
            self.level(&self.list.levels[level], at, radius, 0);
        }
    }

    #[inline(always)]
    fn level(&mut self, level: &LevelGrid, at: usize, search_radius: SearchRadius, from: usize) {
        let [x, y, z, radius] = self.list.columns.sphere(at);
        let block = level.grid.block(self.vector, [x, y, z, search_radius.for_radius(radius)]);
        let count = block.count();
        if (level.grid.circular && block.wraps(level.grid.size)) || count[1] > 2 || count[2] > 2 {
            return self.rows(level, block, at, from);
        }
        self.work_if_full();
        let [size_x, size_y, _] = level.grid.size.map(|k| k as usize);
        let [width, more_y, more_z] = [count[0] as usize, count[1] as usize - 1, count[2] as usize - 1];
        let first = level.base + level.grid.index(block.first);
        let (next_y, next_z) = (size_x * more_y, size_x * size_y * more_z);
        let rows = [first, first + next_y, first + next_z, first + next_y + next_z];
        let wanted = [true, more_y > 0, more_z > 0, (more_y > 0) & (more_z > 0)];
        for (row, wanted) in rows.into_iter().zip(wanted) {
            let start = self.list.starts[row].max(from as u32);
            self.runs.push(at as u32, start..self.list.starts[row + width], wanted);
        }
    }

    /// Queues later spheres in cells that are adjacent to `cell`, the sphere's own, only across a periodic boundary.
    #[inline(always)]
    fn across_boundary(&mut self, level: &LevelGrid, at: usize, cell: [u32; 3]) {
        let [x, y, z, radius] = self.list.columns.sphere(at);
        let block = level.grid.block(self.vector, [x, y, z, level.own_radius().for_radius(radius)]);
        let (size, first, count) = (level.grid.size, block.first, block.count());
        if !block.wraps(size) {
            return;
        }
        self.work_if_full();
        let own_row = level.grid.index([0, cell[1], cell[2]]);
        let ranges = block.row_ranges(size);
        for z in 0..count[2] {
            for y in 0..count[1] {
                let (y, z) = (wrap(first[1] + y, size[1]), wrap(first[2] + z, size[2]));
                let is_adjacent = y.abs_diff(cell[1]) <= 1 && z.abs_diff(cell[2]) <= 1;
                let row = level.grid.index([0, y, z]);
                if row < own_row || (is_adjacent && ranges[1].is_empty()) {
                    continue;
                }
                let row = level.base + row;
                for cells in &ranges {
                    let wanted = if is_adjacent { outside(cells, cell[0]) } else { cells.clone() };
                    let start = self.list.starts[row + wanted.start as usize].max(at as u32 + 1);
                    let end = self.list.starts[row + wanted.end as usize];
                    self.runs.push(at as u32, start..end, true);
                }
            }
        }
    }

    /// No row is queued twice, because no range is longer than its axis.
    #[inline(always)]
    fn rows(&mut self, level: &LevelGrid, block: CellRange, at: usize, from: usize) {
        let (size, first, count) = (level.grid.size, block.first, block.count());
        let ranges = block.row_ranges(size);
        for z in 0..count[2] {
            for y in 0..count[1] {
                self.work_if_full();
                let (y, z) = (wrap(first[1] + y, size[1]), wrap(first[2] + z, size[2]));
                let row = level.base + level.grid.index([0, y, z]);
                for cells in &ranges {
                    let start = self.list.starts[row + cells.start as usize].max(from as u32);
                    let end = self.list.starts[row + cells.end as usize];
                    self.runs.push(at as u32, start..end, true);
                }
            }
        }
    }

    #[inline(always)]
    fn work_if_full(&mut self) {
        if self.runs.is_full() {
            self.work();
        }
    }

    #[inline(always)]
    fn work(&mut self) {
        let Self { vector, list, test, ref mut sink, ref mut runs, ref mut hits, ref mut has_many_hits } =
            *self;
        let input = ScanInput { columns: &list.columns, test };
        vector.call(Scan { input, runs, hits, has_many_hits, sink: *sink }, vector);
    }
}

struct Scan<'f, S> {
    input: ScanInput<'f>,
    runs: &'f mut RunQueue,
    hits: &'f mut HitQueue,
    has_many_hits: &'f mut bool,
    sink: &'f mut S,
}

impl<S: Sink> SimdTask for Scan<'_, S> {
    type Result = ();

    #[inline(always)]
    fn run<V: SimdWidth>(self, vector: V) {
        let Self { input, runs, hits, has_many_hits, sink } = self;
        let mut hit_vectors = 0;
        if *has_many_hits {
            for k in 0..runs.len() {
                hits.scan(vector, input, runs.get(k), sink);
            }
            hit_vectors = hits.flush(vector, input, sink);
        } else {
            for k in 0..runs.len() {
                let SphereRun { at, run } = runs.get(k);
                hit_vectors += scan(vector, input, at, run, sink);
            }
        }
        *has_many_hits = hit_vectors > runs.len() / RUNS_PER_HIT;
        runs.clear();
    }
}
