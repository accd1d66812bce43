//! All ranks in one process, by the same functions that a rank calls: for tests, and to count the traffic of
//! a run on any number of ranks. Nothing here measures time.

use std::ops::ControlFlow;

use lazygrid::{Config, Detector, Error, Order, Spheres};

use crate::sample::{Choice, Sample};
use crate::search::Tally;
use crate::{Bodies, Body, Census, Found, Ghosts, Hull, Particle, Partition, Published, Search, tie};

/// The report of one rank.
#[derive(Clone, Debug, Default)]
pub struct Reported {
    /// The pairs as ids, the smaller one first, in any order.
    pub pairs: Vec<[u64; 2]>,
    /// The numbers of pairs that it met.
    pub tally: Tally,
}

/// The spheres that every rank owns, and the ghosts that it receives.
#[derive(Clone, Debug)]
pub struct Model {
    bodies: Bodies,
    owned: Vec<Vec<Particle>>,
    ghosts: Vec<Ghosts>,
    hulls: u64,
}

impl Model {
    /// Ranks that own what they are given.
    pub fn kept(owned: Vec<Vec<Particle>>, bodies: Bodies) -> Self {
        let ranks = owned.len();
        let of_ranks: Vec<Vec<Body>> = owned.iter().map(|own| bodies.of(own)).collect();
        let published = Published::new(of_ranks.iter().map(|own| Hull::of(own)));
        let hulls = (0..ranks as u32).map(|rank| published.of(rank).len() as u64).sum();
        let mut particles = vec![Vec::new(); ranks];
        let mut counts = vec![vec![0; ranks]; ranks];
        for (from, own) in of_ranks.iter().enumerate() {
            let sent = published.ghosts(from as u32, own, &bodies.space());
            for (to, sent) in sent.into_iter().enumerate() {
                counts[to][from] = sent.len();
                particles[to].extend(sent.into_iter().map(|k| owned[from][k as usize]));
            }
        }
        let ghosts =
            particles.into_iter().zip(&counts).map(|(all, counts)| Ghosts::new(all, counts)).collect();
        Self { bodies, owned, ghosts, hulls }
    }

    /// Ranks that share the particles out by a partition of their sample.
    pub fn balanced(particles: &[Particle], ranks: u32, bodies: Bodies) -> Self {
        let choice = Choice::new(particles.len() as u64, ranks);
        let center = |particle: &Particle| bodies.body(particle.sphere, particle.species).center;
        let chosen = particles.iter().filter(|particle| choice.takes(particle.id));
        let mut sample: Vec<_> = chosen.map(|particle| Sample::new(center(particle), particle.id)).collect();
        let partition = Partition::new(&mut sample, ranks);
        let mut owned = vec![Vec::new(); partition.parts() as usize];
        for particle in particles {
            let own = &mut owned[partition.part_of(center(particle), tie(particle.id)) as usize];
            own.push(Particle { index: own.len() as u32, ..*particle });
        }
        Self::kept(owned, bodies)
    }

    /// The number of spheres that each rank owns.
    pub fn owned(&self) -> Census {
        Census::of(&self.owned.iter().map(|own| own.len() as u64).collect::<Vec<_>>())
    }

    /// The number of ghosts that each rank receives.
    pub fn ghosts(&self) -> Census {
        Census::of(&self.ghosts.iter().map(|ghosts| ghosts.particles().len() as u64).collect::<Vec<_>>())
    }

    /// The number of hulls on all ranks.
    pub fn hulls(&self) -> u64 {
        self.hulls
    }

    /// Returns the report of each rank. The bodies have to be those of the space and interactions of `config`.
    ///
    /// # Errors
    /// The same as [`Detector::new`] and [`Detector::count`].
    pub fn pairs(&self, config: &Config) -> Result<Vec<Reported>, Error> {
        let each = self.owned.iter().zip(&self.ghosts).enumerate();
        each.map(|(rank, (owned, ghosts))| self.pairs_of(rank as u32, config, owned, ghosts)).collect()
    }

    fn pairs_of(
        &self,
        rank: u32,
        config: &Config,
        owned: &[Particle],
        ghosts: &Ghosts,
    ) -> Result<Reported, Error> {
        let detector = Detector::new(config.clone().order(Order::Unordered))?;
        let mut search = Search::new(detector, None, self.bodies.clone(), (rank, self.owned.len() as u32));
        let rows: Vec<_> = owned.iter().map(|particle| particle.sphere).collect();
        let species: Vec<_> = owned.iter().map(|particle| particle.species).collect();
        let spheres = Spheres::from(&rows).with_species(&species)?;
        let mut pairs = Vec::new();
        let tally = search.run(spheres, ghosts, |found, places| {
            let ids = |&[i, j]: &[u32; 2]| {
                let other = match found {
                    Found::Within => owned[j as usize].id,
                    Found::Across => ghosts.particles()[j as usize].id,
                };
                let own = owned[i as usize].id;
                [own.min(other), own.max(other)]
            };
            pairs.extend(places.iter().map(ids));
            ControlFlow::Continue(())
        })?;
        let counted = search.count(spheres, ghosts)?;
        debug_assert_eq!(counted.reported(), tally.reported());
        Ok(Reported { pairs, tally })
    }
}
