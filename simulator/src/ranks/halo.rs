use bytemuck::{Pod, Zeroable};
use lazygrid::Sphere;
use lazygrid_ranks::{ClassBounds, Communicator, RankBounds, SphereWrapper, WrappedSphere, send_to_ranks};
use rayon::prelude::*;

use crate::Error;
use crate::model::receiver::rounding;
use crate::motion::collisions::halo::{HOPS, Halo};
use crate::motion::collisions::mover::Mover;

#[derive(Debug)]
pub(super) struct RankHalo<'a, C> {
    communicator: &'a mut C,
    wrapper: &'a SphereWrapper,
    /// Ascending by mover.
    sent: Vec<SentGhost>,
    /// Indices of each rank's ghosts here, by slot.
    held: Vec<Vec<u32>>,
}

#[derive(Clone, Copy, Debug)]
struct SentGhost {
    at: u32,
    rank: u32,
    ghost_index: u32,
}

#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct MoverMessage {
    position: [f64; 3],
    time: f64,
    motion: [f64; 3],
    speed: f64,
    velocity: [f64; 3],
    id: u32,
    species: u32,
    radius: f32,
    ghost_index: u32,
}

impl<'a, C: Communicator> RankHalo<'a, C> {
    pub(super) fn new(communicator: &'a mut C, wrapper: &'a SphereWrapper) -> Self {
        Self { communicator, wrapper, sent: Vec::new(), held: Vec::new() }
    }

    /// Returns spheres that overlap if their movers may be candidates.
    fn wrapped(&self, movers: &[Mover], allowance: f64) -> Vec<WrappedSphere> {
        let wrap = |mover: &Mover| {
            let center = mover.position.map(|c| c as f32);
            let radius = mover.radius + allowance as f32;
            self.wrapper.wrap(Sphere::new(center, radius + rounding(center, radius)), mover.species)
        };
        movers.par_iter().map(wrap).collect()
    }

    /// Returns own movers that may be candidates on another rank, and are unknown there.
    fn unsent(&self, wrapped: &[WrappedSphere], own_count: usize, bounds: &RankBounds) -> Vec<SentGhost> {
        let this = self.communicator.rank();
        let own_bounds = ClassBounds::all_of(&wrapped[..own_count]);
        let mut unsent = Vec::new();
        for rank in (0..bounds.ranks()).filter(|&rank| rank != this) {
            let is_near = |other_bounds: &&ClassBounds| {
                own_bounds.iter().any(|own_bounds| own_bounds.can_pair(other_bounds, self.wrapper))
            };
            let near: Vec<_> = bounds.of_rank(rank).iter().filter(is_near).collect();
            let known = self.sent.partition_point(|ghost| ghost.rank < rank);
            let known = &self.sent[known..self.sent.partition_point(|ghost| ghost.rank <= rank)];
            let is_unsent = |&at: &u32| {
                let sphere = ClassBounds::around(&wrapped[at as usize]);
                near.iter().any(|near| near.can_pair(&sphere, self.wrapper))
                    && known.binary_search_by_key(&at, |ghost| ghost.at).is_err()
            };
            let found = (0..own_count as u32).filter(is_unsent);
            unsent.extend((known.len() as u32..).zip(found).map(|(ghost_index, at)| SentGhost {
                at,
                rank,
                ghost_index,
            }));
        }
        unsent
    }
}

impl<C: Communicator> Halo for RankHalo<'_, C> {
    type Error = C::Error;

    fn agree<T>(&self, result: Result<T, Error>) -> Result<T, C::Error> {
        super::agree(self.communicator, result)
    }

    fn gather<T: Pod>(&mut self, value: T) -> Vec<T> {
        // A sum with zeros is one message; a gather asks for lengths first.
        let words: &[u64] = bytemuck::cast_slice(std::slice::from_ref(&value));
        let mut all = vec![0; words.len() * self.communicator.ranks() as usize];
        let begin = words.len() * self.communicator.rank() as usize;
        all[begin..begin + words.len()].copy_from_slice(words);
        bytemuck::cast_slice(&self.communicator.all_reduce_sum(&all)).to_vec()
    }

    fn add_ghosts(&mut self, movers: &mut Vec<Mover>, allowance: f64) -> Result<(), C::Error> {
        let own_count = movers.len();
        self.sent.clear();
        self.held = vec![Vec::new(); self.communicator.ranks() as usize];
        let mut wrapped = Vec::new();
        for _ in 0..HOPS {
            wrapped.extend(self.wrapped(&movers[wrapped.len()..], allowance));
            let bounds = RankBounds::gather(self.communicator, &wrapped)?;
            let unsent = self.unsent(&wrapped, own_count, &bounds);
            let message = |ghost: &SentGhost| {
                (ghost.rank, MoverMessage::new(&movers[ghost.at as usize], ghost.ghost_index))
            };
            let send = unsent.iter().map(message).collect();
            let (ghosts, counts) = send_to_ranks(self.communicator, "ghosts in motion", send)?;
            let mut indices = movers.len() as u32..;
            for (held, count) in self.held.iter_mut().zip(counts) {
                held.extend(indices.by_ref().take(count));
            }
            movers.extend(ghosts.iter().map(MoverMessage::mover));
            self.sent.extend(unsent);
            self.sent.sort_unstable_by_key(|ghost| (ghost.rank, ghost.at));
        }
        self.sent.sort_unstable_by_key(|ghost| (ghost.at, ghost.rank));
        Ok(())
    }

    fn refresh(&mut self, movers: &mut [Mover], changed: &mut Vec<u32>) -> Result<(), C::Error> {
        let copies = |&at: &u32| {
            let first = self.sent.partition_point(|ghost| ghost.at < at);
            self.sent[first..].iter().take_while(move |ghost| ghost.at == at)
        };
        let message = |ghost: &SentGhost| {
            (ghost.rank, MoverMessage::new(&movers[ghost.at as usize], ghost.ghost_index))
        };
        let send = changed.iter().flat_map(copies).map(message).collect();
        let (came, counts) = send_to_ranks(self.communicator, "movers after a collision", send)?;
        let held = self.held.iter().zip(counts).flat_map(|(held, count)| std::iter::repeat_n(held, count));
        for (held, message) in held.zip(&came) {
            let at = held[message.ghost_index as usize];
            movers[at as usize] = message.mover();
            changed.push(at);
        }
        Ok(())
    }
}

