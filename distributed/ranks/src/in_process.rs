//! All ranks in one process, for tests.

use std::ops::ControlFlow;

use lazygrid::{Config, Detector, Error, Order, Spheres};

use crate::sample::{Sample, SampleFilter};
use crate::{
    ClassBounds, Ghosts, LoadBalance, PairCounts, PairKind, Particle, Partition, RankBounds, Search,
    SphereWrapper, WrappedSphere, tie_breaker,
};

#[derive(Clone, Debug, Default)]
pub struct RankPairs {
    /// Ids, the smaller first, in any order.
    pub pairs: Vec<[u64; 2]>,
    pub counts: PairCounts,
}

#[derive(Clone, Debug)]
pub struct InProcessRanks {
    wrapper: SphereWrapper,
    owned: Vec<Vec<Particle>>,
    ghosts: Vec<Ghosts>,
    bounds: u64,
}

impl InProcessRanks {
    /// # Errors
    /// [`Error::OutOfMemory`].
    pub fn with_owners(owned: Vec<Vec<Particle>>, wrapper: SphereWrapper) -> Result<Self, Error> {
        let ranks = owned.len();
        let wrap = |particles: &Vec<Particle>| wrapper.wrap_all(particles.iter().copied());
        let of_ranks: Vec<Vec<WrappedSphere>> = owned.iter().map(wrap).collect::<Result<_, _>>()?;
        let all = RankBounds::new(of_ranks.iter().map(|wrapped| ClassBounds::all_of(wrapped)));
        let bounds = (0..ranks as u32).map(|rank| all.of_rank(rank).len() as u64).sum();
        let mut particles = vec![Vec::new(); ranks];
        let mut counts = vec![vec![0; ranks]; ranks];
        for (from, wrapped) in of_ranks.iter().enumerate() {
            let sent = all.ghosts(from as u32, wrapped, &wrapper)?;
            for (to, sent) in sent.into_iter().enumerate() {
                counts[to][from] = sent.len();
                particles[to].extend(sent.into_iter().map(|k| owned[from][k as usize]));
            }
        }
        let ghosts =
            particles.into_iter().zip(&counts).map(|(all, counts)| Ghosts::new(all, counts)).collect();
        Ok(Self { wrapper, owned, ghosts, bounds })
    }

    /// Assigns particles to the ranks of their domains.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    pub fn balanced(particles: &[Particle], ranks: u32, wrapper: SphereWrapper) -> Result<Self, Error> {
        let filter = SampleFilter::new(particles.len() as u64, ranks);
        let center = |particle: &Particle| wrapper.wrap(particle.sphere, particle.species).center;
        let chosen = particles.iter().filter(|particle| filter.takes(particle.id));
        let mut sample: Vec<_> = chosen.map(|particle| Sample::new(center(particle), particle.id)).collect();
        let partition = Partition::new(&mut sample, ranks);
        let mut owned = vec![Vec::new(); partition.domains() as usize];
        for particle in particles {
            let domain = &mut owned[partition.domain_of(center(particle), tie_breaker(particle.id)) as usize];
            domain.push(Particle { index: domain.len() as u32, ..*particle });
        }
        Self::with_owners(owned, wrapper)
    }

    pub fn owned(&self) -> LoadBalance {
        LoadBalance::from_counts(
            &self.owned.iter().map(|particles| particles.len() as u64).collect::<Vec<_>>(),
        )
    }

    pub fn ghosts(&self) -> LoadBalance {
        LoadBalance::from_counts(
            &self.ghosts.iter().map(|ghosts| ghosts.particles().len() as u64).collect::<Vec<_>>(),
        )
    }

    pub fn bounds(&self) -> u64 {
        self.bounds
    }

    /// The wrapper must have the space and interactions of `config`.
    ///
    /// # Errors
    /// See [`Detector::new`] and [`Detector::count`].
    pub fn pairs(&self, config: &Config) -> Result<Vec<RankPairs>, Error> {
        let each = self.owned.iter().zip(&self.ghosts).enumerate();
        each.map(|(rank, (owned, ghosts))| self.pairs_of(rank as u32, config, owned, ghosts)).collect()
    }

    fn pairs_of(
        &self,
        rank: u32,
        config: &Config,
        owned: &[Particle],
        ghosts: &Ghosts,
    ) -> Result<RankPairs, Error> {
        let detector = Detector::new(config.clone().order(Order::Unordered))?;
        let mut search = Search::by_one(detector, self.wrapper.clone(), rank, self.owned.len() as u32);
        let rows: Vec<_> = owned.iter().map(|particle| particle.sphere).collect();
        let species: Vec<_> = owned.iter().map(|particle| particle.species).collect();
        let spheres = Spheres::from(&rows).with_species(&species)?;
        let mut pairs = Vec::new();
        let counts = search.run(spheres, ghosts, |kind, pairs_found| {
            let ids = |&[i, j]: &[u32; 2]| {
                let other = match kind {
                    PairKind::Local => owned[j as usize].id,
                    PairKind::WithGhost => ghosts.particles()[j as usize].id,
                };
                let id = owned[i as usize].id;
                [id.min(other), id.max(other)]
            };
            pairs.extend(pairs_found.iter().map(ids));
            ControlFlow::Continue(())
        })?;
        if cfg!(debug_assertions) {
            let counted = search.count(spheres, ghosts)?;
            assert_eq!(counted.reported(), counts.reported());
        }
        Ok(RankPairs { pairs, counts })
    }
}
