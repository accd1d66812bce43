use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering::Relaxed};

use glam::Vec3;
use lazygrid_kernels::Pair;

use crate::Error;
use crate::cell_list::{CellList, DensityCache, SortRecord};
use crate::compare::{
    ChunkTarget, ChunkedOutput, MAX_LANES, Output, PairTest, SimdTask, SimdWidth, Sink, SkinMargin, Xyzr,
    at_places, memory_of_list, prefetch,
};
use crate::executor::Executor;
use crate::input::InputStats;
use crate::input::{SearchInput, search_pieces};
use crate::memory::{try_resize, with_growth};
use crate::report::{CandidateListStats, RebuildReason, Report};
use crate::settings::SKIN_RANGE;
use crate::size_class::{SIZE_CLASSES, class_of};

/// The displacement limit of the spheres of each size class.
pub(super) type DisplacementLimits = [f32; SIZE_CLASSES];

/// Spheres that are asked for ahead of their turn: they lie all over memory.
const PREFETCH_SPHERES: usize = 128;
/// Vectors of candidates after which those come whose spheres are asked for.
const PREFETCH_VECTORS: usize = 16;
/// Spheres per piece of the pass that measures how far they have gone.
const CHUNK_SPHERES: usize = 1 << 13;
/// The part of its allowance that a sphere may use up: less than all of it by more than rounding in `f32` can hide.
const USABLE_FRACTION: f32 = 1.0 - 1.0 / (1 << 16) as f32;
/// The largest rounding error of a distance between nearest images, as a part of the longest axis.
const BOUNDARY_ROUNDING: f32 = 1.0 / (1 << 20) as f32;
/// The most candidates per sphere that are kept, 768 bytes. A skin with more is not used, and every call searches. `worth`
/// plans with 64 at most; a Lennard-Jones liquid with a cutoff of 3 σ and a skin of 0.3 σ has 63.
const MAX_CANDIDATES_PER_SPHERE: u64 = 96;
/// Radii from which allowances may be lost in them.
const MAX_RADIUS: f32 = 1e30;
/// Allowances whose squares `f32` holds with room to spare.
pub(super) const LIMIT_RANGE: std::ops::RangeInclusive<f32> = 0.5 * *SKIN_RANGE.start()..=*SKIN_RANGE.end();

/// The allowances of a fixed skin: half of it for every sphere.
pub(super) fn fixed(distance: f32) -> DisplacementLimits {
    [distance / 2.0; SIZE_CLASSES]
}

/// The candidates and where spheres were when they were found.
#[derive(Debug, Default)]
pub(crate) struct CandidateList {
    /// The survey of the spheres when the candidates were found; `None` if there are no candidates.
    input_stats: Option<Box<InputStats>>,
    species: Vec<u32>,
    /// Which sphere stands at which place; spheres that are near each other have near places.
    order: Vec<u32>,
    /// The spheres of this call, place by place.
    rows: Vec<Xyzr>,
    /// Pairs of places.
    chunks: Vec<Vec<Pair>>,
    count: u64,
    age: u32,
    displacement_fraction: f32,
}

impl CandidateList {
    /// Bytes per sphere besides the candidates themselves.
    const BYTES_PER_SPHERE: u64 = size_of::<Xyzr>() as u64 + 4;

    /// The most candidates of `spheres` spheres that are kept.
    fn limit(spheres: u64, max_pairs: u64) -> u64 {
        max_pairs.min(spheres.saturating_mul(MAX_CANDIDATES_PER_SPHERE))
    }

    /// The survey of the spheres when the candidates were found, if there are any.
    pub(crate) fn input_stats(&self) -> Option<&InputStats> {
        self.input_stats.as_deref()
    }

    /// Gives the candidates up.
    pub(crate) fn clear(&mut self) {
        self.input_stats = None;
    }

    /// The number of calls that they have served, and the largest fraction of a displacement limit that is used up.
    pub(crate) fn age(&self) -> (u32, f32) {
        (self.age, self.displacement_fraction)
    }

    /// Their statistics for the report.
    pub(crate) fn stats(&self, rebuilt: Option<RebuildReason>) -> CandidateListStats {
        CandidateListStats {
            count: self.count,
            age: self.age,
            displacement_fraction: self.displacement_fraction,
            rebuilt,
        }
    }

