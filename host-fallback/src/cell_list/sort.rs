//! Sorts spheres by cell, in two passes: into buckets of neighbouring cells, then within each bucket.
//!
//! A single counting sort over all cells would write to as many places as there are cells and miss every cache once
//! the input outgrows it. Buckets are few enough for the first pass to keep their ends in cache, and small enough
//! for the second to happen in cache. Both passes are stable, so the order is the same for any number of threads.

use bytemuck::Zeroable;
use glam::Vec3;
use rayon::prelude::*;

use super::Places;
use crate::Error;
use crate::columns::{Columns, ColumnsMut, reserve, resize};
use crate::contact::Rule;
use crate::detector::Input;
use crate::scatter::{Disjoint, split_at};
use crate::simd::{Task, Vector};

/// Spheres per piece of the first pass.
const PIECE: usize = 1 << 16;
/// Spheres per bucket aimed at: 48 KiB of entries.
const BUCKET: usize = 1 << 11;
/// The most buckets: one cache line each stays in the second-level cache.
const MAX_BUCKETS: usize = 1 << 11;

/// A sphere on its way to its place.
#[derive(Clone, Copy, Debug, Default, Zeroable)]
#[repr(C)]
struct Entry {
    center: Vec3,
    radius: f32,
    id: u32,
    key: u32,
}

/// Buffers that survive between calls.
#[derive(Debug, Default)]
pub(super) struct Sorter {
    keys: Vec<u32>,
    entries: Vec<Entry>,
}

impl Sorter {
    pub(super) const BYTES_PER_SPHERE: u64 = 4 + size_of::<Entry>() as u64;

    /// Sees to it that [`sort`](Self::sort) will have the memory.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    pub(super) fn reserve(
        &mut self,
        (spheres, cells): (usize, usize),
        columns: &mut Columns,
        starts: &mut Vec<u32>,
    ) -> Result<(), Error> {
        reserve(&mut self.keys, spheres, "cells of spheres")?;
        reserve(&mut self.entries, spheres, "sorting spheres")?;
        reserve(starts, cells + Self::BEHIND, "the table of cells")?;
        columns.reserve(spheres)
    }

    /// Entries of `starts` behind those of the cells.
    pub(super) const BEHIND: usize = 3;

    /// Fills `columns` with the spheres sorted by cell, and `starts[k]` with the place of the first sphere of cell
    /// `k` or later, for `k` up to and including the number of cells; the rest of `starts` is their end as well.
    pub(super) fn sort(
        &mut self,
        input: &Input<'_>,
        places: Places<'_>,
        columns: &mut Columns,
        starts: &mut Vec<u32>,
    ) {
        let (n, cells) = (input.survey.spheres, places.cells());
        let wanted = (n / BUCKET).next_power_of_two().min(MAX_BUCKETS);
        let shift = cells.div_ceil(wanted).next_power_of_two().trailing_zeros();
        let buckets = cells.div_ceil(1 << shift).max(1);
        resize(&mut self.keys, n);
        resize(&mut self.entries, n);
        starts.clear();
        resize(starts, cells + Self::BEHIND);

        let ends = self.spread(input, places, (shift, buckets));
        let ColumnsMut { xyzr, id } = columns.resize(n);
        let [x, y, z, r] = xyzr.map(|column| split_at(column, ends.iter().copied()));
        let id = split_at(id, ends.iter().copied());
        let cells = split_at(&mut starts[1..=cells], (1..=buckets).map(|k| cells.min(k << shift)));
        let entries = split_at(&mut self.entries, ends.iter().copied());
        let columns = x.into_par_iter().zip(y).zip(z).zip(r).zip(id);
        entries.into_par_iter().zip(cells).zip(columns).enumerate().for_each(
            |(bucket, ((entries, cells), ((((x, y), z), r), id)))| {
                let first = bucket << shift;
                count(entries, first, cells);
                for entry in entries.iter() {
                    let next = &mut cells[entry.key as usize - first];
                    let at = *next as usize;
                    *next += 1;
                    (x[at], y[at], z[at]) = (entry.center.x, entry.center.y, entry.center.z);
                    (r[at], id[at]) = (entry.radius, entry.id);
                }
                // Each has moved to the end of its cell, which is where the next cell starts.
                let before = (ends[bucket] - entries.len()) as u32;
                cells.iter_mut().for_each(|end| *end += before);
            },
        );
        starts[1 + places.cells()..].fill(n as u32);
    }

    /// The first pass; returns where each bucket ends.
    fn spread(
        &mut self,
        input: &Input<'_>,
        places: Places<'_>,
        (shift, buckets): (u32, usize),
    ) -> Vec<usize> {
        let counted = self.keys.par_chunks_mut(PIECE).enumerate().map(|(piece, keys)| {
            let keys = &mut *keys;
            input.simd.run(Keys { rule: &input.rule, places, first: piece * PIECE, keys }, None);
            let mut counts = vec![0_u32; buckets];
            for key in keys {
                counts[(*key >> shift) as usize] += 1;
            }
            counts
        });
        let mut offsets: Vec<Vec<u32>> = counted.collect();
        let mut at = 0;
        let mut ends = Vec::with_capacity(buckets);
        for bucket in 0..buckets {
            for piece in &mut offsets {
                at += std::mem::replace(&mut piece[bucket], at);
            }
            ends.push(at as usize);
        }

        let entries = Disjoint::new(&mut self.entries);
        self.keys.par_chunks(PIECE).zip(offsets).enumerate().for_each(|(piece, (keys, mut next))| {
            let mut place = |key: u32, id: usize, (center, radius): (Vec3, f32)| {
                let slot = &mut next[(key >> shift) as usize];
                // SAFETY: the exclusive prefix sums over (bucket, piece) give every sphere a slot of its own below
                // their number, the length of `entries`.
                unsafe { entries.write(*slot as usize, Entry { center, radius, id: id as u32, key }) };
                *slot += 1;
            };
            let ids = piece * PIECE..;
            match input.rule.plain_rows() {
                Some(rows) => {
                    let rows = &rows[ids.start..];
                    for ((&key, id), sphere) in keys.iter().zip(ids).zip(rows) {
                        place(key, id, (sphere.center, sphere.radius));
                    }
                }
                None => {
                    for (&key, id) in keys.iter().zip(ids) {
                        place(key, id, input.rule.effective(id as u32));
                    }
                }
            }
        });
        ends
    }
}

/// Finds the cells of the spheres from `first` on.
struct Keys<'k> {
    rule: &'k Rule<'k>,
    places: Places<'k>,
    first: usize,
    keys: &'k mut [u32],
}

impl Task for Keys<'_> {
    type Result = ();

    #[inline(always)]
    fn run<V: Vector>(self, vector: V) {
        match self.rule.plain_rows() {
            Some(rows) => {
                for (key, sphere) in self.keys.iter_mut().zip(&rows[self.first..]) {
                    *key = self.places.cell_of(vector, bytemuck::cast(*sphere));
                }
            }
            None => {
                for (key, id) in self.keys.iter_mut().zip(self.first..) {
                    let (center, radius) = self.rule.effective(id as u32);
                    *key = self.places.cell_of(vector, [center.x, center.y, center.z, radius]);
                }
            }
        }
    }
}

/// Turns the cells of one bucket into where their spheres start, counted from the bucket's first sphere.
fn count(entries: &[Entry], first: usize, cells: &mut [u32]) {
    for entry in entries {
        cells[entry.key as usize - first] += 1;
    }
    let mut at = 0;
    for cell in cells {
        at += std::mem::replace(cell, at);
    }
}
