use std::ops::ControlFlow;

use bytemuck::{Pod, Zeroable};
use lazygrid::{Config, Detector, Order, Pair};
use lazygrid_ranks::{
    Communicator, Ghosts, PairKind, Partitioner, RankBounds, Search, SphereWrapper, send_to_ranks,
};

use super::agree;
use super::contacts::{SharedParticles, separate};
use super::matching::DistributedMatching;
use super::rows;
use crate::random::philox::StepKey;
use crate::reaction::candidates::{BestCandidates, StepPairs};
use crate::reaction::{ReactantChange, interactions};
use crate::{Error, Model, Simulation, State};

#[derive(Debug)]
pub(super) struct RankPairSearch {
    wrapper: SphereWrapper,
    search: Search,
    partitioner: Partitioner,
    matching: DistributedMatching,
}

#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct OutcomeMessage {
    at: u32,
    /// 1 plus the product's species; 0 removes the particle.
    product: u32,
    position: [f32; 3],
}

/// Load relative to the mean above which space is repartitioned.
const MAX_IMBALANCE: f64 = 1.2;

impl RankPairSearch {
    pub(super) fn new(model: &Model, detector: Config, rank: u32, ranks: u32) -> Result<Option<Self>, Error> {
        let (space, interactions) = (model.boundary.space()?, interactions(model)?);
        let wrapper = SphereWrapper::new(space, interactions.as_ref());
        let Some(table) = interactions else { return Ok(None) };
        let of_model =
            |config: Config| config.space(space).interactions(table.clone()).order(Order::Unordered);
        let detector = Detector::new(of_model(detector))?;
        let search = Search::new(detector, of_model(Config::default()), wrapper.clone(), rank, ranks)?;
        Ok(Some(Self {
            wrapper,
            search,
            partitioner: Partitioner::default(),
            matching: DistributedMatching::default(),
        }))
    }

    pub(super) fn migrate<C: Communicator>(
        &mut self,
        communicator: &mut C,
        run: &mut Simulation,
    ) -> Result<(), C::Error> {
        let State { particles, totals, .. } = &mut run.state;
        let wrapped = rows::wrapped(&self.wrapper, particles);
        let ids: Vec<u64> = particles.id.iter().map(|&id| id.into()).collect();
        let ranks = self.partitioner.assign(communicator, &wrapped, &ids, MAX_IMBALANCE)?.ranks;
        let own_rank = communicator.rank();
        let mut leaving: Vec<u32> =
            (0..).zip(&ranks).filter(|&(_, &rank)| rank != own_rank).map(|(at, _)| at).collect();
        let send = leaving.iter().map(|&at| (ranks[at as usize], rows::row(particles, at))).collect();
        let (came, _) = send_to_ranks(communicator, "particles that change rank", send)?;
        leaving.iter().for_each(|&at| totals.present[particles.species[at as usize] as usize] -= 1);
        particles.remove(&mut leaving);
        let came = rows::particles(&came, run.model.has_velocity());
        came.species.iter().for_each(|&species| totals.present[species as usize] += 1);
        particles.append(came);
        Ok(())
    }

