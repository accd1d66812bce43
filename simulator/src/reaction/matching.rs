//! Choice of reactions among pairs that share particles.
//!
//! Keys are totally ordered. Each round takes the candidates that are best at all particles they consume. The result is
//! that of a sequential pass by key (Blelloch, Fineman and Shun, *Greedy sequential maximal independent set and
//! matching are parallel on average*, SPAA 2012).

use std::sync::atomic::{AtomicU32, Ordering};

use rayon::prelude::*;

use crate::Error;
use crate::reaction::candidates::BestCandidates;

/// A reaction that two particles may undergo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReactionCandidate {
    /// In the order of the reaction's reactants.
    pub at: [u32; 2],
    /// At least one is `true`.
    pub consumes: [bool; 2],
    /// Index in the model.
    pub rule: u32,
    /// Random; the lowest wins.
    pub priority: u32,
    /// Ascending ids, which break ties.
    pub ids: [u32; 2],
}

/// The lowest is the best.
pub(crate) type Key = (u32, [u32; 2]);

impl ReactionCandidate {
    pub(crate) fn key(&self) -> Key {
        (self.priority, self.ids)
    }

    pub(crate) fn claimed(&self) -> impl Iterator<Item = usize> {
        let Self { at, consumes, .. } = *self;
        (0..2).filter(move |&k| consumes[k]).map(move |k| at[k] as usize)
    }
}

#[derive(Debug, Default)]
pub struct Matching {
    /// Indexed by particle: 1 plus the index of the best candidate, [`NONE`] or [`TAKEN`].
    best: Vec<AtomicU32>,
}

#[derive(Clone, Copy, Debug)]
pub struct Consumed<'a>(&'a [AtomicU32]);

impl Consumed<'_> {
    #[inline]
    pub fn contains(self, particle: u32) -> bool {
        self.0[particle as usize].load(Ordering::Relaxed) == TAKEN
    }
}

const NONE: u32 = u32::MAX;
const TAKEN: u32 = 0;

const CHUNK: usize = 1024;
/// Particles per candidate of a window, so that few candidates share particles. Results do not depend on it.
const PARTICLES_PER_CANDIDATE: usize = 8;

impl Matching {
    /// `sample` adds candidates of unconsumed particles, and is called until the buffer drops none.
    ///
    /// # Errors
    /// Returns the errors of `sample`.
    pub fn greedy(
        &mut self,
        particles: usize,
        mut sample: impl FnMut(Consumed<'_>, &mut BestCandidates) -> Result<(), Error>,
    ) -> Result<Vec<ReactionCandidate>, Error> {
        if self.best.len() < particles {
            self.best.resize_with(particles, || AtomicU32::new(NONE));
        }
        let mut chosen = Vec::new();
        let result = loop {
            let mut best = BestCandidates::new(particles);
            if let Err(error) = sample(Consumed(&self.best), &mut best) {
                break Err(error);
            }
            let is_last = best.bound.is_none();
            self.choose(&mut best.candidates, &mut chosen);
            if is_last {
                break Ok(());
            }
        };
        let claimed = chosen.iter().flat_map(ReactionCandidate::claimed);
        claimed.for_each(|p| *self.best[p].get_mut() = NONE);
        result.map(|()| chosen)
    }

    fn choose(&self, candidates: &mut [ReactionCandidate], chosen: &mut Vec<ReactionCandidate>) {
        candidates.par_sort_unstable_by_key(ReactionCandidate::key);
        let (best, candidates) = (&self.best, &*candidates);
        let window = (best.len() / PARTICLES_PER_CANDIDATE).max(CHUNK);
        let mut all_winners = Vec::new();
        for first in (0..candidates.len()).step_by(window) {
            let last = (first + window).min(candidates.len());
            let mut active: Vec<u32> = (first as u32..last as u32).collect();
            while !active.is_empty() {
                let claimed = |c: u32| candidates[c as usize].claimed().map(|p| &best[p]);
                let in_parallel = || active.par_iter().with_min_len(CHUNK).copied();
                in_parallel().for_each(|c| {
                    claimed(c).for_each(|p| {
                        p.fetch_min(c + 1, Ordering::Relaxed);
                    });
                });
                let wins = |c: &u32| claimed(*c).all(|p| p.load(Ordering::Relaxed) == c + 1);
                let winners: Vec<u32> = in_parallel().filter(wins).collect();
                // A candidate is dropped when a better one takes one of its particles.
                let waits = |c: &u32| !wins(c) && claimed(*c).all(|p| p.load(Ordering::Relaxed) != TAKEN);
                let left: Vec<u32> = in_parallel().filter(waits).collect();
                all_winners.extend_from_slice(&winners);
                // Clears entries before winners set theirs.
                in_parallel().for_each(|c| {
                    let clear = |p: &AtomicU32| {
                        let _ = p.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |there| {
                            (there != TAKEN).then_some(NONE)
                        });
                    };
                    claimed(c).for_each(clear);
                });
                let taken = winners.par_iter().with_min_len(CHUNK);
                taken.for_each(|&c| claimed(c).for_each(|p| p.store(TAKEN, Ordering::Relaxed)));
                active = left;
            }
        }
        all_winners.sort_unstable();
        chosen.extend(all_winners.into_iter().map(|c| candidates[c as usize]));
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use proptest::prelude::*;

    use super::*;

    pub(crate) fn sequential(candidates: &[ReactionCandidate]) -> Vec<[u32; 2]> {
        let mut order: Vec<u32> = (0..candidates.len() as u32).collect();
        order.sort_by_key(|&c| candidates[c as usize].key());
        let mut taken = std::collections::HashSet::new();
        let mut chosen = Vec::new();
        for c in order {
            if candidates[c as usize].claimed().all(|p| !taken.contains(&p)) {
                taken.extend(candidates[c as usize].claimed());
                chosen.push(candidates[c as usize].ids);
            }
        }
        chosen
    }

    pub(crate) fn candidates() -> impl Strategy<Value = Vec<ReactionCandidate>> {
        let one = (0..40_u32, 1..40_u32, 0..8_u32, 0..6);
        prop::collection::vec(one, 0..300).prop_map(|many| {
            let mut seen = std::collections::HashSet::new();
            let mut all = Vec::new();
            for (a, by, priority, consumes) in many {
                let b = (a + by) % 41;
                let consumes = match consumes {
                    0 => [true, false],
                    1 => [false, true],
                    _ => [true, true],
                };
                let ids = [a.min(b), a.max(b)];
                if a != b && seen.insert(ids) {
                    all.push(ReactionCandidate { at: [a, b], consumes, rule: 0, priority, ids });
                }
            }
            all
        })
    }

    pub(crate) fn choose(
        matching: &mut Matching,
        candidates: &[ReactionCandidate],
        particles: usize,
    ) -> Vec<ReactionCandidate> {
        let sample = |consumed: Consumed<'_>, best: &mut BestCandidates| {
            let is_open =
                |c: &&ReactionCandidate| !c.claimed().any(|particle| consumed.contains(particle as u32));
            candidates.iter().filter(is_open).try_for_each(|c| best.extend(&[*c]))
        };
        matching.greedy(particles, sample).expect("memory")
    }

