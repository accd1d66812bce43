//! Matching of reactions if candidates of several ranks want the same particle.
//!
//! Every candidate is with one rank, and every particle has an owner. In a round a rank tells the owner of each ghost the
//! best key that it has for it; the owner answers with the best of all, or that the particle is taken. So everybody knows
//! of all particles that matter to them what [`Matching`](crate::reaction::matching::Matching) knows in one process, and
//! takes the candidates that are best at all particles they claim. Keys are totally ordered, so the best of all
//! candidates is taken in every round, and the choice is that of one process.

use bytemuck::{Pod, Zeroable};
use lazygrid_ranks::{Communicator, Ghosts, send_to_ranks};
use rayon::prelude::*;

use crate::reaction::matching::{Key, ReactionCandidate};

/// The state of each particle of a rank in a step, and of each ghost after them.
#[derive(Clone, Debug, Default)]
pub(super) struct Contest {
    best: Vec<Option<Key>>,
    taken: Vec<bool>,
    /// The places of which something is known.
    touched: Vec<u32>,
}

/// The message of a rank to the owner of a ghost.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct Claim {
    /// Its place with the owner.
    at: u32,
    /// 1 where this rank took it in the round before, 0 where the key is the best that it has.
    takes: u32,
    key: Word,
}

/// The answer of the owner.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct Answer {
    taken: u32,
    key: Word,
}

/// A key as it travels.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
struct Word {
    priority: u32,
    ids: [u32; 2],
}

impl Word {
    fn of((priority, ids): Key) -> Self {
        Self { priority, ids }
    }

    fn key(self) -> Key {
        (self.priority, self.ids)
    }
}

impl Contest {
    /// Sorts the candidates of this rank, and says which have their turn where a particle has one on all ranks, as
    /// ascending places. There are `own` particles, and ghosts behind them.
    ///
    /// # Errors
    /// Fails if the communicator fails.
    pub(super) fn greedy<C: Communicator>(
        &mut self,
        communicator: &mut C,
        candidates: &mut [ReactionCandidate],
        (own, ghosts): (usize, &Ghosts),
    ) -> Result<Vec<u32>, C::Error> {
        let places = own + ghosts.particles().len();
        self.best.resize(self.best.len().max(places), None);
        self.taken.resize(self.taken.len().max(places), false);
        candidates.par_sort_unstable_by_key(ReactionCandidate::key);
        let candidates = &*candidates;
        let mut active: Vec<u32> = (0..candidates.len() as u32).collect();
        let (mut chosen, mut won) = (Vec::new(), Vec::new());
        while communicator.all_reduce_sum(&[active.len() as u64])[0] > 0 {
            for &c in &active {
                candidates[c as usize].claimed().for_each(|at| self.bid(at, candidates[c as usize].key()));
            }
            self.ask(communicator, (own, ghosts), &claimed_ghosts(candidates, &active, own), &won)?;
            let claimed = |c: u32| candidates[c as usize].claimed();
            let wins = |c: &u32| {
                let key = Some(candidates[*c as usize].key());
                claimed(*c).all(|at| !self.taken[at] && self.best[at] == key)
            };
            let winners: Vec<u32> = active.iter().copied().filter(wins).collect();
            won.clear();
            for at in winners.iter().flat_map(|&c| claimed(c)) {
                self.taken[at] = true;
                won.extend(at.checked_sub(own).map(|ghost| ghost as u32));
            }
            // If one candidate was taken, the others are dropped.
            active.retain(|&c| claimed(c).all(|at| !self.taken[at]));
            chosen.extend(winners);
            self.touched.iter().for_each(|&at| self.best[at as usize] = None);
        }
        for at in self.touched.drain(..) {
            self.taken[at as usize] = false;
        }
        chosen.sort_unstable();
        Ok(chosen)
    }

    /// Enters a key for a particle.
    fn bid(&mut self, at: usize, key: Key) {
        let best = &mut self.best[at];
        *best = Some(best.map_or(key, |best| best.min(key)));
        self.touched.push(at as u32);
    }

