//! Exchange of particles in motion while they collide.

use bytemuck::{Pod, Zeroable};
use lazygrid::Sphere;
use lazygrid_ranks::{ClassBounds, Communicator, RankBounds, SphereWrapper, WrappedSphere, send_to_ranks};
use rayon::prelude::*;

use crate::Error;
use crate::model::receiver::rounding;
use crate::motion::collisions::halo::Halo;
use crate::motion::collisions::mover::Mover;

#[derive(Debug)]
pub(super) struct RankHalo<'a, C> {
    communicator: &'a mut C,
    wrapper: &'a SphereWrapper,
    /// Ascending by `at`.
    sent: Vec<SentGhost>,
    /// Index of the first ghost of each rank.
    begins: Vec<usize>,
}

#[derive(Clone, Copy, Debug)]
struct SentGhost {
    at: u32,
    rank: u32,
    /// Place among this rank's ghosts there.
    slot: u32,
}

#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct MoverMessage {
    position: [f64; 3],
    time: f64,
    motion: [f64; 3],
    speed: f64,
    own: [f64; 3],
    id: u32,
    species: u32,
    radius: f32,
    slot: u32,
}

impl<'a, C: Communicator> RankHalo<'a, C> {
    pub(super) fn new(communicator: &'a mut C, wrapper: &'a SphereWrapper) -> Self {
        Self { communicator, wrapper, sent: Vec::new(), begins: Vec::new() }
    }

    fn wrapped(&self, movers: &[Mover], reach: f64) -> Vec<WrappedSphere> {
        let wrap = |mover: &Mover| {
            let (center, reach) = (mover.position.map(|c| c as f32), reach as f32);
            self.wrapper.wrap(Sphere::new(center, 0.5 * reach + rounding(center, reach)), 0)
        };
        movers.par_iter().map(wrap).collect()
    }
}

impl<C: Communicator> Halo for RankHalo<'_, C> {
    type Error = C::Error;

    fn agree<T>(&self, result: Result<T, Error>) -> Result<T, C::Error> {
        self.communicator.agree(result.map_err(|error| self.communicator.failure(error.to_string())))
    }

    fn gather<T: Pod>(&mut self, own: T) -> Vec<T> {
        // A sum with zeros is one message; a gather asks for lengths first.
        let own: &[u64] = bytemuck::cast_slice(std::slice::from_ref(&own));
        let mut all = vec![0; own.len() * self.communicator.ranks() as usize];
        let begin = own.len() * self.communicator.rank() as usize;
        all[begin..begin + own.len()].copy_from_slice(own);
        bytemuck::cast_slice(&self.communicator.all_reduce_sum(&all)).to_vec()
    }

    fn add_ghosts(&mut self, movers: &mut Vec<Mover>, reach: f64) -> Result<(), C::Error> {
        let (own, space) = (movers.len(), self.wrapper.space());
        let wrapped = self.wrapped(movers, reach);
        let bounds = RankBounds::gather(self.communicator, &wrapped)?;
        let this = self.communicator.rank();
        self.sent.clear();
        for rank in (0..bounds.ranks()).filter(|&rank| rank != this) {
            let is_near =
                |other: &&ClassBounds| bounds.of_rank(this).iter().any(|own| own.overlaps(&space, other));
            let near: Vec<_> = bounds.of_rank(rank).iter().filter(is_near).collect();
            let reaches = |sphere| near.iter().any(|near| near.overlaps_sphere(&space, sphere));
            let found = (0..).zip(&wrapped).filter(|(_, sphere)| reaches(sphere));
            self.sent.extend((0..).zip(found).map(|(slot, (at, _))| SentGhost { at, rank, slot }));
        }
        let message = |ghost: &SentGhost| (ghost.rank, MoverMessage::new(&movers[ghost.at as usize], 0));
        let send = self.sent.iter().map(message).collect();
        self.sent.sort_unstable_by_key(|ghost| (ghost.at, ghost.rank));
        let (ghosts, counts) = send_to_ranks(self.communicator, "ghosts in motion", send)?;
        let begin = |next: &mut usize, count: usize| Some(std::mem::replace(next, *next + count));
        self.begins = counts.into_iter().scan(own, begin).collect();
        movers.extend(ghosts.iter().map(MoverMessage::mover));
        Ok(())
    }

    fn refresh(&mut self, movers: &mut [Mover], changed: &mut Vec<u32>) -> Result<(), C::Error> {
        let copies = |&at: &u32| {
            let first = self.sent.partition_point(|ghost| ghost.at < at);
            self.sent[first..].iter().take_while(move |ghost| ghost.at == at)
        };
        let message =
            |ghost: &SentGhost| (ghost.rank, MoverMessage::new(&movers[ghost.at as usize], ghost.slot));
        let send = changed.iter().flat_map(copies).map(message).collect();
        let (came, counts) = send_to_ranks(self.communicator, "movers after a collision", send)?;
        let begins =
            self.begins.iter().zip(counts).flat_map(|(&begin, count)| std::iter::repeat_n(begin, count));
        for (begin, message) in begins.zip(&came) {
            let at = begin + message.slot as usize;
            movers[at] = message.mover();
            changed.push(at as u32);
        }
        Ok(())
    }
}