    /// Measures how far the spheres have moved. Returns why the candidates cannot serve this call, or `None` if they can.
    /// `list` holds the positions for which the candidates were found.
    ///
    /// Candidates that cannot serve are given up here, before the call can end in any other way: a later call must never
    /// be served by candidates that an earlier one found to have expired.
    pub(crate) fn update_displacements(
        &mut self,
        test: &PairTest<'_>,
        list: &CellList,
        executor: Executor,
    ) -> Option<RebuildReason> {
        let spheres = test.spheres();
        let Some(input_stats) = self.input_stats.take() else { return Some(RebuildReason::NoList) };
        if spheres.len() != self.order.len() || spheres.species().unwrap_or(&[]) != self.species {
            return Some(RebuildReason::InputChanged);
        }
        let then = list.notes();
        let (farthest, changed) = (AtomicU32::new(0), AtomicBool::new(false));
        executor.for_each_chunk(&mut self.rows, CHUNK_SPHERES, |piece, rows| {
            let (part, differs) = advance(test, &then[piece * CHUNK_SPHERES..], rows);
            // Bits of numbers that are not negative are in the order of the numbers.
            farthest.fetch_max(part.to_bits(), Relaxed);
            changed.fetch_or(differs, Relaxed);
        });
        self.displacement_fraction = f32::from_bits(farthest.into_inner()).sqrt();
        self.age += 1;
        match (changed.into_inner(), self.displacement_fraction <= USABLE_FRACTION) {
            (true, _) => Some(RebuildReason::InputChanged),
            (false, false) => Some(RebuildReason::Displacement),
            (false, true) => {
                // The radii were those of every call since the candidates were found, this one included.
                self.input_stats = Some(input_stats);
                None
            }
        }
    }

    /// Finds candidates and builds the list of all spheres for it. Returns `false`, and holds no candidates, if they are
    /// more than [`MAX_CANDIDATES_PER_SPHERE`] or than a result may hold, or if memory for them is refused.
    ///
    /// # Errors
    /// [`Error::Cancelled`], [`Error::ThreadPool`].
    pub(crate) fn find(
        &mut self,
        (list, density_cache): (&mut CellList, &DensityCache),
        input: &SearchInput<'_>,
        limits: &DisplacementLimits,
        report: &mut Report,
    ) -> Result<bool, Error> {
        let found = self.find_within_limit((list, density_cache), input, limits, report);
        if matches!(found, Ok(true)) {
            return found;
        }
        // The memory is needed for the search that follows.
        *self = Self::default();
        match found {
            Err(error @ Error::OutOfMemory { .. }) => {
                log::info!("no candidates are kept: {error}");
                Ok(false)
            }
            other => other,
        }
    }

    fn find_within_limit(
        &mut self,
        (list, density_cache): (&mut CellList, &DensityCache),
        input: &SearchInput<'_>,
        limits: &DisplacementLimits,
        report: &mut Report,
    ) -> Result<bool, Error> {
        self.clear();
        let test = input.test.widened(SkinMargin { by_class: limits, order: None });
        let Some(inverse) = inverse_squares(limits, &input.test) else { return Ok(false) };
        if input.stats.largest_radius() > MAX_RADIUS {
            return Ok(false);
        }
        let stats = report.time("survey", || InputStats::of(&test, input.executor))?;
        let wide = |test, stats| SearchInput { test, stats, ..*input };
        let widened = wide(test, stats);
        list.build(&widened, density_cache, report)?;
        report.time("keep", || self.place(list, input, &inverse))?;

        let test = input.test.widened(SkinMargin { by_class: limits, order: Some(&self.order) });
        let widened = wide(test, widened.stats);
        self.chunks.iter_mut().for_each(Vec::clear);
        let limit = Self::limit(input.stats.spheres as u64, input.settings.max_pairs);
        let kept = ChunkTarget::List { limit, kept: AtomicU64::new(0) };
        let output = ChunkedOutput::new(kept, std::mem::take(&mut self.chunks));
        let (count, chunks) = report.time("candidates", || list.search(&widened, &output)?.finish())?;
        self.chunks = chunks;
        if count > limit {
            return Ok(false);
        }
        (self.count, self.age, self.displacement_fraction) = (count, 0, 0.0);
        self.input_stats = Some(Box::new(input.stats.clone()));
        Ok(true)
    }