impl MoverMessage {
    fn new(mover: &Mover, ghost_index: u32) -> Self {
        let Mover { position, time, motion, speed, velocity, id, species, radius, collided: _ } = *mover;
        Self { position, time, motion, speed, velocity, id, species, radius, ghost_index }
    }

    fn mover(&self) -> Mover {
        let Self { position, time, motion, speed, velocity, id, species, radius, ghost_index: _ } = *self;
        Mover { position, time, motion, speed, velocity, id, species, radius, collided: false }
    }
}

#[cfg(test)]
mod tests {
    use lazygrid::{Interactions, Space};
    use lazygrid_ranks::threads;

    use super::*;
    use crate::model::boundary::Axis;
    use crate::model::{Contact, Reaction, Species};
    use crate::motion::collisions::halo::SingleProcess;
    use crate::motion::collisions::rounds::{Adjacency, SLACK, Window, WindowEnd};
    use crate::motion::collisions::rules::Rules;
    use crate::motion::collisions::tests::{model, movers};
    use crate::reaction::collision_interactions;

    const ALLOWANCE: f64 = 0.1;
    const RANKS: u32 = 4;

    struct Scene {
        rules: Rules,
        movers: Vec<Mover>,
        pairs: Vec<[u32; 2]>,
        top_speed: f64,
    }

    fn scene(case: u32) -> Scene {
        let rules = Rules::new(&model(Contact::Separate, Axis::Open)).expect("collisions");
        let mut movers = movers(case, 8, 0.4);
        movers.iter_mut().for_each(|mover| mover.position = mover.position.map(|c| 0.94 * c));
        let n = movers.len() as u32;
        let mut pairs: Vec<[u32; 2]> = (0..n).flat_map(|i| (0..i).map(move |j| [j, i])).collect();
        pairs.retain(|pair| {
            let [a, b] = pair.map(|at| &movers[at as usize]);
            !rules.passes([a, b]) && a.gap(b, 0.0, &rules.boundary) < 2.0 * ALLOWANCE
        });
        let top_speed = 1.3 * movers.iter().map(|mover| mover.speed).fold(0.0, f64::max);
        Scene { rules, movers, pairs, top_speed }
    }

    impl Scene {
        fn owner(&self, at: u32) -> u32 {
            (self.movers[at as usize].position[0] as u32 / 2).min(RANKS - 1)
        }

        fn indices(&self, rank: u32, hops: u32) -> Vec<u32> {
            let all = 0..self.movers.len() as u32;
            let mut is_here: Vec<bool> = all.clone().map(|at| self.owner(at) == rank).collect();
            for _ in 0..hops {
                let before = is_here.clone();
                for [a, b] in &self.pairs {
                    is_here[*a as usize] |= before[*b as usize];
                    is_here[*b as usize] |= before[*a as usize];
                }
            }
            let mut indices: Vec<u32> = all.filter(|&at| is_here[at as usize]).collect();
            indices.sort_by_key(|&at| (self.owner(at) != rank, self.owner(at)));
            indices
        }

