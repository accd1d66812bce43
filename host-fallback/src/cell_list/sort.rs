//! Sorts spheres by cell, in two passes: into buckets of neighbouring cells, then within each bucket.
//!
//! A single counting sort over all cells would write to as many places as there are cells and miss every cache once
//! the input outgrows it. Buckets are few enough for the first pass to keep their ends in cache, and small enough
//! for the second to happen in cache. Both passes are stable, so the order is the same for any number of threads.

use glam::Vec3;
use rayon::prelude::*;

use crate::columns::Columns;
use crate::detector::Input;
use crate::scatter::{Disjoint, split_at};

/// Spheres per piece of the first pass.
const PIECE: usize = 1 << 16;
/// Spheres per bucket aimed at: 48 KiB of entries.
const BUCKET: usize = 1 << 11;
/// The most buckets: one cache line each stays in the second-level cache.
const MAX_BUCKETS: usize = 1 << 11;

/// A sphere on its way to its place.
#[derive(Clone, Copy, Debug, Default)]
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

    /// Fills `columns` with the spheres sorted by `key`, which is below `cells`, and `starts[k]` with the place of
    /// the first sphere of cell `k` or later, for `k` up to and including `cells`.
    pub(super) fn sort(
        &mut self,
        input: &Input<'_>,
        key: impl Fn(Vec3, f32) -> u32 + Sync,
        cells: usize,
        (columns, starts): (&mut Columns, &mut Vec<u32>),
    ) {
        let n = input.survey.spheres;
        let wanted = (n / BUCKET).next_power_of_two().min(MAX_BUCKETS);
        let shift = cells.div_ceil(wanted).next_power_of_two().trailing_zeros();
        let buckets = cells.div_ceil(1 << shift).max(1);
        self.keys.resize(n, 0);
        self.entries.resize(n, Entry::default());
        columns.resize(n);
        starts.clear();
        starts.resize(cells + 1, 0);

        let ends = self.spread(input, key, (shift, buckets));
        let [x, y, z, r] = [&mut columns.x, &mut columns.y, &mut columns.z, &mut columns.r]
            .map(|column| split_at(&mut column[..n], ends.iter().copied()));
        let id = split_at(&mut columns.id[..n], ends.iter().copied());
        let ends_of_cells = (1..=buckets).map(|k| cells.min(k << shift));
        let starts = split_at(&mut starts[1..], ends_of_cells);
        let sources = split_at(&mut self.entries, ends.iter().copied());
        let places = x.into_par_iter().zip(y).zip(z).zip(r).zip(id);
        sources.into_par_iter().zip(starts).zip(places).enumerate().for_each(
            |(bucket, ((source, starts), ((((x, y), z), r), id)))| {
                let first = bucket << shift;
                let offset = ends[bucket] - source.len();
                count(source, first, starts);
                for entry in source.iter() {
                    let slot = &mut starts[entry.key as usize - first];
                    let at = *slot as usize;
                    *slot += 1;
                    (x[at], y[at], z[at]) = (entry.center.x, entry.center.y, entry.center.z);
                    (r[at], id[at]) = (entry.radius, entry.id);
                }
                // Each count has moved to the end of its cell, which is where the next cell starts.
                starts.iter_mut().for_each(|end| *end += offset as u32);
            },
        );
    }

    /// The first pass; returns where each bucket ends.
    fn spread(
        &mut self,
        input: &Input<'_>,
        key: impl Fn(Vec3, f32) -> u32 + Sync,
        (shift, buckets): (u32, usize),
    ) -> Vec<usize> {
        let counted = self.keys.par_chunks_mut(PIECE).enumerate().map(|(piece, keys)| {
            let mut counts = vec![0_u32; buckets];
            for (k, slot) in keys.iter_mut().enumerate() {
                let (center, radius) = input.rule.effective((piece * PIECE + k) as u32);
                *slot = key(center, radius);
                counts[(*slot >> shift) as usize] += 1;
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
            for (k, &key) in keys.iter().enumerate() {
                let id = (piece * PIECE + k) as u32;
                let (center, radius) = input.rule.effective(id);
                let slot = &mut next[(key >> shift) as usize];
                // SAFETY: the exclusive prefix sums over (bucket, piece) give every sphere a slot of its own below
                // their number, the length of `entries`.
                unsafe { entries.write(*slot as usize, Entry { center, radius, id, key }) };
                *slot += 1;
            }
        });
        ends
    }
}

/// Turns the cells of one bucket into where their spheres start, counted from the bucket's first sphere.
fn count(source: &[Entry], first: usize, starts: &mut [u32]) {
    for entry in source {
        starts[entry.key as usize - first] += 1;
    }
    let mut at = 0;
    for start in starts {
        at += std::mem::replace(start, at);
    }
}