    /// Tells the owners of ghosts what this rank wants of them and what it took in the last round, `won`, and takes up
    /// what they answer.
    fn ask<C: Communicator>(
        &mut self,
        communicator: &mut C,
        (own, ghosts): (usize, &Ghosts),
        wanted: &[u32],
        won: &[u32],
    ) -> Result<(), C::Error> {
        let claim = |ghost: u32, takes: u32, key: Word| {
            (ghosts.rank_of(ghost), Claim { at: ghosts.particles()[ghost as usize].index, takes, key })
        };
        let key = |ghost: u32| Word::of(self.best[own + ghost as usize].unwrap_or_default());
        let mut claims: Vec<_> = won.iter().map(|&ghost| claim(ghost, 1, Word::default())).collect();
        claims.extend(wanted.iter().map(|&ghost| claim(ghost, 0, key(ghost))));
        let (claims, counts) = send_to_ranks(communicator, "claims of ghosts", claims)?;
        for claim in claims.iter().filter(|claim| claim.takes > 0) {
            self.taken[claim.at as usize] = true;
            self.touched.push(claim.at);
        }
        for claim in claims.iter().filter(|claim| claim.takes == 0) {
            self.bid(claim.at as usize, claim.key.key());
        }
        let from = (0..).zip(counts).flat_map(|(rank, count)| std::iter::repeat_n(rank, count));
        let answer = |(claim, from): (&Claim, u32)| {
            let at = claim.at as usize;
            let key = Word::of(self.best[at].unwrap_or_default());
            (claim.takes == 0).then_some((from, Answer { taken: self.taken[at].into(), key }))
        };
        let answers = claims.iter().zip(from).filter_map(answer).collect();
        // Ghosts lie by their owners, so answers come in the order of what is wanted.
        let (answers, _) = send_to_ranks(communicator, "answers to claims", answers)?;
        for (&ghost, answer) in wanted.iter().zip(&answers) {
            let at = own + ghost as usize;
            self.best[at] = Some(answer.key.key());
            self.taken[at] |= answer.taken > 0;
        }
        Ok(())
    }
}

/// The ghosts that candidates claim, each once, ascending.
fn claimed_ghosts(candidates: &[ReactionCandidate], active: &[u32], own: usize) -> Vec<u32> {
    let claimed = active.iter().flat_map(|&c| candidates[c as usize].claimed());
    let mut ghosts: Vec<u32> =
        claimed.filter_map(|at| at.checked_sub(own)).map(|ghost| ghost as u32).collect();
    ghosts.sort_unstable();
    ghosts.dedup();
    ghosts
}

#[cfg(test)]
mod tests {
    use lazygrid_ranks::{Particle, threads};
    use proptest::prelude::*;

    use super::*;
    use crate::reaction::matching::tests::{candidates, sequential};

    /// The data of one rank: its candidates, the number of its particles, and the ghosts after them.
    fn of_rank(
        all: &[ReactionCandidate],
        owners: &[u32],
        rank: u32,
    ) -> (Vec<ReactionCandidate>, usize, Ghosts) {
        let ranks = owners.iter().max().map_or(1, |most| most + 1);
        let index =
            |p: u32| owners[..p as usize].iter().filter(|&&owner| owner == owners[p as usize]).count() as u32;
        // Of two particles the first one's owner reports, or the second one's, by their ids.
        let is_here =
            |c: &&ReactionCandidate| owners[c.at[(c.ids[0] + c.ids[1]) as usize % 2] as usize] == rank;
        let here: Vec<ReactionCandidate> = all.iter().filter(is_here).copied().collect();
        let foreign = |&p: &u32| owners[p as usize] != rank;
        let mut ghosts: Vec<u32> = here.iter().flat_map(|c| c.at).filter(foreign).collect();
        ghosts.sort_unstable_by_key(|&p| (owners[p as usize], p));
        ghosts.dedup();
        let own = owners.iter().filter(|&&owner| owner == rank).count();
        let local = |p: u32| match ghosts.iter().position(|&ghost| ghost == p) {
            Some(ghost) => (own + ghost) as u32,
            None => index(p),
        };
        let here = here.into_iter().map(|c| ReactionCandidate { at: c.at.map(local), ..c }).collect();
        let count = |of: u32| ghosts.iter().filter(|&&p| owners[p as usize] == of).count();
        let counts: Vec<usize> = (0..ranks).map(count).collect();
        let particle = |&p: &u32| Particle { index: index(p), id: p.into(), ..Particle::default() };
        (here, own, Ghosts::new(ghosts.iter().map(particle).collect(), &counts))
    }

    proptest! {
        #[test]
        fn the_choice_is_the_sequential_one(
            all in candidates(),
            owners in (1..5_u32).prop_flat_map(|ranks| prop::collection::vec(0..ranks, 41)),
        ) {
            let ranks = owners.iter().max().map_or(1, |most| most + 1);
            let chosen = threads::on(ranks, |mut thread| {
                let mut contest = Contest::default();
                let (mut here, own, ghosts) = of_rank(&all, &owners, thread.rank());
                // The state that a call leaves must not disturb the next one.
                let [first, second] = [0, 1].map(|_| {
                    let chosen = contest.greedy(&mut thread, &mut here, (own, &ghosts)).expect("no rank fails");
                    chosen.iter().map(|&c| (here[c as usize].key(), here[c as usize].ids)).collect::<Vec<_>>()
                });
                assert_eq!(first, second);
                first
            });
            let mut chosen = chosen.concat();
            chosen.sort_unstable();
            let ids: Vec<_> = chosen.into_iter().map(|(_, ids)| ids).collect();
            prop_assert_eq!(ids, sequential(&all));
        }
    }
}