        fn run<H: Halo>(&self, indices: &[u32], own_count: usize, halo: &mut H) -> (Vec<Mover>, WindowEnd)
        where
            H::Error: std::fmt::Debug,
        {
            let mut movers: Vec<Mover> = indices.iter().map(|&at| self.movers[at as usize]).collect();
            let local = |at: &u32| indices.iter().position(|index| index == at).map(|at| at as u32);
            let pair = |[a, b]: &[u32; 2]| Some([local(a)?, local(b)?]);
            let pairs: Vec<_> = self.pairs.iter().filter_map(pair).collect();
            let mut neighbors = Adjacency::default();
            neighbors.build(&pairs, movers.len());
            neighbors.sort_by_id(&movers);
            let Self { rules, top_speed, .. } = self;
            let (neighbors, horizon) = (&neighbors, ALLOWANCE / top_speed);
            let window = Window {
                rules,
                neighbors,
                own_count,
                horizon,
                top_speed: *top_speed,
                slack: SLACK,
                limit: 3000,
            };
            let end = window.run(&mut movers, halo).expect("no rank fails");
            movers.truncate(own_count);
            (movers, end)
        }

        fn over_ranks(&self, hops: u32) -> (Vec<Mover>, WindowEnd) {
            let ranks = threads::on(RANKS, |mut thread| {
                let this = thread.rank();
                let indices = self.indices(this, hops);
                let own_count = indices.iter().filter(|&&at| self.owner(at) == this).count();
                let count =
                    |rank| indices.iter().filter(|&&at| rank != this && self.owner(at) == rank).count();
                let mut sent = Vec::new();
                for rank in (0..RANKS).filter(|&rank| rank != this) {
                    let sent_indices =
                        self.indices(rank, hops).into_iter().filter(|&at| self.owner(at) == this);
                    let local = |at| indices.iter().position(|&index| index == at).expect("own") as u32;
                    sent.extend((0..).zip(sent_indices).map(|(ghost_index, at)| SentGhost {
                        at: local(at),
                        rank,
                        ghost_index,
                    }));
                }
                sent.sort_unstable_by_key(|ghost| ghost.at);
                let mut next = own_count as u32..;
                let held = (0..RANKS).map(|rank| next.by_ref().take(count(rank)).collect()).collect();
                let mut halo =
                    RankHalo { communicator: &mut thread, wrapper: &SphereWrapper::default(), sent, held };
                self.run(&indices, own_count, &mut halo)
            });
            let end = ranks[0].1;
            let mut movers: Vec<Mover> = ranks.into_iter().flat_map(|(movers, _)| movers).collect();
            movers.sort_unstable_by_key(|mover| mover.id);
            (movers, end)
        }
    }

    #[test]
    fn movers_of_bursts_are_no_ghosts_of_each_other() {
        let mut model = model(Contact::Separate, Axis::Open);
        model.species.push(Species { radius: 0.0, ..model.species[1].clone() });
        model.reactions = vec![Reaction { reactants: [0; 2], ..Reaction::default() }];
        let table = collision_interactions(&model).expect("few species");
        let first = movers(0, 2, 0.4)[0];
        let mover = |k: u32| match k % 2 {
            0 => Mover { id: k, species: 0, radius: 0.5, position: [0.0; 3], ..first },
            _ => Mover { id: k, species: 2, radius: 0.0, position: [9.0; 3], ..first },
        };
        let target = Mover { id: 800, species: 1, radius: 0.3, position: [0.0, 0.0, 0.85], ..first };
        let ghosts = |table: Option<&Interactions>, has_target: bool| -> Vec<usize> {
            let wrapper = SphereWrapper::new(Space::UNBOUNDED, table);
            threads::on(RANKS, |mut thread| {
                let rank = thread.rank();
                let own_movers = (0..800).filter(|k| k / 2 % RANKS == rank).map(mover);
                let mut movers: Vec<Mover> =
                    own_movers.chain((has_target && rank == RANKS - 1).then_some(target)).collect();
                let own_count = movers.len();
                RankHalo::new(&mut thread, &wrapper).add_ghosts(&mut movers, ALLOWANCE).expect("ghosts");
                assert!(movers[own_count..].iter().all(|mover| mover.species < 2 || table.is_none()));
                movers.len() - own_count
            })
        };
        assert_eq!(ghosts(None, false), [600; 4]);
        assert_eq!(ghosts(table.as_ref(), false), [0; 4]);
        // Over the target, each sphere of its burst is two candidate pairs from all others.
        assert_eq!(ghosts(table.as_ref(), true), [301, 301, 301, 300]);
    }

    #[test]
    fn ghosts_three_candidates_away_suffice_and_two_do_not() {
        let mut differ = 0;
        for case in 0..6 {
            let scene = scene(case);
            let all: Vec<u32> = (0..scene.movers.len() as u32).collect();
            let (mut expected, end) = scene.run(&all, all.len(), &mut SingleProcess);
            assert!(matches!(end, WindowEnd::Finished(50..)), "{end:?}");
            expected.sort_unstable_by_key(|mover| mover.id);
            assert!(scene.over_ranks(3) == (expected.clone(), end), "{case}");
            differ += u32::from(scene.over_ranks(2) != (expected, end));
        }
        assert!(differ > 0);
    }
}
