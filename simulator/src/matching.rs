//! Which candidate pairs have their turn, where particles are in several: a greedy choice by random priority, found
//! in parallel.
//!
//! Every candidate has a key, and keys are totally ordered. In each round those candidates are taken that are best
//! at all particles they claim; repeated until none is left, that is the same choice as going through all
//! candidates from the best to the worst (Blelloch, Fineman and Shun, *Greedy sequential maximal independent set and
//! matching are parallel on average*, SPAA 2012). The keys alone decide: neither the order of candidates nor the
//! number of threads does.

use std::sync::atomic::{AtomicU32, Ordering};

use rayon::prelude::*;

/// Two particles that may do something with each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Candidate {
    /// Where the particles are.
    pub at: [u32; 2],
    /// Whether the candidate needs each of them for itself. It must need one at least.
    pub claims: [bool; 2],
    /// What would happen, for the caller to know.
    pub rule: u32,
    /// The priority; the lowest is the best.
    pub priority: u32,
    /// The ids, the lower one first; they decide between equal priorities.
    pub ids: [u32; 2],
}

impl Candidate {
    fn key(&self) -> (u32, [u32; 2]) {
        (self.priority, self.ids)
    }

    fn claimed(&self) -> impl Iterator<Item = usize> {
        let Self { at, claims, .. } = *self;
        (0..2).filter(move |&k| claims[k]).map(move |k| at[k] as usize)
    }
}

/// What becomes of the other candidates of a particle that had its turn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Afterwards {
    /// They are dropped: a particle has one turn.
    Dropped,
    /// They have their turn later: candidates that share a particle come one after the other.
    Queued,
}

/// Finds rounds of candidates that do not get in each other's way.
#[derive(Debug, Default)]
pub struct Matching {
    /// By place of a particle: the best candidate so far, or one of the values below.
    best: Vec<AtomicU32>,
    active: Vec<u32>,
}

const NONE: u32 = u32::MAX;
const TAKEN: u32 = u32::MAX - 1;

/// Fewer candidates than this are not worth a task.
const TASK: usize = 1024;

impl Matching {
    /// Goes through the rounds of these candidates among `particles` particles and hands each round over, as places
    /// in `candidates` in ascending order.
    pub fn rounds(
        &mut self,
        candidates: &[Candidate],
        particles: usize,
        afterwards: Afterwards,
        mut turn: impl FnMut(&[u32]),
    ) {
        if self.best.len() < particles {
            self.best.resize_with(particles, || AtomicU32::new(NONE));
        }
        let Self { best, active } = self;
        active.clear();
        active.extend(0..candidates.len() as u32);
        while !active.is_empty() {
            active.par_iter().with_min_len(TASK).for_each(|&c| propose(best, candidates, c));
            let wins =
                |c: &u32| candidates[*c as usize].claimed().all(|p| best[p].load(Ordering::Relaxed) == *c);
            let winners: Vec<u32> = active.par_iter().with_min_len(TASK).copied().filter(wins).collect();
            turn(&winners);
            let left: Vec<u32> = match afterwards {
                Afterwards::Dropped => {
                    mark(best, candidates, &winners, TAKEN);
                    let free = |c: &u32| {
                        candidates[*c as usize].claimed().all(|p| best[p].load(Ordering::Relaxed) != TAKEN)
                    };
                    active.par_iter().with_min_len(TASK).copied().filter(free).collect()
                }
                Afterwards::Queued => {
                    active.par_iter().with_min_len(TASK).copied().filter(|c| !wins(c)).collect()
                }
            };
            mark(best, candidates, if afterwards == Afterwards::Dropped { &left } else { active }, NONE);
            *active = left;
        }
        // Nothing is left behind for the next call.
        candidates.iter().flat_map(Candidate::claimed).for_each(|p| *best[p].get_mut() = NONE);
    }

    /// The candidates that have their turn where a particle has one, as places in ascending order.
    pub fn greedy(&mut self, candidates: &[Candidate], particles: usize) -> Vec<u32> {
        let mut chosen = Vec::new();
        self.rounds(candidates, particles, Afterwards::Dropped, |winners| chosen.extend_from_slice(winners));
        chosen.sort_unstable();
        chosen
    }
}

