mod rebuild;

use std::sync::atomic::AtomicU64;

use glam::Vec3;
use lazygrid_kernels::{Pair, Query};

use super::advance::CHUNK_SPHERES;
use crate::Error;
use crate::cell_list::{CellList, CellListBuilder, SortRecord};
use crate::compare::{
    ChunkTarget, ChunkedOutput, MAX_LANES, Output, PairTest, SimdTask, SimdWidth, Sink, SkinMargin, Xyzr,
    memory_of_list, pair_at,
};
use crate::frame::SearchFrame;
use crate::input::{InputStats, SearchInput, SpeciesGroups, search_chunks};
use crate::memory::{prefetch, try_resize, with_growth};
use crate::report::{CandidateListStats, RebuildReason, Report};
use crate::settings::SKIN_RANGE;
use crate::species_classes::SpeciesClasses;

pub(super) type DisplacementLimits = SpeciesClasses;

/// Number of vectors of candidates that are prefetched ahead.
const PREFETCH_VECTORS: usize = 16;
/// Largest error of a minimum-image distance, as a fraction of the longest axis.
const BOUNDARY_ROUNDING: f32 = 1.0 / (1 << 20) as f32;
/// Maximum candidates per sphere in a list, 768 bytes; with more, every call searches. `cost_model` plans with at most
/// 64; a Lennard-Jones liquid with a cutoff of 3 σ and a skin of 0.3 σ has 63.
const MAX_CANDIDATES_PER_SPHERE: u64 = 96;
/// Largest radius of candidates. Displacement limits vanish next to larger radii.
const MAX_RADIUS: f32 = 1e30;
/// Displacement limits whose squares neither overflow nor underflow in `f32`.
pub(super) const LIMIT_RANGE: std::ops::RangeInclusive<f32> = 0.5 * *SKIN_RANGE.start()..=*SKIN_RANGE.end();

#[derive(Debug, Default)]
pub(crate) struct CandidateList {
    input_stats: Option<Box<InputStats>>,
    /// Other frames have other periods, so coordinates are not comparable.
    frame: Option<SearchFrame>,
    /// Length of the first of two sets.
    split: Option<usize>,
    /// Species of both sets, or of neither.
    species: Vec<u32>,
    species_version: u32,
    order: Vec<u32>,
    rows: Vec<Xyzr>,
    inverse: SpeciesClasses,
    /// Candidates, as positions in `order`.
    chunks: Vec<Vec<Pair>>,
    count: u64,
    age: u32,
    displacement_fraction: f32,
}

impl CandidateList {
    /// Bytes per sphere without species.
    const BYTES_PER_SPHERE: u64 = size_of::<Xyzr>() as u64 + 4;

    fn limit(spheres: u64, max_pairs: u64) -> u64 {
        max_pairs.min(spheres.saturating_mul(MAX_CANDIDATES_PER_SPHERE))
    }

    pub(crate) fn input_stats(&self) -> Option<&InputStats> {
        self.input_stats.as_deref()
    }

    /// Returns `true` if the query has as many sets, of the same species.
    pub(crate) fn have_species_of(&self, query: &Query<'_>, version: u32) -> bool {
        let first = query.first().species();
        let (first, second) = match query.second() {
            None => (first.unwrap_or(&[]), &[][..]),
            Some(second) => first.zip(second.species()).unwrap_or((&[], &[])),
        };
        self.input_stats.is_some()
            && (self.split, self.species_version) == (query.split(), version)
            && self.species.len() == first.len() + second.len()
            && self.species.starts_with(first)
            && self.species.ends_with(second)
    }

    pub(crate) fn clear(&mut self) {
        self.input_stats = None;
    }

    pub(crate) fn age(&self) -> (u32, f32) {
        (self.age, self.displacement_fraction)
    }

    pub(crate) fn stats(&self, rebuilt: Option<RebuildReason>) -> CandidateListStats {
        let Self { count, age, displacement_fraction, .. } = *self;
        CandidateListStats { count, age, displacement_fraction, rebuilt }
    }

    /// Returns `false`, without a list, above [`MAX_CANDIDATES_PER_SPHERE`] or the limit of a result, or if memory is
    /// refused.
    pub(crate) fn find(
        &mut self,
        builder: &mut CellListBuilder<'_>,
        input: &SearchInput<'_>,
        limits: &DisplacementLimits,
        report: &mut Report,
    ) -> Result<bool, Error> {
        let found = self.find_within_limit(builder, input, limits, report);
        if matches!(found, Ok(true)) {
            return found;
        }
        // The search without a list needs the memory.
        *self = Self::default();
        match found {
            Err(error @ Error::OutOfMemory { .. }) => {
                log::info!("searching without a candidate list: {error}");
                Ok(false)
            }
            other => other,
        }
    }

