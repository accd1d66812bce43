//! Candidates that outlive a call: pairs that may overlap until some sphere has moved too far.
//!
//! Every sphere has an *allowance*, how far it may go. Candidates are the pairs that touch when radii are larger by
//! those; as long as no sphere has gone farther than its own, every pair that touches is among them. So a call
//! measures how far the spheres have gone and tests the candidates, or else finds new ones. What is found never
//! depends on the allowances, only the time it takes.
//!
//! `motion` observes, `worth` chooses allowances, `forecast` remembers what came of it, `course` decides from call to call, this
//! file keeps and tests. The GPU keeps candidates of its own, and shares the first three.

mod course;
mod forecast;
mod motion;
#[cfg(test)]
mod tests;
mod worth;

use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering::Relaxed};

use glam::Vec3;
use lazygrid_kernels::Pair;

use crate::Error;
use crate::cell_list::{CellList, Entry, Outlook};
use crate::classes::{CLASSES, class_of};
use crate::compare::{
    MAX_LANES, Output, Row, Rule, Sink, Task, To, Vector, Widening, Written, at_places, memory_of_list,
    prefetch,
};
use crate::input::{Input, search_pieces};
use crate::memory::{resize, with_growth};
use crate::report::{Kept, Rebuilt, Report};
use crate::survey::Survey;
use crate::threads::Threads;

pub(crate) use course::Course;
pub use forecast::Forecast;
pub use worth::Costs;

/// The displacement limit of the spheres of each size class.
type Allowances = [f32; CLASSES];

/// Spheres that are asked for ahead of their turn: they lie all over memory.
const AHEAD: usize = 128;
/// Vectors of candidates after which those come whose spheres are asked for.
const SOON: usize = 16;
/// Spheres per piece of the pass that measures how far they have gone.
const PIECE: usize = 1 << 13;
/// The part of its allowance that a sphere may use up: less than all of it by more than rounding in `f32` can hide.
const USABLE: f32 = 1.0 - 1.0 / (1 << 16) as f32;
/// The largest rounding error of a distance between nearest images, as a part of the longest axis.
const SEAM: f32 = 1.0 / (1 << 20) as f32;
/// The most candidates per sphere that are kept, 768 bytes. A skin with more is not used, and every call searches. `worth`
/// plans with 64 at most; a Lennard-Jones liquid with a cutoff of 3 σ and a skin of 0.3 σ has 63.
const MAX_CANDIDATES_PER_SPHERE: u64 = 96;
/// Radii from which allowances may be lost in them.
const LARGEST: f32 = 1e30;
/// Allowances whose squares `f32` holds with room to spare.
const FINITE: std::ops::RangeInclusive<f32> = 5e-15..=1e17;
/// Fixed skins: those whose half is such an allowance.
pub const SKINS: std::ops::RangeInclusive<f32> = 2.0 * *FINITE.start()..=*FINITE.end();

/// The allowances of a fixed skin: half of it for every sphere.
fn fixed(distance: f32) -> Allowances {
    [distance / 2.0; CLASSES]
}

/// The candidates and where spheres were when they were found.
#[derive(Debug, Default)]
pub(crate) struct Candidates {
    /// The survey of the spheres when the candidates were found; `None` if there are no candidates.
    survey: Option<Box<Survey>>,
    species: Vec<u32>,
    /// Which sphere stands at which place; spheres that are near each other have near places.
    order: Vec<u32>,
    /// The spheres of this call, place by place.
    rows: Vec<Row>,
    /// Pairs of places.
    chunks: Vec<Vec<Pair>>,
    count: u64,
    age: u32,
    moved: f32,
}

impl Candidates {
    /// Bytes per sphere besides the candidates themselves.
    const BYTES_PER_SPHERE: u64 = size_of::<Row>() as u64 + 4;

    /// The most candidates of `spheres` spheres that are kept.
    fn limit(spheres: u64, max_pairs: u64) -> u64 {
        max_pairs.min(spheres.saturating_mul(MAX_CANDIDATES_PER_SPHERE))
    }

    /// The most bytes held for `spheres` spheres without species and their candidates.
    pub(crate) fn memory_for(spheres: u64, max_pairs: u64, threads: u64) -> u64 {
        let own = with_growth(spheres.saturating_mul(Self::BYTES_PER_SPHERE));
        own.saturating_add(memory_of_list(Self::limit(spheres, max_pairs), threads))
    }

    /// The survey of the spheres when the candidates were found, if there are any.
    pub(crate) fn survey(&self) -> Option<&Survey> {
        self.survey.as_deref()
    }

    /// Gives the candidates up.
    pub(crate) fn clear(&mut self) {
        self.survey = None;
    }

    /// The number of calls that they have served, and the largest fraction of a displacement limit that is used up.
    pub(crate) fn age(&self) -> (u32, f32) {
        (self.age, self.moved)
    }