    pub(super) fn interact<C: Communicator>(
        &mut self,
        communicator: &mut C,
        run: &mut Simulation,
    ) -> Result<Vec<ReactantChange>, C::Error> {
        self.migrate(communicator, run)?;
        let (ghosts, sent) = self.ghosts(communicator, run)?;
        let own_count = run.state.particles.len();
        let separates = run.contacts.separate();
        if run.reactions.is_empty() && !separates {
            return agree(communicator, self.count(run, &ghosts)).map(|()| Vec::new());
        }
        for ghost in ghosts.particles() {
            run.state.particles.push(rows::from_ghost(ghost), run.model.has_velocity());
        }
        let pairs = if separates { self.list(run, &ghosts).map(Some) } else { Ok(None) };
        let pairs = agree(communicator, pairs)?;
        let Self { search, matching, .. } = self;
        let sample = |taken: &[bool], best: &mut BestCandidates| match &pairs {
            Some(pairs) => sample(run, pairs, taken, best),
            None => {
                let mut sampled = Ok(());
                run.state.totals.pairs = find(search, run, &ghosts, |pairs| {
                    sampled = sample(run, pairs, taken, best);
                    if sampled.is_ok() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
                })?;
                sampled
            }
        };
        let chosen = matching.greedy(communicator, own_count, &ghosts, sample)?;
        let now = StepKey { key: run.key, step: run.state.step };
        let outcomes = run.reactions.all_outcomes(&run.state.particles, &chosen, now);
        chosen.iter().for_each(|c| run.state.totals.reacted[c.rule as usize] += 1);
        let outcomes = deliver_outcomes(communicator, outcomes, own_count, &ghosts)?;
        if let Some(pairs) = pairs {
            let reacted = outcomes.iter().map(|outcome| outcome.at).collect();
            let shared = SharedParticles { own_count, ghosts: &ghosts, sent: &sent };
            separate(communicator, run, shared, &pairs, reacted)?;
        }
        run.state.particles.truncate(own_count);
        Ok(outcomes)
    }

    /// Returns ghosts here, and this rank's particles sent as ghosts to each rank.
    fn ghosts<C: Communicator>(
        &self,
        communicator: &mut C,
        run: &Simulation,
    ) -> Result<(Ghosts, Vec<Vec<u32>>), C::Error> {
        let particles = &run.state.particles;
        let wrapped = rows::wrapped(&self.wrapper, particles);
        let bounds = RankBounds::gather(communicator, &wrapped)?;
        let leaving = bounds.ghosts(communicator.rank(), &wrapped, &self.wrapper);
        let leaving = communicator.agree(leaving.map_err(|error| communicator.detector_failure(error)))?;
        let ghosts = Ghosts::exchange(communicator, &leaving, |at| rows::ghost(particles, at))?;
        Ok((ghosts, leaving))
    }

    fn count(&mut self, run: &mut Simulation, ghosts: &Ghosts) -> Result<(), Error> {
        let State { particles, totals, step, .. } = &mut run.state;
        let failed = |source| Error::Step { step: *step, source };
        totals.pairs = self.search.count(particles.spheres()?, ghosts).map_err(failed)?.reported();
        Ok(())
    }

    fn list(&mut self, run: &mut Simulation, ghosts: &Ghosts) -> Result<Vec<Pair>, Error> {
        let (mut all, mut refused) = (Vec::new(), Ok(()));
        run.state.totals.pairs = find(&mut self.search, run, ghosts, |pairs| {
            if all.try_reserve(pairs.len()).is_err() {
                let bytes = ((all.len() + pairs.len()) * size_of::<Pair>()) as u64;
                refused = Err(lazygrid::Error::OutOfMemory { what: "pairs", bytes });
                return ControlFlow::Break(());
            }
            all.extend_from_slice(pairs);
            ControlFlow::Continue(())
        })?;
        let step = run.state.step;
        refused.map(|()| all).map_err(|source| Error::Step { step, source })
    }
}

/// Ghosts are the last particles.
fn find(
    search: &mut Search,
    run: &Simulation,
    ghosts: &Ghosts,
    mut consume: impl FnMut(&[Pair]) -> ControlFlow<()> + Send,
) -> Result<u64, Error> {
    let State { particles, step, .. } = &run.state;
    let own_count = particles.len() - ghosts.particles().len();
    let mut across = Vec::new();
    let counts = search.run(particles.first_spheres(own_count)?, ghosts, |found, pairs| {
        let pairs = match found {
            PairKind::Local => pairs,
            PairKind::WithGhost => {
                across.clear();
                across.extend(pairs.iter().map(|&[i, j]| [i, own_count as u32 + j]));
                &across
            }
        };
        consume(bytemuck::cast_slice(pairs))
    });
    Ok(counts.map_err(|source| Error::Step { step: *step, source })?.reported())
}