    fn chosen(matching: &mut Matching, candidates: &[ReactionCandidate], particles: usize) -> Vec<[u32; 2]> {
        choose(matching, candidates, particles).iter().map(|candidate| candidate.ids).collect()
    }

    pub(crate) fn crowd() -> Vec<ReactionCandidate> {
        let word = |[a, b]: [u32; 2]| (a * 4025 + b).wrapping_mul(0x9e37_79b9) >> 7;
        let candidate = |ids| ReactionCandidate {
            at: ids,
            consumes: [word(ids) % 64 == 0, true],
            rule: 0,
            priority: word(ids) >> 6,
            ids,
        };
        (0..25).flat_map(|a| (25..4025).map(move |b| candidate([a, b]))).collect()
    }

    proptest! {
        #[test]
        fn equals_the_sequential_greedy(candidates in candidates()) {
            let mut matching = Matching::default();
            let mut shuffled = candidates.clone();
            shuffled.reverse();
            let expected = sequential(&candidates);
            for candidates in [candidates, shuffled] {
                prop_assert_eq!(&chosen(&mut matching, &candidates, 41), &expected);
            }
        }
    }

    #[test]
    fn crowd_is_matched_in_several_passes() {
        let mut matching = Matching::default();
        let crowd = crowd();
        for _ in 0..2 {
            assert_eq!(chosen(&mut matching, &crowd, 4025), sequential(&crowd));
        }
    }

    #[test]
    fn many_candidates_in_parallel() {
        let word = |k: u32| k.wrapping_mul(0x9e37_79b9) >> 7;
        let candidate = |k: u32| {
            let (a, b) = (word(k) % 5_000, 5_000 + word(k ^ 0x5555) % 5_000);
            ReactionCandidate {
                at: [a, b],
                consumes: [true; 2],
                rule: 0,
                priority: word(k) & 255,
                ids: [a, b],
            }
        };
        let mut all: Vec<_> = (0..40_000).map(candidate).collect();
        all.sort_unstable_by_key(|c| c.ids);
        all.dedup_by_key(|c| c.ids);
        let expected = sequential(&all);
        assert_eq!(chosen(&mut Matching::default(), &all, 10_000), expected);
    }
}
