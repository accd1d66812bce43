use std::ops::ControlFlow;

use lazygrid::{Algorithm, Backend, Config, Detector, Error, Order, Sphere, Spheres};

use crate::ghosts::ghost_rule::{RankAndClass, becomes_ghost};
use crate::memory::try_collect;
use crate::{Ghosts, Particle, SizeClass, SphereWrapper};

const CHUNK_PAIRS: usize = 1 << 14;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PairKind {
    /// Two owned spheres, the smaller index first.
    Local,
    /// An owned sphere, then a ghost.
    WithGhost,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PairCounts {
    pub local: u64,
    /// Reported by this rank.
    pub with_ghosts: u64,
    /// Reported by the ghost's owner.
    pub elsewhere: u64,
}

impl PairCounts {
    pub fn reported(&self) -> u64 {
        self.local + self.with_ghosts
    }

    /// Returns the counts after a stop at `reported` pairs.
    #[must_use]
    pub fn up_to(self, reported: u64) -> Self {
        let local = self.local.min(reported);
        Self { local, with_ghosts: self.with_ghosts.min(reported - local), ..self }
    }
}

#[derive(Debug)]
pub struct Search {
    detector: Detector,
    across: Option<Detector>,
    wrapper: SphereWrapper,
    rank: u32,
    ranks: u32,
}

impl Search {
    /// Creates the search of `rank`. A second detector, configured by `cpu`, searches between owned spheres and ghosts
    /// unless `detector` takes two sets on the CPU: a GPU would get all owned spheres again, and the paper's grids take
    /// one set. Both must have the wrapper's space and interactions.
    ///
    /// # Errors
    /// See [`Detector::new`], which gets `cpu`.
    pub fn new(
        detector: Detector,
        cpu: Config,
        wrapper: SphereWrapper,
        rank: u32,
        ranks: u32,
    ) -> Result<Self, Error> {
        let report = detector.report();
        let takes_two = matches!(report.algorithm, Algorithm::Auto | Algorithm::CellList | Algorithm::Naive);
        let second = || Detector::new(cpu.backend(Backend::Cpu).order(Order::Unordered));
        let across = if report.backend == Backend::Cpu && takes_two { None } else { Some(second()?) };
        Ok(Self { detector, across, wrapper, rank, ranks })
    }

    /// Requires a detector that takes two sets.
    pub(crate) fn by_one(detector: Detector, wrapper: SphereWrapper, rank: u32, ranks: u32) -> Self {
        Self { detector, across: None, wrapper, rank, ranks }
    }

    pub fn detector(&self) -> &Detector {
        &self.detector
    }

    /// Delivers this rank's pairs as indices, in unordered chunks, until `consume` breaks.
    ///
    /// # Errors
    /// See [`Detector::count`].
    pub fn run<F>(&mut self, owned: Spheres<'_>, ghosts: &Ghosts, mut consume: F) -> Result<PairCounts, Error>
    where
        F: FnMut(PairKind, &[[u32; 2]]) -> ControlFlow<()> + Send,
    {
        let mut stopped = false;
        let local = self.detector.stream(owned, CHUNK_PAIRS, |pairs| {
            let flow = consume(PairKind::Local, bytemuck::cast_slice(pairs));
            stopped = flow.is_break();
            flow
        })?;
        let mut counts = PairCounts { local, ..PairCounts::default() };
        if stopped || ghosts.particles().is_empty() || owned.is_empty() {
            return Ok(counts);
        }
        let classes = Classes::new(self, owned, ghosts)?;
        let mut reported = Vec::new();
        let rows = GhostRows::new(owned, ghosts)?;
        let across = self.across.as_mut().unwrap_or(&mut self.detector);
        across.stream((owned, rows.spheres()?), CHUNK_PAIRS, |pairs| {
            let pairs: &[[u32; 2]] = bytemuck::cast_slice(pairs);
            reported.clear();
            reported.extend(pairs.iter().filter(|&&pair| classes.reports(pair)));
            counts.with_ghosts += reported.len() as u64;
            counts.elsewhere += (pairs.len() - reported.len()) as u64;
            if reported.is_empty() {
                ControlFlow::Continue(())
            } else {
                consume(PairKind::WithGhost, &reported)
            }
        })?;
        Ok(counts)
    }

    /// Counts pairs one by one only if another rank may report some.
    ///
    /// # Errors
    /// See [`Detector::count`].
    pub fn count(&mut self, owned: Spheres<'_>, ghosts: &Ghosts) -> Result<PairCounts, Error> {
        if ghosts.particles().is_empty() || owned.is_empty() {
            return Ok(PairCounts { local: self.detector.count(owned)?, ..PairCounts::default() });
        }
        if !Classes::new(self, owned, ghosts)?.all_report() {
            return self.run(owned, ghosts, |_, _| ControlFlow::Continue(()));
        }
        let local = self.detector.count(owned)?;
        let across = self.across.as_mut().unwrap_or(&mut self.detector);
        let with_ghosts = across.count((owned, GhostRows::new(owned, ghosts)?.spheres()?))?;
        Ok(PairCounts { local, with_ghosts, elsewhere: 0 })
    }
}

struct GhostRows<'g> {
    /// Empty if the ghosts have `f64` rows.
    rows: Vec<Sphere>,
    doubles: Option<&'g [[f64; 4]]>,
    species: Option<Vec<u32>>,
}

impl<'g> GhostRows<'g> {
    fn new(owned: Spheres<'_>, ghosts: &'g Ghosts) -> Result<Self, Error> {
        let (doubles, ghosts) = (ghosts.doubles(), ghosts.particles());
        let species = owned.species().map(|_| {
            try_collect(ghosts.len(), ghosts.iter().map(|ghost| ghost.species), "the species of ghosts")
        });
        let rows = match doubles {
            Some(_) => Vec::new(),
            None => try_collect(ghosts.len(), ghosts.iter().map(|ghost| ghost.sphere), "ghosts")?,
        };
        Ok(Self { rows, doubles, species: species.transpose()? })
    }

    fn spheres(&self) -> Result<Spheres<'_>, Error> {
        let rows = self.doubles.map_or_else(|| Spheres::from(&self.rows), Spheres::from);
        Ok(match &self.species {
            Some(species) => rows.with_species(species)?,
            None => rows,
        })
    }
}

