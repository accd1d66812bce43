//! The paper's RecursiveGrid: a raster for the largest spheres, whose crowded cells are split for the smaller ones.
//!
//! The top raster is an [`ArrayGrid`](crate::array_grid)'s. In each cell, pairs with a large sphere, one that no
//! finer raster suits, are found among all its spheres. Where more than τ smaller spheres remain, the cell is split
//! into a finer raster, else they are compared with each other. Finer cells are a power of two smaller and nest in
//! the cell they split, so that a pair's own cell lies in its own coarser cell: what is refined are the cell's
//! entries, and a finer entry's class has a bit only where the coarser one had it.
//!
//! A split goes straight to the size that the largest remaining sphere asks for, or, where spheres are few, to cells
//! that hold a handful. It must separate the centres: where it cannot, because spheres as large as the extent of all
//! remain, those count as large in this very cell. So every step halves the largest remaining size or the extent of
//! the spheres in a cell, and a recursion ends after some tens of steps on any input.

use glam::{DVec3, UVec3, Vec3};
use rayon::prelude::*;

use crate::cell::{Batch, Crowd, owns_pairs};
use crate::cover::{Cover, Raster};
use crate::detector::Input;
use crate::entries::{Entries, Packing, Visit, cells_of_piece, fill, run_end};
use crate::radix::{Entry, Key, Radix};
use crate::report::Report;
use crate::sink::{Output, Sink};
use crate::workspace::Workspaces;

/// Entries per piece of work: their spheres' columns take 40 KiB.
const PIECE: usize = 1 << 11;
/// Spheres per finer cell aimed at where the largest of them would allow smaller cells. Fewer mean more entries,
/// more mean more comparisons.
const PER_CELL: f64 = 4.0;
/// Halvings of a cell in one split at most, so that 32 bits hold a finer cell's key.
const MAX_HALVINGS: f64 = 7.0;
/// Finer cells per axis from the corner of a top cell on at most: `f64` must tell them apart exactly. Only spheres
/// 2⁴⁸ × smaller than the largest could ask for more; those of one such cell are compared with each other.
const MAX_FINENESS: f64 = (1_u64 << 48) as f64;

/// The structure and its buffers, which survive between calls.
#[derive(Debug, Default)]
pub(crate) struct RecursiveGrid {
    entries: Entries,
    workspaces: Workspaces<Workspace>,
}

/// Buffers for one cell after the other.
#[derive(Debug, Default)]
struct Workspace {
    batch: Batch,
    crowd: Crowd,
    split: Split,
}

/// The spheres of a crowded cell, and the finer entries of the small ones.
#[derive(Debug, Default)]
struct Split {
    large: Vec<Entry<u32>>,
    small: Vec<Entry<u32>>,
    finer: Radix<u32>,
    offsets: Vec<usize>,
}

impl Split {
    /// Starts with the spheres of a run, all of them small.
    fn start<K: Key>(&mut self, run: &[Entry<K>]) {
        self.small.clear();
        self.small.extend(run.iter().map(|entry| Entry { key: entry.class() as u32, id: entry.id }));
    }

    /// Moves those that are large out of the small ones.
    fn part(&mut self, is_large: impl Fn(u32) -> bool) {
        let Self { large, small, .. } = self;
        large.clear();
        small.retain(|&entry| {
            let moves = is_large(entry.id);
            if moves {
                large.push(entry);
            }
            !moves
        });
    }

    /// Makes them all large, sorted by class.
    fn join(&mut self) {
        self.large.append(&mut self.small);
        self.large.sort_unstable_by_key(|entry| (entry.key, entry.id));
    }
}

/// What to do with the small spheres of a crowded cell.
enum Step {
    /// Split the cell into this many parts per axis, a power of two.
    Into(f64),
    /// Compare those larger than this with all, and look again.
    Settle(f64),
    /// Compare all with each other: no finer raster tells them apart.
    Stop,
}

/// A cell of some level: how to get from cells of the top raster to cells of its own size, counted from its corner.
#[derive(Clone, Copy, Debug)]
struct Cell {
    /// The top cell; `None` on an axis on which all its spheres have one coordinate.
    top: [Option<f64>; 3],
    /// How many cells of this size a top cell has per axis, a power of two.
    fineness: f64,
    /// This cell, counted from the top cell's corner.
    corner: DVec3,
}