fn sample(run: &Simulation, pairs: &[Pair], taken: &[bool], best: &mut BestCandidates) -> Result<(), Error> {
    let Simulation { key, spared, state: State { particles, step, .. }, .. } = run;
    let pairs = StepPairs { particles, pairs, spared, now: StepKey { key: *key, step: *step } };
    run.reactions.sample(pairs, |particle| taken[particle as usize], best)
}

fn deliver_outcomes<C: Communicator>(
    communicator: &mut C,
    mut outcomes: Vec<ReactantChange>,
    own_count: usize,
    ghosts: &Ghosts,
) -> Result<Vec<ReactantChange>, C::Error> {
    let ghost_of =
        |outcome: &ReactantChange| (outcome.at as usize).checked_sub(own_count).map(|ghost| ghost as u32);
    let message = |outcome: &ReactantChange| {
        let ghost = ghost_of(outcome)?;
        let at = ghosts.particles()[ghost as usize].index;
        let product = outcome.product.map_or(0, |species| species + 1);
        Some((ghosts.rank_of(ghost), OutcomeMessage { at, product, position: outcome.position }))
    };
    let send = outcomes.iter().filter_map(message).collect();
    let (came, _) = send_to_ranks(communicator, "outcomes of ghosts", send)?;
    outcomes.retain(|outcome| ghost_of(outcome).is_none());
    outcomes.extend(came.into_iter().map(|OutcomeMessage { at, product, position }| ReactantChange {
        at,
        product: product.checked_sub(1),
        position,
    }));
    Ok(outcomes)
}

#[cfg(test)]
mod tests {
    use lazygrid::{Algorithm, Backend};
    use lazygrid_ranks::threads;

    use super::*;
    use crate::model::particles::{Particle, Particles};
    use crate::random::philox::{open_unit, philox};
    use crate::{Reaction, Species};

    /// Returns the ghosts on all ranks of 4000 particles that react within `distances`.
    fn ghosts(distances: [f32; 2]) -> usize {
        let species = |name: &str| Species { name: name.into(), ..Species::default() };
        let reaction = |(other, binding_radius)| Reaction {
            reactants: [0, other],
            binding_radius,
            ..Reaction::default()
        };
        let model = Model {
            time_step: 1.0,
            species: vec![species("A"), species("B")],
            reactions: (0..).zip(distances).map(reaction).collect(),
            ..Model::default()
        };
        let particle = |id: u32| {
            let [x, y, z, _] = philox([id, 0, 0, 0], [1, 2]).map(|word| 10.0 * open_unit(word));
            Particle { position: [x, y, z], id, ..Particle::default() }
        };
        let of_ranks = threads::on(4, |mut thread| {
            let (rank, ranks) = (thread.rank(), thread.ranks());
            let mut run = Simulation::new(model.clone(), 1, Algorithm::Auto).expect("a model");
            let mut particles = Particles::default();
            (0..4000).filter(|id| id % ranks == rank).for_each(|id| particles.push(particle(id), false));
            run.insert(&particles).expect("points");
            let config = Config::default().backend(Backend::Cpu);
            let search = RankPairSearch::new(&model, config, rank, ranks).expect("a detector");
            let mut search = search.expect("reactions");
            search.migrate(&mut thread, &mut run).expect("parts of space");
            search.ghosts(&mut thread, &run).expect("ghosts").0.particles().len()
        });
        of_ranks.into_iter().sum()
    }

    #[test]
    fn ghosts_are_within_the_distance_of_their_species() {
        // Two planes divide a box 10 wide, so about 4000 · 2 · 0.01 / 10 particles are within 0.01 of one.
        let [narrow, wide] = [[0.01, 2.0], [2.0, 2.0]].map(ghosts);
        assert!(narrow < 30 && wide > 1000, "{narrow} and {wide}");
    }
}