struct Classes {
    owned: Vec<SizeClass>,
    ghosts: Vec<RankAndClass>,
    rank: u32,
    ranks: u32,
}

impl Classes {
    fn new(search: &Search, owned: Spheres<'_>, ghosts: &Ghosts) -> Result<Self, Error> {
        let (wrapper, species, doubles) = (&search.wrapper, owned.species(), ghosts.doubles());
        let local = |k: usize| {
            let species = species.map_or(0, |species| species[k]);
            match doubles {
                Some(_) => wrapper.wrap_f64(owned.get_f64(k), species).class(),
                None => wrapper.wrap(owned.get(k), species).class(),
            }
        };
        let ghost = |(k, ghost): (u32, &Particle)| {
            let class = match doubles {
                Some(rows) => wrapper.wrap_f64(rows[k as usize], ghost.species).class(),
                None => wrapper.wrap(ghost.sphere, ghost.species).class(),
            };
            RankAndClass { rank: ghosts.rank_of(k), class }
        };
        let what = "the size classes of spheres";
        let particles = ghosts.particles();
        Ok(Self {
            owned: try_collect(owned.len(), (0..owned.len()).map(local), what)?,
            ghosts: try_collect(particles.len(), (0..).zip(particles).map(ghost), what)?,
            rank: search.rank,
            ranks: search.ranks,
        })
    }

    #[inline]
    fn reports(&self, [local, ghost]: [u32; 2]) -> bool {
        let local = RankAndClass { rank: self.rank, class: self.owned[local as usize] };
        becomes_ghost(self.ghosts[ghost as usize], local, self.ranks)
    }

    fn all_report(&self) -> bool {
        // A ghost for the largest class is one for all others.
        let largest = self.owned.iter().max();
        largest.is_none_or(|&class| {
            let local = RankAndClass { rank: self.rank, class };
            self.ghosts.iter().all(|&ghost| becomes_ghost(ghost, local, self.ranks))
        })
    }
}
