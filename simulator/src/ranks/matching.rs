//! Matching of reactions whose candidates are on several ranks.
//!
//! Every candidate is on one rank; every particle has an owner. In each round, ranks send their best keys of ghosts to
//! the owners, which reply with the best key of all ranks, or that the particle is taken. Ranks apply candidates that
//! are best at all their consumed particles.
//!
//! # Correctness
//! 1. After the replies, a rank knows as much of its candidates' particles as
//!    [`Matching`](crate::reaction::matching::Matching) in one process.
//! 2. Keys are totally ordered, so every round takes at least the best candidate of all.
//! 3. The choice is therefore that of one process.

use bytemuck::{Pod, Zeroable};
use lazygrid_ranks::{Communicator, Ghosts, send_to_ranks};
use rayon::prelude::*;

use super::agree;
use crate::Error;
use crate::reaction::candidates::BestCandidates;
use crate::reaction::matching::{Key, ReactionCandidate};

#[derive(Clone, Debug, Default)]
pub(super) struct DistributedMatching {
    best: Vec<Option<Key>>,
    taken: Vec<bool>,
    changed: Vec<u32>,
}

#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct GhostBid {
    at: u32,
    /// 1 if this rank took the particle in the previous round; 0 if `key` is its best.
    takes: u32,
    key: KeyMessage,
}

#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct OwnerReply {
    taken: u32,
    key: KeyMessage,
}

#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
struct KeyMessage {
    priority: u32,
    ids: [u32; 2],
}

impl KeyMessage {
    const WORST: Self = Self { priority: u32::MAX, ids: [u32::MAX; 2] };

    fn from_key((priority, ids): Key) -> Self {
        Self { priority, ids }
    }

    fn key(self) -> Key {
        (self.priority, self.ids)
    }
}

#[derive(Clone, Copy, Debug)]
struct RankParticles<'a> {
    own_count: usize,
    ghosts: &'a Ghosts,
}

impl DistributedMatching {
    /// Returns this rank's winning candidates, by key. Ghosts follow its `own_count` particles. `sample` is that of
    /// [`Matching::greedy`](crate::reaction::matching::Matching::greedy).
    pub(super) fn greedy<C: Communicator>(
        &mut self,
        communicator: &mut C,
        own_count: usize,
        ghosts: &Ghosts,
        mut sample: impl FnMut(&[bool], &mut BestCandidates) -> Result<(), Error>,
    ) -> Result<Vec<ReactionCandidate>, C::Error> {
        let count = own_count + ghosts.particles().len();
        self.best.resize(self.best.len().max(count), None);
        self.taken.resize(self.taken.len().max(count), false);
        let (mut chosen, mut won) = (Vec::new(), Vec::new());
        loop {
            let mut best = BestCandidates::new(count);
            let sampled = sample(&self.taken, &mut best);
            agree(communicator, sampled)?;
            let is_last = communicator.all_reduce_sum(&[best.bound.is_some().into()])[0] == 0;
            if !is_last {
                // All ranks choose among the same keys.
                let bound = best.bound.map_or(KeyMessage::WORST, KeyMessage::from_key);
                let (bounds, _) = communicator.all_gather("bounds of candidates", &[bound])?;
                best.restrict(bounds.into_iter().map(KeyMessage::key).min().expect("one of each rank"));
            }
            let candidates = &mut best.candidates;
            chosen.extend(self.choose(
                communicator,
                candidates,
                RankParticles { own_count, ghosts },
                &mut won,
            )?);
            if is_last {
                break;
            }
        }
        for at in self.changed.drain(..) {
            self.taken[at as usize] = false;
        }
        Ok(chosen)
    }