/// Enters a candidate at its particles where it is better than what is there.
fn propose(best: &[AtomicU32], candidates: &[Candidate], candidate: u32) {
    let own = &candidates[candidate as usize];
    for particle in own.claimed() {
        let better = |there: u32| {
            let wins = there == NONE || own.key() < candidates[there as usize].key();
            wins.then_some(candidate)
        };
        // An error says that a better one is there already.
        let _ = best[particle].fetch_update(Ordering::Relaxed, Ordering::Relaxed, better);
    }
}

fn mark(best: &[AtomicU32], candidates: &[Candidate], which: &[u32], mark: u32) {
    which.par_iter().with_min_len(TASK).for_each(|&c| {
        candidates[c as usize].claimed().for_each(|p| best[p].store(mark, Ordering::Relaxed));
    });
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// From the best to the worst, each that finds its particles free.
    fn sequential(candidates: &[Candidate]) -> Vec<u32> {
        let mut order: Vec<u32> = (0..candidates.len() as u32).collect();
        order.sort_by_key(|&c| candidates[c as usize].key());
        let mut taken = std::collections::HashSet::new();
        let mut chosen = Vec::new();
        for c in order {
            if candidates[c as usize].claimed().all(|p| !taken.contains(&p)) {
                taken.extend(candidates[c as usize].claimed());
                chosen.push(c);
            }
        }
        chosen.sort_unstable();
        chosen
    }

    /// Different pairs of few particles, with few priorities, so that ties are common.
    fn candidates() -> impl Strategy<Value = Vec<Candidate>> {
        let one = (0..40_u32, 1..40_u32, 0..8_u32, 0..6);
        prop::collection::vec(one, 0..300).prop_map(|many| {
            let mut seen = std::collections::HashSet::new();
            let mut all = Vec::new();
            for (a, by, priority, claims) in many {
                let b = (a + by) % 41;
                let claims = match claims {
                    0 => [true, false],
                    1 => [false, true],
                    _ => [true, true],
                };
                let ids = [a.min(b), a.max(b)];
                if a != b && seen.insert(ids) {
                    all.push(Candidate { at: [a, b], claims, rule: 0, priority, ids });
                }
            }
            all
        })
    }

    proptest! {
        #[test]
        fn equals_the_sequential_greedy(candidates in candidates()) {
            let mut matching = Matching::default();
            prop_assert_eq!(matching.greedy(&candidates, 41), sequential(&candidates));
            // What a call leaves behind must not disturb the next one.
            let mut reversed = candidates;
            reversed.reverse();
            prop_assert_eq!(matching.greedy(&reversed, 41), sequential(&reversed));
        }

        #[test]
        fn a_queue_goes_by_priority_at_every_particle(candidates in candidates()) {
            let mut last = vec![None; 41];
            let mut turns = 0;
            Matching::default().rounds(&candidates, 41, Afterwards::Queued, |winners| {
                for &c in winners {
                    turns += 1;
                    for p in candidates[c as usize].claimed() {
                        let key = Some(candidates[c as usize].key());
                        assert!(last[p] < key, "a worse one went first");
                        last[p] = key;
                    }
                }
            });
            prop_assert_eq!(turns, candidates.len());
        }
    }

    #[test]
    fn many_candidates_in_parallel() {
        let word = |k: u32| k.wrapping_mul(0x9e37_79b9) >> 7;
        let candidate = |k: u32| {
            let (a, b) = (word(k) % 5_000, 5_000 + word(k ^ 0x5555) % 5_000);
            Candidate { at: [a, b], claims: [true; 2], rule: 0, priority: word(k) & 255, ids: [a, b] }
        };
        let mut all: Vec<_> = (0..40_000).map(candidate).collect();
        all.sort_unstable_by_key(|c| c.ids);
        all.dedup_by_key(|c| c.ids);
        assert_eq!(Matching::default().greedy(&all, 10_000), sequential(&all));
    }
}