    fn find_within_limit(
        &mut self,
        builder: &mut CellListBuilder<'_>,
        input: &SearchInput<'_>,
        limits: &DisplacementLimits,
        report: &mut Report,
    ) -> Result<bool, Error> {
        self.clear();
        let test = input.test.widened(SkinMargin { limits, order: None });
        if !self.set_inverse(limits, &input.test)? || input.stats.largest_radius() > MAX_RADIUS {
            return Ok(false);
        }
        let stats = report.time("survey", || InputStats::from_test(&test, input.executor))?;
        let wide = |test, stats| SearchInput { test, stats, ..*input };
        let widened = wide(test, stats);
        let list = builder.build(&widened, report)?;
        report.time("keep", || self.store_reference(list, input))?;

        let test = input.test.widened(SkinMargin { limits, order: Some(&self.order) });
        let widened = wide(test, widened.stats);
        let limit = Self::limit(input.stats.spheres as u64, input.settings.max_pairs);
        let target = ChunkTarget::List { limit, collected: AtomicU64::new(0) };
        let output = ChunkedOutput::new(target, std::mem::take(&mut self.chunks));
        let (count, chunks) = report.time("candidates", || list.search(&widened, &output)?.finish())?;
        self.chunks = chunks;
        if count > limit {
            return Ok(false);
        }
        (self.count, self.age, self.displacement_fraction) = (count, 0, 0.0);
        (self.frame, self.split) = (input.test.frame().cloned(), input.split);
        self.input_stats = Some(Box::new(input.stats.clone()));
        Ok(true)
    }

    /// Stores inverse squares of limits minus the rounding of distances. Returns `false` if too little of a limit is
    /// left.
    fn set_inverse(&mut self, limits: &DisplacementLimits, test: &PairTest<'_>) -> Result<bool, Error> {
        let rounding = boundary_rounding(test);
        self.inverse.set_from(limits, |limit| (limit - rounding).powi(-2))?;
        Ok(limits.numbers().all(|limit| LIMIT_RANGE.contains(&limit) && rounding <= limit / 2.0))
    }

    fn store_reference(&mut self, list: &mut CellList, input: &SearchInput<'_>) -> Result<(), Error> {
        let n = input.stats.spheres;
        list.renumber(&mut self.order)?;
        try_resize(&mut self.rows, n, "spheres in the order of candidates")?;
        let ids = input.test.spheres().species().unwrap_or(&[]);
        try_resize(&mut self.species, ids.len(), "species of spheres")?;
        self.species.copy_from_slice(ids);
        self.species_version = input.groups.map_or(0, SpeciesGroups::version);
        let (order, test) = (&self.order, &input.test);
        input.executor.for_each_chunk(&mut self.rows, CHUNK_SPHERES, |chunk, rows| {
            for (row, &id) in rows.iter_mut().zip(&order[chunk * CHUNK_SPHERES..]) {
                *row = test.row(id);
            }
        });
        let (rows, inverse) = (&self.rows, &self.inverse);
        input.executor.for_each_chunk(list.notes_mut(), CHUNK_SPHERES, |chunk, notes| {
            let range = chunk * CHUNK_SPHERES..;
            for ((note, &[x, y, z, radius]), &id) in
                notes.iter_mut().zip(&rows[range.clone()]).zip(&order[range])
            {
                let inverse = inverse.get(test.species_of(id), radius);
                *note = SortRecord { row: [x, y, z, inverse], id, key: 0 };
            }
        });
        Ok(())
    }

    pub(crate) fn search<'o, O: Output>(
        &self,
        input: &SearchInput<'_>,
        output: &'o O,
    ) -> Result<O::Sink<'o>, Error> {
        search_chunks(output, input, self.chunks.len(), usize::MAX, |mut sink, k| {
            let Self { rows, order, chunks, .. } = self;
            let (pairs, test) = (&chunks[k], &input.test);
            input.run(CandidateTest { pairs, rows, order, test, sink: &mut sink });
            Ok(sink)
        })
    }
}