impl Cell {
    /// Where the box around a sphere starts and ends, in cells of this size from this one's corner.
    ///
    /// Clipped to the cell, this is monotone, so that the larger of two lower bounds never lies above either upper
    /// bound; and a coordinate keeps its place when the cell is split again, since all but the first subtraction are
    /// exact inside the cell.
    #[inline(always)]
    fn local(&self, (low, high): (DVec3, DVec3)) -> (DVec3, DVec3) {
        let mut local = (DVec3::ZERO, DVec3::ZERO);
        for axis in 0..3 {
            if let Some(top) = self.top[axis] {
                local.0[axis] = (low[axis] - top) * self.fineness - self.corner[axis];
                local.1[axis] = (high[axis] - top) * self.fineness - self.corner[axis];
            }
        }
        local
    }

    /// One of the cells that this one is split into.
    fn finer(&self, parts: f64, at: DVec3) -> Self {
        Self { top: self.top, fineness: self.fineness * parts, corner: self.corner * parts + at }
    }
}

impl RecursiveGrid {
    /// Builds the top raster for these spheres.
    pub(crate) fn build(&mut self, input: &Input<'_>, report: &mut Report) {
        self.entries.build(input, report);
    }

    /// Finds all pairs.
    pub(crate) fn search<'o, O: Output>(&self, input: &Input<'_>, output: &'o O) -> O::Sink<'o> {
        self.entries.visit(Search { grid: self, input, output })
    }

    /// An upper estimate of the bytes held for `spheres` spheres.
    pub(crate) fn memory_for(spheres: u64, ratio: f32) -> u64 {
        Entries::memory_for(spheres, ratio)
    }
}

struct Search<'s, 'o, O> {
    grid: &'s RecursiveGrid,
    input: &'s Input<'s>,
    output: &'o O,
}

impl<'o, O: Output> Visit for Search<'_, 'o, O> {
    type Result = O::Sink<'o>;

    fn visit<K: Key>(self, entries: &[Entry<K>], packing: Packing) -> O::Sink<'o> {
        let cell = |key: K| {
            let top = Raster::corner(packing.cell(key));
            Cell { top, fineness: 1.0, corner: DVec3::ZERO }
        };
        self.level(entries, cell, self.output.open())
    }
}