    /// Takes over the order of the list, and where its spheres are.
    fn place(
        &mut self,
        list: &mut CellList,
        input: &SearchInput<'_>,
        inverse: &DisplacementLimits,
    ) -> Result<(), Error> {
        let n = input.stats.spheres;
        list.renumber(&mut self.order)?;
        try_resize(&mut self.rows, n, "spheres in the order of candidates")?;
        let ids = input.test.spheres().species().unwrap_or(&[]);
        try_resize(&mut self.species, ids.len(), "species of spheres")?;
        self.species.copy_from_slice(ids);
        let (order, test) = (&self.order, &input.test);
        input.executor.for_each_chunk(&mut self.rows, CHUNK_SPHERES, |piece, rows| {
            for (row, &id) in rows.iter_mut().zip(&order[piece * CHUNK_SPHERES..]) {
                *row = test.row(id);
            }
        });
        let rows = &self.rows;
        input.executor.for_each_chunk(list.notes_mut(), CHUNK_SPHERES, |piece, notes| {
            let places = piece * CHUNK_SPHERES..;
            for ((note, &[x, y, z, radius]), &id) in
                notes.iter_mut().zip(&rows[places.clone()]).zip(&order[places])
            {
                let inverse = inverse[class_of(radius)];
                *note = SortRecord { center: [x, y, z].into(), radius: inverse, id, key: 0 };
            }
        });
        Ok(())
    }

    /// Finds all pairs among the candidates.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    pub(crate) fn search<'o, O: Output>(
        &self,
        input: &SearchInput<'_>,
        output: &'o O,
    ) -> Result<O::Sink<'o>, Error> {
        search_pieces((output, input), (self.chunks.len(), usize::MAX), |mut sink, k| {
            let Self { rows, order, .. } = self;
            let sink_of = &mut sink;
            input.run(CandidateTest {
                pairs: &self.chunks[k],
                rows,
                order,
                test: &input.test,
                sink: sink_of,
            });
            Ok(sink)
        })
    }
}

/// The most bytes held for `spheres` spheres without species and their candidates.
pub(crate) fn memory_of_candidates(spheres: u64, max_pairs: u64, threads: u64) -> u64 {
    let own = with_growth(spheres.saturating_mul(CandidateList::BYTES_PER_SPHERE));
    own.saturating_add(memory_of_list(CandidateList::limit(spheres, max_pairs), threads))
}

/// One over the square of each allowance, less what rounding may hide; none where that leaves nothing to go by.
fn inverse_squares(limits: &DisplacementLimits, test: &PairTest<'_>) -> Option<DisplacementLimits> {
    let longest = test.lengths().into_iter().flatten().fold(0.0, f32::max);
    let seam = longest * BOUNDARY_ROUNDING;
    let usable = limits.iter().all(|limit| LIMIT_RANGE.contains(limit) && seam <= limit / 2.0);
    usable.then(|| limits.map(|limit| (limit - seam).powi(-2)))
}

/// The distance of the nearest images of two positions along each axis.
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

/// Copies the spheres of this call to their places in `rows`. `then` holds where each was when the candidates were found,
/// and as its radius one over the square of its allowance. Returns the square of the largest fraction of its allowance
/// that a sphere has moved, or infinity if a sphere is not valid; and whether an effective radius has changed.
fn advance(test: &PairTest<'_>, then: &[SortRecord], rows: &mut [Xyzr]) -> (f32, bool) {
    let lengths = test.lengths();
    let periodic = lengths.iter().any(Option::is_some);
    let (mut farthest, mut changed, mut lost) = (0.0_f32, false, false);
    let mut step = |row: &mut Xyzr, then: &SortRecord, now: Xyzr| {
        let mut gone = Vec3::new(now[0], now[1], now[2]) - then.center;
        if periodic {
            gone = nearest(gone, lengths);
        }
        let part = gone.length_squared() * then.radius;
        lost |= part.is_nan();
        farthest = farthest.max(part);
        changed |= now[3].to_bits() != row[3].to_bits();
        *row = now;
    };
    let then = &then[..rows.len()];
    match test.plain_rows() {
        Some(spheres) => {
            let soon = then.iter().skip(PREFETCH_SPHERES).chain(std::iter::repeat(&then[0]));
            for ((row, then), soon) in rows.iter_mut().zip(then).zip(soon) {
                prefetch(spheres, soon.id as usize);
                step(row, then, bytemuck::cast(spheres[then.id as usize]));
            }
        }
        None => {
            let mut is_refused = false;
            for (row, then) in rows.iter_mut().zip(then) {
                step(row, then, test.row(then.id));
                // Of a sphere whose pairs depend on its species alone, the effective radius does not tell.
                is_refused |= !test.spheres().get(then.id as usize).is_valid();
            }
            lost |= is_refused;
        }
    }
    (if lost { f32::INFINITY } else { farthest }, changed)
}