    /// Their statistics for the report.
    pub(crate) fn kept(&self, rebuilt: Option<Rebuilt>) -> Kept {
        Kept { count: self.count, age: self.age, moved: self.moved, rebuilt }
    }

    /// Measures how far the spheres have moved. Returns why the candidates cannot serve this call, or `None` if they can.
    /// `list` holds the positions for which the candidates were found.
    ///
    /// Candidates that cannot serve are given up here, before the call can end in any other way: a later call must never
    /// be served by candidates that an earlier one found to have expired.
    pub(crate) fn refresh(&mut self, rule: &Rule<'_>, list: &CellList, threads: Threads) -> Option<Rebuilt> {
        let spheres = rule.spheres();
        let Some(survey) = self.survey.take() else { return Some(Rebuilt::First) };
        if spheres.len() != self.order.len() || spheres.species().unwrap_or(&[]) != self.species {
            return Some(Rebuilt::Changed);
        }
        let then = list.notes();
        let (farthest, changed) = (AtomicU32::new(0), AtomicBool::new(false));
        threads.each_stretch(&mut self.rows, PIECE, |piece, rows| {
            let (part, differs) = advance(rule, &then[piece * PIECE..], rows);
            // Bits of numbers that are not negative are in the order of the numbers.
            farthest.fetch_max(part.to_bits(), Relaxed);
            changed.fetch_or(differs, Relaxed);
        });
        self.moved = f32::from_bits(farthest.into_inner()).sqrt();
        self.age += 1;
        match (changed.into_inner(), self.moved <= USABLE) {
            (true, _) => Some(Rebuilt::Changed),
            (false, false) => Some(Rebuilt::Moved),
            (false, true) => {
                // The radii were those of every call since the candidates were found, this one included.
                self.survey = Some(survey);
                None
            }
        }
    }

    /// Finds candidates and builds the list of all spheres for it. Returns `false`, and holds no candidates, if they are
    /// more than [`MAX_CANDIDATES_PER_SPHERE`] or than a result may hold, or if memory for them is refused.
    ///
    /// # Errors
    /// [`Error::Stopped`], [`Error::Threads`].
    pub(crate) fn find(
        &mut self,
        (list, outlook): (&mut CellList, &Outlook),
        input: &Input<'_>,
        allowances: &Allowances,
        report: &mut Report,
    ) -> Result<bool, Error> {
        let found = self.find_within_limit((list, outlook), input, allowances, report);
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
        (list, outlook): (&mut CellList, &Outlook),
        input: &Input<'_>,
        allowances: &Allowances,
        report: &mut Report,
    ) -> Result<bool, Error> {
        self.clear();
        let rule = input.rule.widened(Widening { by_class: allowances, order: None });
        let Some(inverse) = inverse_squares(allowances, &input.rule) else { return Ok(false) };
        if input.survey.largest_radius() > LARGEST {
            return Ok(false);
        }
        let survey = report.time("survey", || Survey::of(&rule, input.threads))?;
        let wide = |rule, survey| Input { rule, survey, ..*input };
        let widened = wide(rule, survey);
        list.build(&widened, outlook, report)?;
        report.time("keep", || self.place(list, input, &inverse))?;

        let rule = input.rule.widened(Widening { by_class: allowances, order: Some(&self.order) });
        let widened = wide(rule, widened.survey);
        self.chunks.iter_mut().for_each(Vec::clear);
        let limit = Self::limit(input.survey.spheres as u64, input.settings.max_pairs);
        let kept = To::List { limit, kept: AtomicU64::new(0) };
        let output = Written::new(kept, std::mem::take(&mut self.chunks));
        let (count, chunks) = report.time("candidates", || list.search(&widened, &output)?.finish())?;
        self.chunks = chunks;
        if count > limit {
            return Ok(false);
        }
        (self.count, self.age, self.moved) = (count, 0, 0.0);
        self.survey = Some(Box::new(input.survey.clone()));
        Ok(true)
    }

