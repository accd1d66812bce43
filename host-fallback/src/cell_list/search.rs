//! Looks around every sphere of a built cell list.

use std::ops::Range;

use glam::{UVec3, Vec3};
use rayon::prelude::*;

use super::raster::Block;
use super::{CellList, Placed};
use crate::contact::{Rule, scan};
use crate::detector::Input;
use crate::simd::{Task, Vector};
use crate::sink::{Output, Sink};

/// Spheres per piece of work: some tens of microseconds where space is not crowded.
const PIECE: usize = 1 << 10;

/// Finds all pairs of the list, piece by piece over the threads.
pub(super) fn search<'o, O: Output>(list: &CellList, input: &Input<'_>, output: &'o O) -> O::Sink<'o> {
    let n = list.columns.len();
    let piece = |mut sink: O::Sink<'o>, piece: usize| {
        if !sink.stopped() {
            let range = piece * PIECE..n.min((piece + 1) * PIECE);
            input.simd.run(Piece { list, rule: &input.rule, range, sink: &mut sink });
        }
        sink
    };
    (0..n.div_ceil(PIECE))
        .into_par_iter()
        .fold(|| output.open(), piece)
        .reduce(|| output.open(), Sink::merge)
}

struct Piece<'p, S> {
    list: &'p CellList,
    rule: &'p Rule<'p>,
    range: Range<usize>,
    sink: &'p mut S,
}

impl<S: Sink> Task for Piece<'_, S> {
    type Result = ();

    #[inline(always)]
    fn run<V: Vector>(self, vector: V) {
        let Self { list, rule, range, sink } = self;
        for (k, level) in list.levels.iter().enumerate() {
            let members = range.start.max(level.members.start)..range.end.min(level.members.end);
            for at in members {
                let mut around = Around { vector, list, rule, at, sink };
                around.own_level(level);
                for coarser in &list.levels[..k] {
                    around.coarser_level(coarser);
                }
            }
        }
    }
}

/// A sphere whose surroundings are searched.
struct Around<'p, V, S> {
    vector: V,
    list: &'p CellList,
    rule: &'p Rule<'p>,
    at: usize,
    sink: &'p mut S,
}

impl<V: Vector, S: Sink> Around<'_, V, S> {
    #[inline(always)]
    fn sphere(&self) -> (Vec3, f32) {
        let c = &self.list.columns;
        (Vec3::new(c.x[self.at], c.y[self.at], c.z[self.at]), c.r[self.at])
    }

    /// Compares with the spheres of this level that come later.
    #[inline(always)]
    fn own_level(&mut self, level: &Placed) {
        let (center, radius) = self.sphere();
        let block = level.raster.block(center, radius);
        if level.raster.folded {
            return self.folded(level, block, self.at + 1);
        }
        // Rows before the sphere's own hold earlier spheres only.
        let own = level.raster.cell_of(center);
        let to = block.first + block.count;
        for z in own.z..to.z {
            let from = if z == own.z { own.y } else { block.first.y };
            for y in from..to.y {
                self.row(level, UVec3::new(block.first.x, y, z), block.count.x, self.at + 1);
            }
        }
    }

    /// Compares with all spheres of a coarser level.
    #[inline(always)]
    fn coarser_level(&mut self, level: &Placed) {
        let (center, radius) = self.sphere();
        let block = level.raster.block(center, radius);
        if level.raster.folded {
            return self.folded(level, block, 0);
        }
        let to = block.first + block.count;
        for z in block.first.z..to.z {
            for y in block.first.y..to.y {
                self.row(level, UVec3::new(block.first.x, y, z), block.count.x, 0);
            }
        }
    }

    /// Rows of a raster that wraps around. No axis is visited more often than it has cells, so no row is met twice.
    #[inline(never)]
    fn folded(&mut self, level: &Placed, block: Block, from: usize) {
        let size = level.raster.size;
        let before = block.count.x.min(size.x - block.first.x);
        for z in 0..block.count.z {
            for y in 0..block.count.y {
                let (y, z) = ((block.first.y + y) % size.y, (block.first.z + z) % size.z);
                self.row(level, UVec3::new(block.first.x, y, z), before, from);
                if before < block.count.x {
                    self.row(level, UVec3::new(0, y, z), block.count.x - before, from);
                }
            }
        }
    }

    /// Compares with the spheres in `count` cells from `first` on, those before place `from` left out.
    #[inline(always)]
    fn row(&mut self, level: &Placed, first: UVec3, count: u32, from: usize) {
        let cell = level.base + level.raster.index(first);
        let start = self.list.starts[cell] as usize;
        let end = self.list.starts[cell + count as usize] as usize;
        let run = start.max(from)..end;
        if !run.is_empty() {
            scan(self.vector, (&self.list.columns, self.rule), self.at, run, self.sink);
        }
    }
}