/// Tests some candidates. Which of them touch no branch predictor can tell. So testing is kept apart from handing over: it
/// appends without a branch.
struct CandidateTest<'t, S> {
    pairs: &'t [Pair],
    rows: &'t [Xyzr],
    order: &'t [u32],
    test: &'t PairTest<'t>,
    sink: &'t mut S,
}

/// Pairs of places that touch and wait to be handed over.
struct HitBuffer {
    pairs: [Pair; Self::FULL + MAX_LANES],
    len: usize,
}

impl HitBuffer {
    /// The most before they are handed over: 4 KiB, a small part of the first-level cache.
    const FULL: usize = 512;

    /// Adds those pairs whose bits are set in `lanes`. Whether they must be handed over now.
    #[inline(always)]
    fn keep<V: SimdWidth>(&mut self, vector: V, pairs: &[Pair; MAX_LANES], lanes: u32) -> bool {
        if let Some(room) = self.pairs[self.len..].first_chunk_mut() {
            self.len += vector.keep(pairs, lanes, room);
        }
        self.len >= Self::FULL
    }

    fn take(&mut self) -> &[Pair] {
        &self.pairs[..std::mem::take(&mut self.len)]
    }
}

impl<S: Sink> CandidateTest<'_, S> {
    /// Tests as many as a vector holds; those whose bits in `live` are set count.
    #[inline(always)]
    fn vector<V: SimdWidth>(
        &mut self,
        vector: V,
        pairs: &[Pair; MAX_LANES],
        live: u32,
        held: &mut HitBuffer,
    ) {
        let [possible, certain] = vector.touching(self.rows, pairs);
        let hits = match self.test.is_plain() && possible == certain {
            true => certain & live,
            false => self.decide(pairs, [possible & live, certain & live]),
        };
        if held.keep(vector, pairs, hits) {
            self.sink.places(held.take(), self.order);
        }
    }

    /// Returns the candidates that are pairs, of those that are possible or certain.
    #[inline(never)]
    fn decide(&self, pairs: &[Pair; MAX_LANES], [possible, certain]: [u32; 2]) -> u32 {
        let mut hits = if self.test.is_plain() { certain } else { 0 };
        let mut open = possible & !hits;
        while open != 0 {
            let lane = open.trailing_zeros();
            open &= open - 1;
            let Pair { i, j } = at_places(pairs[lane as usize], self.order);
            hits |= u32::from(self.test.is_pair(i, j)) << lane;
        }
        hits
    }
}

impl<S: Sink> SimdTask for CandidateTest<'_, S> {
    type Result = ();

    #[inline(always)]
    fn run<V: SimdWidth>(mut self, vector: V) {
        let mut held = HitBuffer { pairs: [Pair::default(); _], len: 0 };
        let (vectors, rest) = self.pairs.as_chunks::<MAX_LANES>();
        for (k, pairs) in vectors.iter().enumerate() {
            for pair in vectors.get(k + PREFETCH_VECTORS).unwrap_or(pairs) {
                prefetch(self.rows, pair.j as usize);
            }
            self.vector(vector, pairs, u32::MAX, &mut held);
        }
        if let [first, ..] = rest {
            let mut last = [*first; MAX_LANES];
            last[..rest.len()].copy_from_slice(rest);
            self.vector(vector, &last, (1 << rest.len()) - 1, &mut held);
        }
        self.sink.places(held.take(), self.order);
    }
}