    /// Takes over the order of the list, and where its spheres are.
    fn place(&mut self, list: &mut CellList, input: &Input<'_>, inverse: &Allowances) -> Result<(), Error> {
        let n = input.survey.spheres;
        list.renumber(&mut self.order)?;
        resize(&mut self.rows, n, "spheres in the order of candidates")?;
        let ids = input.rule.spheres().species().unwrap_or(&[]);
        resize(&mut self.species, ids.len(), "species of spheres")?;
        self.species.copy_from_slice(ids);
        let (order, rule) = (&self.order, &input.rule);
        input.threads.each_stretch(&mut self.rows, PIECE, |piece, rows| {
            for (row, &id) in rows.iter_mut().zip(&order[piece * PIECE..]) {
                *row = rule.row(id);
            }
        });
        let rows = &self.rows;
        input.threads.each_stretch(list.notes_mut(), PIECE, |piece, notes| {
            let places = piece * PIECE..;
            for ((note, &[x, y, z, radius]), &id) in
                notes.iter_mut().zip(&rows[places.clone()]).zip(&order[places])
            {
                let inverse = inverse[class_of(radius)];
                *note = Entry { center: [x, y, z].into(), radius: inverse, id, key: 0 };
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
        input: &Input<'_>,
        output: &'o O,
    ) -> Result<O::Sink<'o>, Error> {
        search_pieces((output, input), (self.chunks.len(), usize::MAX), |mut sink, k| {
            let Self { rows, order, .. } = self;
            let sink_of = &mut sink;
            input.run(Tests { pairs: &self.chunks[k], rows, order, rule: &input.rule, sink: sink_of });
            Ok(sink)
        })
    }
}

/// One over the square of each allowance, less what rounding may hide; none where that leaves nothing to go by.
fn inverse_squares(allowances: &Allowances, rule: &Rule<'_>) -> Option<Allowances> {
    let longest = rule.lengths().into_iter().flatten().fold(0.0, f32::max);
    let seam = longest * SEAM;
    let usable = allowances.iter().all(|allowance| FINITE.contains(allowance) && seam <= allowance / 2.0);
    usable.then(|| allowances.map(|allowance| (allowance - seam).powi(-2)))
}

/// The distance of the nearest images of two positions along each axis.
#[inline(always)]
fn nearest(apart: Vec3, lengths: [Option<f32>; 3]) -> Vec3 {
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
fn advance(rule: &Rule<'_>, then: &[Entry], rows: &mut [Row]) -> (f32, bool) {
    let lengths = rule.lengths();
    let periodic = lengths.iter().any(Option::is_some);
    let (mut farthest, mut changed, mut lost) = (0.0_f32, false, false);
    let mut step = |row: &mut Row, then: &Entry, now: Row| {
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
    match rule.plain_rows() {
        Some(spheres) => {
            let soon = then.iter().skip(AHEAD).chain(std::iter::repeat(&then[0]));
            for ((row, then), soon) in rows.iter_mut().zip(then).zip(soon) {
                prefetch(spheres, soon.id as usize);
                step(row, then, bytemuck::cast(spheres[then.id as usize]));
            }
        }
        None => {
            let mut is_refused = false;
            for (row, then) in rows.iter_mut().zip(then) {
                step(row, then, rule.row(then.id));
                // Of a sphere whose pairs depend on its species alone, the effective radius does not tell.
                is_refused |= !rule.spheres().get(then.id as usize).is_valid();
            }
            lost |= is_refused;
        }
    }
    (if lost { f32::INFINITY } else { farthest }, changed)
}

/// Tests some candidates. Which of them touch no branch predictor can tell. So testing is kept apart from handing over: it
/// appends without a branch.
struct Tests<'t, S> {
    pairs: &'t [Pair],
    rows: &'t [Row],
    order: &'t [u32],
    rule: &'t Rule<'t>,
    sink: &'t mut S,
}

/// Pairs of places that touch and wait to be handed over.
struct Held {
    pairs: [Pair; Self::FULL + MAX_LANES],
    len: usize,
}

impl Held {
    /// The most before they are handed over: 4 KiB, a small part of the first-level cache.
    const FULL: usize = 512;

    /// Adds those pairs whose bits are set in `lanes`. Whether they must be handed over now.
    #[inline(always)]
    fn keep<V: Vector>(&mut self, vector: V, pairs: &[Pair; MAX_LANES], lanes: u32) -> bool {
        if let Some(room) = self.pairs[self.len..].first_chunk_mut() {
            self.len += vector.keep(pairs, lanes, room);
        }
        self.len >= Self::FULL
    }

    fn take(&mut self) -> &[Pair] {
        &self.pairs[..std::mem::take(&mut self.len)]
    }
}

impl<S: Sink> Tests<'_, S> {
    /// Tests as many as a vector holds; those whose bits in `live` are set count.
    #[inline(always)]
    fn vector<V: Vector>(&mut self, vector: V, pairs: &[Pair; MAX_LANES], live: u32, held: &mut Held) {
        let [possible, certain] = vector.touching(self.rows, pairs);
        let hits = match self.rule.is_plain() && possible == certain {
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
        let mut hits = if self.rule.is_plain() { certain } else { 0 };
        let mut open = possible & !hits;
        while open != 0 {
            let lane = open.trailing_zeros();
            open &= open - 1;
            let Pair { i, j } = at_places(pairs[lane as usize], self.order);
            hits |= u32::from(self.rule.pairs(i, j)) << lane;
        }
        hits
    }
}

impl<S: Sink> Task for Tests<'_, S> {
    type Result = ();

    #[inline(always)]
    fn run<V: Vector>(mut self, vector: V) {
        let mut held = Held { pairs: [Pair::default(); _], len: 0 };
        let (vectors, rest) = self.pairs.as_chunks::<MAX_LANES>();
        for (k, pairs) in vectors.iter().enumerate() {
            for pair in vectors.get(k + SOON).unwrap_or(pairs) {
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