    /// `won` are consumed ghosts whose owners do not know it yet.
    fn choose<C: Communicator>(
        &mut self,
        communicator: &mut C,
        candidates: &mut [ReactionCandidate],
        particles: RankParticles<'_>,
        won: &mut Vec<u32>,
    ) -> Result<Vec<ReactionCandidate>, C::Error> {
        let own_count = particles.own_count;
        candidates.par_sort_unstable_by_key(ReactionCandidate::key);
        let candidates = &*candidates;
        let mut active: Vec<u32> = (0..candidates.len() as u32).collect();
        let mut chosen = Vec::new();
        while communicator.all_reduce_sum(&[active.len() as u64])[0] > 0 {
            for &c in &active {
                candidates[c as usize].claimed().for_each(|at| self.bid(at, candidates[c as usize].key()));
            }
            self.exchange_bids(
                communicator,
                particles,
                &claimed_ghosts(candidates, &active, own_count),
                won,
            )?;
            let claimed = |c: u32| candidates[c as usize].claimed();
            let wins = |c: &u32| {
                let key = Some(candidates[*c as usize].key());
                claimed(*c).all(|at| !self.taken[at] && self.best[at] == key)
            };
            let winners: Vec<u32> = active.iter().copied().filter(wins).collect();
            won.clear();
            for at in winners.iter().flat_map(|&c| claimed(c)) {
                self.taken[at] = true;
                won.extend(at.checked_sub(own_count).map(|ghost| ghost as u32));
            }
            active.retain(|&c| claimed(c).all(|at| !self.taken[at]));
            chosen.extend(winners);
            self.changed.iter().for_each(|&at| self.best[at as usize] = None);
        }
        chosen.sort_unstable();
        Ok(chosen.into_iter().map(|c| candidates[c as usize]).collect())
    }

    fn bid(&mut self, at: usize, key: Key) {
        let best = &mut self.best[at];
        *best = Some(best.map_or(key, |best| best.min(key)));
        self.changed.push(at as u32);
    }

    fn exchange_bids<C: Communicator>(
        &mut self,
        communicator: &mut C,
        particles: RankParticles<'_>,
        wanted: &[u32],
        won: &[u32],
    ) -> Result<(), C::Error> {
        let RankParticles { own_count, ghosts } = particles;
        let bid = |ghost: u32, takes: u32, key: KeyMessage| {
            (ghosts.rank_of(ghost), GhostBid { at: ghosts.particles()[ghost as usize].index, takes, key })
        };
        let key =
            |ghost: u32| KeyMessage::from_key(self.best[own_count + ghost as usize].unwrap_or_default());
        let mut bids: Vec<_> = won.iter().map(|&ghost| bid(ghost, 1, KeyMessage::default())).collect();
        bids.extend(wanted.iter().map(|&ghost| bid(ghost, 0, key(ghost))));
        let (bids, counts) = send_to_ranks(communicator, "bids of ghosts", bids)?;
        for bid in bids.iter().filter(|bid| bid.takes > 0) {
            self.taken[bid.at as usize] = true;
            self.changed.push(bid.at);
        }
        for bid in bids.iter().filter(|bid| bid.takes == 0) {
            self.bid(bid.at as usize, bid.key.key());
        }
        let from = (0..).zip(counts).flat_map(|(rank, count)| std::iter::repeat_n(rank, count));
        let reply = |(bid, from): (&GhostBid, u32)| {
            let at = bid.at as usize;
            let key = KeyMessage::from_key(self.best[at].unwrap_or_default());
            (bid.takes == 0).then_some((from, OwnerReply { taken: self.taken[at].into(), key }))
        };
        let replies = bids.iter().zip(from).filter_map(reply).collect();
        // Ghosts are sorted by owners, so replies come in the order of `wanted`.
        let (replies, _) = send_to_ranks(communicator, "replies to bids", replies)?;
        for (&ghost, reply) in wanted.iter().zip(&replies) {
            let at = own_count + ghost as usize;
            self.best[at] = Some(reply.key.key());
            self.taken[at] |= reply.taken > 0;
        }
        Ok(())
    }
}

