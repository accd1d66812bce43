use std::ops::ControlFlow;

use lazygrid::{Detector, Error, Spheres};

use crate::across::{count_across, pairs_across};
use crate::rule::{Side, travels};
use crate::{Bodies, Class, Particle};

/// Pairs handed over at a time, at most.
const CHUNK: usize = 1 << 14;

/// Spheres of other ranks that came to this one, by the rank they came from.
#[derive(Clone, Debug, Default)]
pub struct Ghosts {
    particles: Vec<Particle>,
    /// Where those of each rank begin, and where the last end.
    starts: Vec<usize>,
}

impl Ghosts {
    /// Particles that came from rank 0, then those from rank 1, and so on, and how many came from each. What is more than
    /// all of these together is left out.
    pub fn new(mut particles: Vec<Particle>, counts: &[usize]) -> Self {
        let mut starts = vec![0];
        for count in counts {
            starts.push((starts[starts.len() - 1] + count).min(particles.len()));
        }
        particles.truncate(starts[starts.len() - 1]);
        Self { particles, starts }
    }

    /// All of them.
    pub fn particles(&self) -> &[Particle] {
        &self.particles
    }

    /// The rank that ghost `k` came from.
    #[inline]
    pub fn rank_of(&self, k: u32) -> u32 {
        (self.starts.partition_point(|&start| start <= k as usize) - 1) as u32
    }
}

/// What two spheres of a pair are, as [`Search::run`] tells it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Found {
    /// Both are owned; the smaller place first.
    Within,
    /// The first is owned, the second a ghost.
    Across,
}

/// How many pairs a search met.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Of owned spheres.
    pub within: u64,
    /// Of an owned sphere and a ghost, reported here.
    pub across: u64,
    /// Of an owned sphere and a ghost, reported by the ghost's owner.
    pub elsewhere: u64,
}

impl Tally {
    /// How many pairs this rank reports.
    pub fn reported(&self) -> u64 {
        self.within + self.across
    }
}

/// Finds the pairs that one rank reports.
#[derive(Debug)]
pub struct Search {
    detector: Detector,
    /// Where another detector is to search between two sets.
    across: Option<Detector>,
    bodies: Bodies,
    rank: u32,
    ranks: u32,
}

impl Search {
    /// For `rank` of `ranks`. The detector has to have the space and the interactions of the bodies, and every rank
    /// the same ones; its order does not matter. Between owned spheres and ghosts `across` searches, alike but on the
    /// CPU, if there is one.
    pub fn new(
        detector: Detector,
        across: Option<Detector>,
        bodies: Bodies,
        (rank, ranks): (u32, u32),
    ) -> Self {
        Self { detector, across, bodies, rank, ranks }
    }

    /// What the detector did last.
    pub fn detector(&self) -> &Detector {
        &self.detector
    }

    /// Hands over the pairs that this rank reports, as places among the owned spheres and among the ghosts, in chunks and
    /// in any order, until it has handed over all or is told to stop.
    ///
    /// # Errors
    /// The same as [`Detector::count`].
    pub fn run<F>(&mut self, owned: Spheres<'_>, ghosts: &Ghosts, mut consume: F) -> Result<Tally, Error>
    where
        F: FnMut(Found, &[[u32; 2]]) -> ControlFlow<()> + Send,
    {
        let mut stopped = false;
        let within = self.detector.stream(owned, CHUNK, |pairs| {
            let flow = consume(Found::Within, bytemuck::cast_slice(pairs));
            stopped = flow.is_break();
            flow
        })?;
        let mut tally = Tally { within, ..Tally::default() };
        if stopped || ghosts.particles.is_empty() || owned.is_empty() {
            return Ok(tally);
        }
        let sides = Sides::new(self, owned, ghosts);
        let mut kept = Vec::new();
        let across = self.across.as_mut().unwrap_or(&mut self.detector);
        pairs_across(across, owned, ghosts.particles(), |pairs| {
            kept.clear();
            kept.extend(pairs.iter().filter(|&&pair| sides.reports(pair)));
            tally.across += kept.len() as u64;
            tally.elsewhere += (pairs.len() - kept.len()) as u64;
            if kept.is_empty() { ControlFlow::Continue(()) } else { consume(Found::Across, &kept) }
        })?;
        Ok(tally)
    }

    /// How many pairs this rank reports; where no ghost was sent for one sphere and meets another one too, without looking
    /// at each.
    ///
    /// # Errors
    /// The same as [`Detector::count`].
    pub fn count(&mut self, owned: Spheres<'_>, ghosts: &Ghosts) -> Result<Tally, Error> {
        if ghosts.particles.is_empty() || owned.is_empty() {
            return Ok(Tally { within: self.detector.count(owned)?, ..Tally::default() });
        }
        if !Sides::new(self, owned, ghosts).all_report() {
            return self.run(owned, ghosts, |_, _| ControlFlow::Continue(()));
        }
        let within = self.detector.count(owned)?;
        let across = self.across.as_mut().unwrap_or(&mut self.detector);
        Ok(Tally { within, across: count_across(across, owned, ghosts.particles())?, elsewhere: 0 })
    }
}

/// Who has which class, for the rule.
struct Sides {
    owned: Vec<Class>,
    ghosts: Vec<Side>,
    rank: u32,
    ranks: u32,
}

impl Sides {
    fn new(search: &Search, owned: Spheres<'_>, ghosts: &Ghosts) -> Self {
        let class = |sphere, species| search.bodies.body(sphere, species).class();
        let species = owned.species();
        let own = |(k, sphere): (usize, _)| class(sphere, species.map_or(0, |species| species[k]));
        let ghost = |(k, ghost): (u32, &Particle)| Side {
            rank: ghosts.rank_of(k),
            class: class(ghost.sphere, ghost.species),
        };
        Self {
            owned: owned.iter().enumerate().map(own).collect(),
            ghosts: (0..).zip(ghosts.particles()).map(ghost).collect(),
            rank: search.rank,
            ranks: search.ranks,
        }
    }

    /// Returns `true` if the pair of an owned sphere and a ghost is reported here: the ghost is here on account of this
    /// sphere.
    #[inline]
    fn reports(&self, [own, ghost]: [u32; 2]) -> bool {
        let own = Side { rank: self.rank, class: self.owned[own as usize] };
        travels(self.ghosts[ghost as usize], own, self.ranks)
    }

    /// Returns `true` if every pair of an owned sphere and a ghost is reported here.
    fn all_report(&self) -> bool {
        // What travels to the largest class travels to all others.
        let largest = self.owned.iter().max();
        largest.is_none_or(|&class| {
            let own = Side { rank: self.rank, class };
            self.ghosts.iter().all(|&ghost| travels(ghost, own, self.ranks))
        })
    }
}