pub(crate) fn memory_of_candidates((spheres, has_species): (u64, bool), max_pairs: u64, threads: u64) -> u64 {
    let species = if has_species { size_of::<u32>() as u64 } else { 0 };
    let own = with_growth(spheres.saturating_mul(CandidateList::BYTES_PER_SPHERE + species));
    own.saturating_add(memory_of_list(CandidateList::limit(spheres, max_pairs), threads))
}

fn boundary_rounding(test: &PairTest<'_>) -> f32 {
    test.lengths().into_iter().flatten().fold(0.0, f32::max) * BOUNDARY_ROUNDING
}

pub(super) fn least_limit(test: &PairTest<'_>) -> f32 {
    LIMIT_RANGE.start().max(4.0 * boundary_rounding(test))
}

#[inline(always)]
pub(super) fn nearest(apart: Vec3, lengths: [Option<f32>; 3]) -> Vec3 {
    let mut apart = apart.abs();
    for (axis, length) in lengths.into_iter().enumerate() {
        if let Some(length) = length {
            apart[axis] = apart[axis].min((length - apart[axis]).abs());
        }
    }
    apart
}

/// Appends hits without a branch, because branches would be mispredicted.
struct CandidateTest<'t, S> {
    pairs: &'t [Pair],
    rows: &'t [Xyzr],
    order: &'t [u32],
    test: &'t PairTest<'t>,
    sink: &'t mut S,
}

struct HitBuffer {
    pairs: [Pair; Self::FULL + MAX_LANES],
    len: usize,
}

impl HitBuffer {
    /// Number of pairs at or above which the buffer is written: 4 KiB, a small part of the first-level cache.
    const FULL: usize = 512;

    #[inline(always)]
    fn keep<V: SimdWidth>(&mut self, vector: V, pairs: &[Pair; MAX_LANES], lanes: u32) -> bool {
        if let Some(slots) = self.pairs[self.len..].first_chunk_mut() {
            self.len += vector.compact(pairs, lanes, slots);
        }
        self.len >= Self::FULL
    }

    fn take(&mut self) -> &[Pair] {
        &self.pairs[..std::mem::take(&mut self.len)]
    }
}

impl<S: Sink> CandidateTest<'_, S> {
    #[inline(always)]
    fn vector<V: SimdWidth>(
        &mut self,
        vector: V,
        pairs: &[Pair; MAX_LANES],
        live: u32,
        hit_buffer: &mut HitBuffer,
    ) {
        let [possible, certain] = vector.touching(self.rows, pairs);
        let hits = match self.test.is_plain() && possible == certain {
            true => certain & live,
            false => self.decide(pairs, [possible & live, certain & live]),
        };
        if hit_buffer.keep(vector, pairs, hits) {
            self.sink.pairs_at(hit_buffer.take(), self.order);
        }
    }

    #[inline(never)]
    fn decide(&self, pairs: &[Pair; MAX_LANES], [possible, certain]: [u32; 2]) -> u32 {
        let mut hits = if self.test.is_plain() { certain } else { 0 };
        let mut open = possible & !hits;
        while open != 0 {
            let lane = open.trailing_zeros();
            open &= open - 1;
            let pair = pairs[lane as usize];
            if let Some(filter) = self.test.triclinic() {
                let [a, b] = [pair.i, pair.j].map(|at| self.rows[at as usize]);
                let [possible, certain] = filter.touch(a, b);
                hits |= u32::from(certain) << lane;
                if certain || !possible {
                    continue;
                }
            }
            let Pair { i, j } = pair_at(pair, self.order);
            hits |= u32::from(self.test.is_pair(i, j)) << lane;
        }
        hits
    }
}

impl<S: Sink> SimdTask for CandidateTest<'_, S> {
    type Result = ();

    #[inline(always)]
    fn run<V: SimdWidth>(mut self, vector: V) {
        let mut hit_buffer = HitBuffer { pairs: [Pair::default(); _], len: 0 };
        let (vectors, rest) = self.pairs.as_chunks::<MAX_LANES>();
        for (k, pairs) in vectors.iter().enumerate() {
            for pair in vectors.get(k + PREFETCH_VECTORS).unwrap_or(pairs) {
                prefetch(self.rows, pair.j as usize);
            }
            self.vector(vector, pairs, u32::MAX, &mut hit_buffer);
        }
        if let [first, ..] = rest {
            let mut last = [*first; MAX_LANES];
            last[..rest.len()].copy_from_slice(rest);
            self.vector(vector, &last, (1 << rest.len()) - 1, &mut hit_buffer);
        }
        self.sink.pairs_at(hit_buffer.take(), self.order);
    }
}