impl<'o, O: Output> Search<'_, 'o, O> {
    /// Finds the pairs of all cells of one raster; `cell` tells a cell from a key.
    fn level<K: Key>(
        &self,
        entries: &[Entry<K>],
        cell: impl Fn(K) -> Cell + Sync,
        sink: O::Sink<'o>,
    ) -> O::Sink<'o> {
        let piece = |sink: O::Sink<'o>, piece: usize| match sink.stopped() {
            true => sink,
            false => self.grid.workspaces.lend(|workspace| {
                self.cells(cells_of_piece(entries, piece, PIECE), &cell, (workspace, sink))
            }),
        };
        let pieces = entries.len().div_ceil(PIECE);
        if pieces < 2 {
            return (0..pieces).fold(sink, piece);
        }
        let open = || self.output.open();
        let rest = (0..pieces).into_par_iter().fold(open, piece).reduce(open, Sink::merge);
        sink.merge(rest)
    }

    /// Finds the pairs of some cells one after the other.
    fn cells<K: Key>(
        &self,
        entries: &[Entry<K>],
        cell: impl Fn(K) -> Cell,
        (workspace, mut sink): (&mut Workspace, O::Sink<'o>),
    ) -> O::Sink<'o> {
        let tau = (self.input.settings.tau as usize).min(PIECE);
        let mut from = 0;
        while from < entries.len() {
            let to = run_end(entries, from);
            let run = &entries[from..to];
            from = to;
            if run.len() <= tau {
                workspace.batch.push(run);
            } else if owns_pairs(run) {
                workspace.batch.search(self.input, &mut sink);
                workspace.split.start(run);
                sink = self.crowded(cell(run[0].key), workspace, sink);
            }
            if workspace.batch.len() > PIECE {
                workspace.batch.search(self.input, &mut sink);
            }
        }
        workspace.batch.search(self.input, &mut sink);
        sink
    }

    /// Finds the pairs of the cell whose many spheres are `small` in the workspace.
    fn crowded(&self, cell: Cell, workspace: &mut Workspace, mut sink: O::Sink<'o>) -> O::Sink<'o> {
        let Workspace { split, crowd, .. } = workspace;
        let mut limit = self.edge(&cell) / 2.0;
        loop {
            split.part(|id| self.diameter(id) > limit);
            let few = split.small.len() <= self.input.settings.tau as usize;
            let step = if few { Step::Stop } else { self.step(&cell, &split.small) };
            if let Step::Stop = step {
                split.join();
            }
            if !split.large.is_empty() {
                sink = crowd.among(self.input, (&split.large, &split.small), (self.output, sink));
            }
            match step {
                Step::Stop => return sink,
                Step::Settle(diameter) => limit = diameter,
                Step::Into(parts) => return self.split(&cell, parts, (split, sink)),
            }
        }
    }

    fn edge(&self, cell: &Cell) -> f64 {
        self.grid.entries.raster.edge() / cell.fineness
    }

    fn diameter(&self, id: u32) -> f64 {
        2.0 * f64::from(self.input.rule.effective(id).1)
    }

    /// Decides by the sizes, the extent and the number of the small spheres.
    fn step(&self, cell: &Cell, small: &[Entry<u32>]) -> Step {
        let (mut min, mut max, mut radius) = (Vec3::INFINITY, Vec3::NEG_INFINITY, 0.0_f32);
        for entry in small {
            let (center, r) = self.input.rule.effective(entry.id);
            (min, max, radius) = (min.min(center), max.max(center), radius.max(r));
        }
        let extent = (max.as_dvec3() - min.as_dvec3()).max_element();
        if extent == 0.0 {
            return Step::Stop;
        }
        let (edge, diameter) = (self.edge(cell), 2.0 * f64::from(radius));
        let by_count = (small.len() as f64 / PER_CELL).log2() / 3.0;
        let by_count = by_count.ceil().clamp(1.0, MAX_HALVINGS) + (edge / extent).log2().floor().max(0.0);
        let by_size = (edge / diameter).log2().floor();
        let halvings = by_count.min(by_size).max(1.0);
        if by_size < by_count && edge / halvings.exp2() > extent {
            return Step::Settle(diameter / 2.0);
        }
        let most = (MAX_FINENESS / (cell.corner.max_element() + 1.0)).log2().floor();
        if most < 1.0 { Step::Stop } else { Step::Into(halvings.min(most).exp2()) }
    }

    /// Splits a cell for its small spheres.
    fn split(&self, cell: &Cell, parts: f64, (split, sink): (&mut Split, O::Sink<'o>)) -> O::Sink<'o> {
        let Split { small, finer, offsets, .. } = split;
        let cover = |entry: &Entry<u32>| {
            let (center, radius) = self.input.rule.effective(entry.id);
            let (low, high) = cell.local(self.grid.entries.raster.bounds(center, radius));
            let last = DVec3::splat(parts - 1.0);
            let clip = |at: DVec3| (at * parts).max(DVec3::ZERO).min(last).as_i64vec3().as_dvec3();
            (clip(low), clip(high))
        };
        let (mut first, mut last) = (DVec3::INFINITY, DVec3::ZERO);
        for entry in &*small {
            let (low, high) = cover(entry);
            (first, last) = (first.min(low), last.max(high));
        }
        let packing = Packing::new(UVec3::ZERO, (last - first).as_uvec3());
        let item = |k: usize| {
            let (low, high) = cover(&small[k]);
            let cover = Cover { low: (low - first).as_uvec3(), high: (high - first).as_uvec3() };
            (cover, small[k].class() as u8, small[k].id)
        };
        fill(small.len(), item, packing, (finer, offsets));
        finer.sort(packing.bits());
        let cell = |key: u32| cell.finer(parts, first + packing.cell(key).as_dvec3());
        self.level(&finer.entries, cell, sink)
    }
}

#[cfg(test)]
mod tests {
    use lazygrid_kernels::Algorithm;

    use crate::Settings;
    use crate::judged::{judge, judge_shared};

    fn settings(raster_ratio: f32) -> Settings {
        Settings { algorithm: Algorithm::RecursiveGrid, raster_ratio, ..Settings::default() }
    }

    #[test]
    fn agrees_with_all_pairs() {
        for ratio in [0.5, 1.0, 3.0, 16.0] {
            for tau in [0, 1, 5, Settings::TAU, u32::MAX] {
                judge(&Settings { tau, ..settings(ratio) });
            }
        }
    }

    #[test]
    fn threads_share_the_work() {
        for tau in [0, Settings::TAU, 1000] {
            judge_shared(&Settings { tau, ..settings(Settings::RASTER_RATIO) });
        }
    }
}
