//! Candidates of a step: pairs whose random draws select a reaction.
//!
//! Crowds have far more candidates than particles, so only the best are retained. The matching then samples unconsumed
//! particles again.

use lazygrid::Pair;
use rayon::prelude::*;

use crate::Error;
use crate::model::particles::Particles;
use crate::random::philox::{DrawContext, Purpose, StepKey};
use crate::reaction::matching::{Key, ReactionCandidate};
use crate::reaction::{ReactionRule, Reactions, distance_squared};

#[derive(Clone, Copy, Debug)]
pub struct StepPairs<'a> {
    pub particles: &'a Particles,
    pub pairs: &'a [Pair],
    /// Ascending ids of particles that do not dissociate, though their random words say so.
    pub spared: &'a [u32],
    pub now: StepKey,
}

/// The best candidates, in bounded memory.
#[derive(Debug)]
pub struct BestCandidates {
    pub(crate) candidates: Vec<ReactionCandidate>,
    capacity: usize,
    /// Worst retained key; `None` if no candidate was dropped.
    pub(crate) bound: Option<Key>,
}

/// Capacity per particle. With four, few particles are left for another pass.
const CANDIDATES_PER_PARTICLE: usize = 4;
const MIN_CAPACITY: usize = 1 << 14;
/// The matching stores indices of candidates in 32 bits, and needs two more numbers.
const MAX_CAPACITY: usize = u32::MAX as usize - 1;
/// Bit of a pair's fourth random word for the order of equal reactants. The angle between products uses that word
/// without its lowest eight bits.
const ORDER_BIT: u32 = 1;
const CHUNK: usize = 4096;
const PAIRS_PER_BLOCK: usize = 64 * CHUNK;

impl BestCandidates {
    pub fn new(particles: usize) -> Self {
        let capacity = particles.saturating_mul(CANDIDATES_PER_PARTICLE).clamp(MIN_CAPACITY, MAX_CAPACITY);
        Self { candidates: Vec::new(), capacity, bound: None }
    }

    /// Adds candidates. Above the capacity, keeps the best half of it.
    ///
    /// # Errors
    /// [`Error::OutOfCandidateMemory`] if the memory is refused.
    pub fn extend(&mut self, more: &[ReactionCandidate]) -> Result<(), Error> {
        let candidates = self.candidates.len() + more.len();
        let bytes = (candidates * size_of::<ReactionCandidate>()) as u64;
        let refused = |_| Error::OutOfCandidateMemory { candidates: candidates as u64, bytes };
        self.candidates.try_reserve(more.len()).map_err(refused)?;
        let bound = self.bound;
        let is_within = |candidate: &&ReactionCandidate| bound.is_none_or(|bound| candidate.key() <= bound);
        self.candidates.extend(more.iter().filter(is_within));
        if self.candidates.len() > self.capacity {
            let last = self.capacity / 2;
            let (_, &mut worst, _) = self.candidates.select_nth_unstable_by_key(last, ReactionCandidate::key);
            self.candidates.truncate(last + 1);
            self.bound = Some(worst.key());
        }
        Ok(())
    }

    pub(crate) fn restrict(&mut self, bound: Key) {
        self.candidates.retain(|candidate| candidate.key() <= bound);
        self.bound = Some(bound);
    }
}

impl Reactions {
    /// Adds to `best` the candidates that consume unconsumed particles only.
    ///
    /// # Errors
    /// See [`BestCandidates::extend`].
    pub fn sample(
        &self,
        pairs: StepPairs<'_>,
        is_consumed: impl Fn(u32) -> bool + Sync,
        best: &mut BestCandidates,
    ) -> Result<(), Error> {
        if self.is_empty() {
            return Ok(());
        }
        for block in pairs.pairs.chunks(PAIRS_PER_BLOCK) {
            let bound = best.bound;
            let candidate = |&pair: &Pair| {
                let candidate = self.candidate(pairs, pair, &is_consumed)?;
                bound.is_none_or(|bound| candidate.key() <= bound).then_some(candidate)
            };
            let chunk = |pairs: &[Pair]| pairs.iter().filter_map(candidate).collect::<Vec<_>>();
            for chunk in block.par_chunks(CHUNK).map(chunk).collect::<Vec<_>>() {
                best.extend(&chunk)?;
            }
        }
        Ok(())
    }

    fn candidate(
        &self,
        StepPairs { particles, spared, now, .. }: StepPairs<'_>,
        pair: Pair,
        is_consumed: impl Fn(u32) -> bool,
    ) -> Option<ReactionCandidate> {
        let (i, j) = (pair.i as usize, pair.j as usize);
        let (a, b) = (particles.species[i], particles.species[j]);
        let shell = match self.shells(a, b) {
            [] => return None,
            [shell] if shell.within.is_none() => shell,
            shells => {
                let apart = distance_squared(particles, pair, &self.boundary);
                let is_inside = |radius: f32| apart <= f64::from(radius) * f64::from(radius);
                shells.iter().find(|shell| shell.within.is_none_or(is_inside))?
            }
        };
        let ids = [particles.id[i].min(particles.id[j]), particles.id[i].max(particles.id[j])];
        let candidate = |rule: &ReactionRule, priority, word| {
            // An order by id would favor early releases.
            let lower_first = !rule.draws_order || word & ORDER_BIT == 0;
            let in_order = if a == b { (particles.id[i] == ids[0]) == lower_first } else { a == rule.first };
            let at = if in_order { [pair.i, pair.j] } else { [pair.j, pair.i] };
            ReactionCandidate { at, consumes: rule.consumes, rule: rule.reaction, priority, ids }
        };
        let is_open = |candidate: &ReactionCandidate| !candidate.claimed().any(|at| is_consumed(at as u32));
        let may_be_open = |rule| [0, ORDER_BIT].into_iter().any(|word| is_open(&candidate(rule, 0, word)));
        if !shell.rules().any(may_be_open) {
            return None;
        }
        let [priority, chance, _, word] = now.for_particle(ids[0]).draw(ids[1], Purpose::Pair);
        let rule = shell.rules().find(|rule| chance <= rule.up_to)?;
        let dissociates = [(a, particles.id[i]), (b, particles.id[j])]
            .into_iter()
            .any(|(species, id)| self.dissociates(species, spared, now.for_particle(id)));
        Some(candidate(rule, priority, word)).filter(|candidate| !dissociates && is_open(candidate))
    }

    #[inline]
    fn dissociates(&self, species: u32, spared: &[u32], context: DrawContext) -> bool {
        let is_within = self.dissociation_of(species).is_some_and(|time| time.is_within(context));
        is_within && spared.binary_search(&context.id).is_err()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn candidates_of_a_pass_have_indices_of_32_bits() {
        let most = lazygrid::MAX_SPHERES as usize;
        assert_eq!(
            [1, 10_000, most].map(|n| BestCandidates::new(n).capacity),
            [16_384, 40_000, 4_294_967_294]
        );
    }
}