fn claimed_ghosts(candidates: &[ReactionCandidate], active: &[u32], own_count: usize) -> Vec<u32> {
    let claimed = active.iter().flat_map(|&c| candidates[c as usize].claimed());
    let mut ghosts: Vec<u32> =
        claimed.filter_map(|at| at.checked_sub(own_count)).map(|ghost| ghost as u32).collect();
    ghosts.sort_unstable();
    ghosts.dedup();
    ghosts
}

#[cfg(test)]
mod tests {
    use lazygrid_ranks::{Particle, threads};
    use proptest::prelude::*;

    use super::*;
    use crate::reaction::matching::tests::{candidates, crowd, sequential};

    fn of_rank(
        all: &[ReactionCandidate],
        owners: &[u32],
        rank: u32,
    ) -> (Vec<ReactionCandidate>, usize, Ghosts) {
        let ranks = owners.iter().max().map_or(1, |max_rank| max_rank + 1);
        let index =
            |p: u32| owners[..p as usize].iter().filter(|&&owner| owner == owners[p as usize]).count() as u32;
        let is_here =
            |c: &&ReactionCandidate| owners[c.at[(c.ids[0] + c.ids[1]) as usize % 2] as usize] == rank;
        let own_candidates: Vec<ReactionCandidate> = all.iter().filter(is_here).copied().collect();
        let foreign = |&p: &u32| owners[p as usize] != rank;
        let mut ghosts: Vec<u32> = own_candidates.iter().flat_map(|c| c.at).filter(foreign).collect();
        ghosts.sort_unstable_by_key(|&p| (owners[p as usize], p));
        ghosts.dedup();
        let own_count = owners.iter().filter(|&&owner| owner == rank).count();
        let local = |p: u32| match ghosts.iter().position(|&ghost| ghost == p) {
            Some(ghost) => (own_count + ghost) as u32,
            None => index(p),
        };
        let own_candidates =
            own_candidates.into_iter().map(|c| ReactionCandidate { at: c.at.map(local), ..c }).collect();
        let count = |rank: u32| ghosts.iter().filter(|&&p| owners[p as usize] == rank).count();
        let counts: Vec<usize> = (0..ranks).map(count).collect();
        let particle = |&p: &u32| Particle { index: index(p), id: p.into(), ..Particle::default() };
        (own_candidates, own_count, Ghosts::new(ghosts.iter().map(particle).collect(), &counts))
    }

    /// Each rank chooses twice, to test the state between calls.
    fn chosen(all: &[ReactionCandidate], owners: &[u32]) -> Vec<[u32; 2]> {
        let ranks = owners.iter().max().map_or(1, |max_rank| max_rank + 1);
        let chosen = threads::on(ranks, |mut thread| {
            let mut matching = DistributedMatching::default();
            let (own_candidates, own_count, ghosts) = of_rank(all, owners, thread.rank());
            let sample = |taken: &[bool], best: &mut BestCandidates| {
                let open = own_candidates.iter().filter(|c| !c.claimed().any(|at| taken[at]));
                open.clone().try_for_each(|candidate| best.extend(&[*candidate]))
            };
            let [first, second] = [0, 1].map(|_| {
                let chosen = matching.greedy(&mut thread, own_count, &ghosts, sample).expect("no rank fails");
                chosen.iter().map(|c| (c.key(), c.ids)).collect::<Vec<_>>()
            });
            assert_eq!(first, second);
            first
        });
        let mut chosen = chosen.concat();
        chosen.sort_unstable();
        chosen.into_iter().map(|(_, ids)| ids).collect()
    }

    proptest! {
        #[test]
        fn the_choice_is_the_sequential_one(
            all in candidates(),
            owners in (1..5_u32).prop_flat_map(|ranks| prop::collection::vec(0..ranks, 41)),
        ) {
            prop_assert_eq!(chosen(&all, &owners), sequential(&all));
        }
    }

    #[test]
    fn crowd_is_matched_in_several_passes() {
        let owners: Vec<u32> = (0..4025).map(|particle| particle * 7 % 3).collect();
        let crowd = crowd();
        assert_eq!(chosen(&crowd, &owners), sequential(&crowd));
    }
}