impl MoverMessage {
    fn new(mover: &Mover, slot: u32) -> Self {
        let Mover { position, time, motion, speed, own, id, species, radius, collided: _ } = *mover;
        Self { position, time, motion, speed, own, id, species, radius, slot }
    }

    fn mover(&self) -> Mover {
        let Self { position, time, motion, speed, own, id, species, radius, slot: _ } = *self;
        Mover { position, time, motion, speed, own, id, species, radius, collided: false }
    }
}

#[cfg(test)]
mod tests {
    use lazygrid_ranks::threads;

    use super::*;
    use crate::model::Contact;
    use crate::model::boundary::Axis;
    use crate::motion::collisions::halo::Undivided;
    use crate::motion::collisions::rounds::{Adjacency, SLACK, Window, WindowEnd};
    use crate::motion::collisions::rules::Rules;
    use crate::motion::collisions::tests::{model, movers};

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
        // Nearly touching, so that chains are long.
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

        /// Returns the indices of a rank's movers, then those up to `hops` candidates away, by owner.
        fn places(&self, rank: u32, hops: u32) -> Vec<u32> {
            let all = 0..self.movers.len() as u32;
            let mut is_here: Vec<bool> = all.clone().map(|at| self.owner(at) == rank).collect();
            for _ in 0..hops {
                let before = is_here.clone();
                for [a, b] in &self.pairs {
                    is_here[*a as usize] |= before[*b as usize];
                    is_here[*b as usize] |= before[*a as usize];
                }
            }
            let mut places: Vec<u32> = all.filter(|&at| is_here[at as usize]).collect();
            places.sort_by_key(|&at| (self.owner(at) != rank, self.owner(at)));
            places
        }

        fn run<H: Halo>(&self, places: &[u32], own: usize, halo: &mut H) -> (Vec<Mover>, WindowEnd)
        where
            H::Error: std::fmt::Debug,
        {
            let mut movers: Vec<Mover> = places.iter().map(|&at| self.movers[at as usize]).collect();
            let local = |at: &u32| places.iter().position(|place| place == at).map(|at| at as u32);
            let pair = |[a, b]: &[u32; 2]| Some([local(a)?, local(b)?]);
            let pairs: Vec<_> = self.pairs.iter().filter_map(pair).collect();
            let mut neighbors = Adjacency::default();
            neighbors.build(&pairs, movers.len());
            neighbors.sort_by_id(&movers);
            let Self { rules, top_speed, .. } = self;
            let (neighbors, horizon) = (&neighbors, ALLOWANCE / top_speed);
            let window =
                Window { rules, neighbors, own, horizon, top_speed: *top_speed, slack: SLACK, limit: 3000 };
            let end = window.run(&mut movers, halo).expect("no rank fails");
            movers.truncate(own);
            (movers, end)
        }

        /// Returns the movers of all ranks by id, and the end of the window.
        fn over_ranks(&self, hops: u32) -> (Vec<Mover>, WindowEnd) {
            let ranks = threads::on(RANKS, |mut thread| {
                let this = thread.rank();
                let places = self.places(this, hops);
                let own = places.iter().filter(|&&at| self.owner(at) == this).count();
                let count =
                    |rank| places.iter().filter(|&&at| rank != this && self.owner(at) == rank).count();
                let begin = |next: &mut usize, rank| Some(std::mem::replace(next, *next + count(rank)));
                let mut sent = Vec::new();
                for rank in (0..RANKS).filter(|&rank| rank != this) {
                    let there = self.places(rank, hops).into_iter().filter(|&at| self.owner(at) == this);
                    let local = |at| places.iter().position(|&place| place == at).expect("own") as u32;
                    sent.extend((0..).zip(there).map(|(slot, at)| SentGhost { at: local(at), rank, slot }));
                }
                sent.sort_unstable_by_key(|ghost| ghost.at);
                let begins = (0..RANKS).scan(own, begin).collect();
                let mut halo =
                    RankHalo { communicator: &mut thread, wrapper: &SphereWrapper::default(), sent, begins };
                self.run(&places, own, &mut halo)
            });
            let end = ranks[0].1;
            let mut movers: Vec<Mover> = ranks.into_iter().flat_map(|(movers, _)| movers).collect();
            movers.sort_unstable_by_key(|mover| mover.id);
            (movers, end)
        }
    }

    #[test]
    fn ghosts_three_candidates_away_suffice_and_two_do_not() {
        let mut differ = 0;
        for case in 0..6 {
            let scene = scene(case);
            let all: Vec<u32> = (0..scene.movers.len() as u32).collect();
            let (mut expected, end) = scene.run(&all, all.len(), &mut Undivided);
            assert!(matches!(end, WindowEnd::Finished(50..)), "{end:?}");
            expected.sort_unstable_by_key(|mover| mover.id);
            assert!(scene.over_ranks(3) == (expected.clone(), end), "{case}");
            differ += u32::from(scene.over_ranks(2) != (expected, end));
        }
        assert!(differ > 0);
    }
}
