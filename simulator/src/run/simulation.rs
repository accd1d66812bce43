use lazygrid::{Algorithm, Backend, Config, Detector, Order};

use crate::Error;
use crate::model::Model;
use crate::model::particles::{Particle, Particles};
use crate::model::receiver::{ReceiverKind, all_inside};
use crate::motion::binding::{self, BindingRequest, Bound, UnboundParticle};
use crate::motion::collisions::Collisions;
use crate::motion::collisions::halo::{Halo, SingleProcess};
use crate::motion::contact::Contacts;
use crate::motion::propagate::{Event, Propagator};
use crate::motion::receiver_search::ReceiverSearch;
use crate::motion::receiver_state::{self, ReceiverMove};
use crate::motion::request_counts::RequestCounts;
use crate::motion::surface_diffusion::SurfaceSteps;
use crate::random::philox::{Key, Purpose, StepKey};
use crate::reaction::candidates::StepPairs;
use crate::reaction::dissociation::{Dissociated, Dissociation};
use crate::reaction::matching::Matching;
use crate::reaction::{ReactantChange, Reactions, interactions};
use crate::release::origins::Arrival;
use crate::release::rank_slice::RankSlice;
use crate::release::{PartialEvents, ReleaseStep};
use crate::state::State;

#[derive(Debug)]
pub struct Simulation {
    pub(crate) model: Model,
    pub(crate) key: Key,
    pub(crate) state: State,
    motion: Propagator,
    receiver_search: Option<ReceiverSearch>,
    pub(crate) reactions: Reactions,
    pub(crate) collisions: Option<Collisions>,
    pub(crate) contacts: Contacts,
    surface_steps: SurfaceSteps,
    pub(crate) dissociation: Dissociation,
    pub(crate) detector: Option<Detector>,
    matching: Matching,
    /// Ascending ids of particles that decays formed and that do not dissociate in the rest of the step, although their
    /// random words say so for a whole one.
    pub(crate) spared: Vec<u32>,
    partial_events: PartialEvents,
    arrivals: Vec<Arrival>,
    /// Since the run began or was resumed.
    pub(crate) requests: RequestCounts,
}

#[derive(Debug)]
pub(crate) struct StepMoves {
    events: Vec<Event>,
    leaving: Vec<UnboundParticle>,
    receiver_moves: Vec<ReceiverMove>,
}

impl Simulation {
    /// Begins a run in the caller's rayon pool. `algorithm` does not change the result.
    ///
    /// # Errors
    /// See [`State::new`], and [`Error::Detection`] if the detector refuses the model.
    pub fn new(model: Model, seed: u64, algorithm: Algorithm) -> Result<Self, Error> {
        let state = State::new(&model, seed)?;
        Self::resume(model, seed, algorithm, state)
    }

    /// # Errors
    /// See [`new`](Self::new).
    pub fn resume(model: Model, seed: u64, algorithm: Algorithm, mut state: State) -> Result<Self, Error> {
        model.check()?;
        if !state.belongs_to(&model) {
            return Err(Error::Model("the state is one of another model".to_owned()));
        }
        state.origins = state.restored_origins(&model, Key::new(seed));
        let motion = Propagator::new(&model);
        let detector = detector(&model, algorithm)?;
        Ok(Self {
            key: Key::new(seed),
            receiver_search: ReceiverSearch::new(&motion.surfaces.active_receivers, &model.boundary)?,
            motion,
            reactions: Reactions::new(&model),
            collisions: Collisions::new(&model)?,
            contacts: Contacts::new(&model),
            surface_steps: SurfaceSteps::new(&model),
            dissociation: Dissociation::new(&model),
            detector,
            matching: Matching::default(),
            spared: Vec::new(),
            partial_events: PartialEvents::new(&model),
            arrivals: Vec::new(),
            requests: RequestCounts::default(),
            model,
            state,
        })
    }

    pub fn model(&self) -> &Model {
        &self.model
    }

    pub fn state(&self) -> &State {
        &self.state
    }

    pub fn time(&self) -> f64 {
        f64::from(self.state.step) * self.model.time_step
    }

    /// Inserts particles with unused ids.
    ///
    /// # Errors
    /// [`Error::Model`] for an unknown species, or another radius than that of the species; nothing is inserted.
    pub fn insert(&mut self, particles: &Particles) -> Result<(), Error> {
        let with_velocity = self.model.has_velocity();
        let kinds = &self.model.species;
        for (&species, &radius) in particles.species.iter().zip(&particles.radius) {
            let what = match kinds.get(species as usize) {
                None => format!("a particle is of species {species} and the model has {}", kinds.len()),
                Some(kind) if kind.radius != radius => {
                    format!(
                        "a particle of species {} has the radius {radius} µm; use {} µm",
                        kind.name, kind.radius
                    )
                }
                Some(_) => continue,
            };
            return Err(Error::Model(what));
        }
        self.state.particles.reserve(particles.len() as u64, with_velocity)?;
        if self.model.logs_arrivals {
            self.state.origins.insert(self.state.next_id, None);
        }
        for at in 0..particles.len() {
            let particle = particles.get(at);
            self.state.next_id = self.state.next_id.max(particle.id.saturating_add(1));
            self.state.totals.released[particle.species as usize] += 1;
            self.state.totals.present[particle.species as usize] += 1;
            self.state.particles.push(particle, with_velocity);
        }
        Ok(())
    }

    pub fn inside(&self, receiver: usize) -> Vec<u64> {
        let center = self.state.centers[receiver];
        self.model.receivers[receiver].inside(center, &self.model.boundary, &self.state.particles)
    }

    /// Returns counts by receiver and species: arrivals so far, bound particles, or particles inside.
    pub fn received(&self) -> Vec<Vec<u64>> {
        let Self { model, state: State { particles, totals, centers, .. }, .. } = self;
        let mut received = all_inside(&model.receivers, centers, &model.boundary, particles);
        let counting = model.receivers.iter().zip(&totals.arrived).zip(&mut received);
        for ((_, arrived), says) in counting.filter(|((r, _), _)| r.kind != ReceiverKind::Transparent) {
            says.clone_from(arrived);
        }
        received
    }

    /// Returns the last step's arrivals by id, in a model that logs arrivals.
    pub fn arrivals(&self) -> &[Arrival] {
        &self.arrivals
    }

    /// Does a step: receivers and particles move, collide, hit walls and receivers, unbind and decay. Then pairs react
    /// or separate, and transmitters release.
    ///
    /// # Errors
    /// [`Error::OutOfIds`], [`Error::Collisions`], [`Error::LongPaths`], [`Error::NotFinite`], and [`Error::Step`] from
    /// the detector.
    pub fn step(&mut self) -> Result<(), Error> {
        let free = binding::free_receptors(&self.model, &self.state.totals.occupied);
        let moved = self.advance(&free, &mut SingleProcess)?;
        let rejected = self.requests.reject(self.binding_requests(&moved), &free);
        self.apply_events(&moved, &rejected);
        let outcomes = self.interact()?;
        let splits = self.splits();
        let parents = splits.iter().filter(|split| split.is_parent()).map(|split| split.id);
        let parents: Vec<u32> = parents.collect();
        self.conclude(&outcomes, &splits, &parents)?;
        self.finish(&moved, RankSlice::WHOLE)
    }

    /// Collective.
    pub(crate) fn advance<H: Halo>(&mut self, free: &[u32], halo: &mut H) -> Result<StepMoves, H::Error> {
        let now = StepKey { key: self.key, step: self.state.step };
        let Self { model, state, motion, receiver_search, collisions, contacts, surface_steps, .. } = self;
        surface_steps.advance(&mut state.bound, now);
        let leaving = binding::leaving(model, &state.bound, free, now);
        let receiver_moves = receiver_state::move_receivers(model, &state.centers, now.key, state.step);
        motion.surfaces.active_receivers.set(&state.centers, &receiver_moves, free);
        motion.set_flow(model, state.step);
        let mut flights = None;
        if let Some(collisions) = collisions {
            let flights = flights.insert(motion.flights(&state.particles, now));
            state.totals.contacts = collisions.resolve(&state.particles, flights, state.step, halo)?;
        }
        let events = motion.advance(&mut state.particles, receiver_search.as_mut(), flights.as_deref(), now);
        let events = halo.agree(events)?;
        state.centers = receiver_moves.iter().map(|receiver_move| receiver_move.center).collect();
        contacts.set_centers(&state.centers);
        Ok(StepMoves { events, leaving, receiver_moves })
    }

    pub(crate) fn binding_requests(&self, moved: &StepMoves) -> Vec<BindingRequest> {
        binding::requests(&moved.events, |at| self.state.particles.id[at as usize])
    }

    /// Applies events, without bindings of the ascending ids `rejected`.
    pub(crate) fn apply_events(&mut self, moved: &StepMoves, rejected: &[u32]) {
        let mut removed = Vec::new();
        self.arrivals.clear();
        self.spared.clear();
        for event in &moved.events {
            match *event {
                Event::Arrived { at, receiver } => {
                    let species = self.state.particles.species[at as usize];
                    self.state.totals.arrived[receiver as usize][species as usize] += 1;
                    if self.model.logs_arrivals {
                        let id = self.state.particles.id[at as usize];
                        let origin = self.state.origins.origin_of(id);
                        let step = self.state.step + 1;
                        self.arrivals.push(Arrival { receiver, species, id, step, origin });
                    }
                    self.transform(at, None, &mut removed);
                }
                Event::Bound { at, receiver, receptor, direction, .. } => {
                    let Particle { species, id, .. } = self.state.particles.get(at as usize);
                    if rejected.binary_search(&id).is_err() {
                        self.state.totals.arrived[receiver as usize][species as usize] += 1;
                        self.state.totals.occupied[receptor as usize] += 1;
                        self.state.bound.push(Bound { id, species, receiver, receptor, direction });
                        self.transform(at, None, &mut removed);
                    }
                }
                Event::Decayed { at, decay, product, spared } => {
                    if spared {
                        self.spared.push(self.state.particles.id[at as usize]);
                    }
                    self.state.totals.decayed[decay as usize] += 1;
                    self.transform(at, product, &mut removed);
                }
            }
        }
        self.arrivals.sort_unstable_by_key(|arrival| arrival.id);
        self.spared.sort_unstable();
        self.state.particles.remove(&mut removed);
        self.unbind(&moved.leaving);
    }

    fn unbind(&mut self, leaving: &[UnboundParticle]) {
        let Self { model, key, state, .. } = self;
        let with_velocity = model.has_velocity();
        // `swap_remove` fills a gap with a later entry, which was handled.
        for leaving in leaving.iter().rev() {
            let held = state.bound[leaving.at];
            let center = state.centers[held.receiver as usize];
            let Some(position) = binding::unbound_position(model, &held, *leaving, center) else { continue };
            let Bound { id, species, receiver, receptor, .. } = state.bound.swap_remove(leaving.at);
            let kind = &model.species[species as usize];
            let velocity = model.own_velocity(species, key.draw(id, 2, state.step, Purpose::Velocity));
            let particle = Particle { position, velocity, radius: kind.radius, species, id };
            state.particles.push(particle, with_velocity);
            state.totals.present[species as usize] += 1;
            state.totals.arrived[receiver as usize][species as usize] -= 1;
            state.totals.occupied[receptor as usize] -= 1;
        }
    }

    fn transform(&mut self, at: u32, product: Option<u32>, removed: &mut Vec<u32>) {
        let Self { model, key, state, .. } = self;
        let State { particles, totals, step, .. } = state;
        let index = at as usize;
        let from = particles.species[index];
        totals.present[from as usize] -= 1;
        let Some(species) = product else { return removed.push(at) };
        totals.present[species as usize] += 1;
        let radius = model.species[species as usize].radius;
        particles.species[index] = species;
        particles.radius[index] = radius;
        if !model.boundary.is_unbounded() {
            let domain = model.boundary.inset(radius);
            particles.set_position(index, domain.confine(particles.position_of(index)));
        }
        if model.has_velocity() {
            let words = || key.draw(particles.id[index], 1, *step, Purpose::Velocity);
            let velocity = model.converted_velocity(particles.get(index).velocity, [from, species], words);
            (0..3).for_each(|axis| particles.velocity[axis][index] = velocity[axis]);
        }
    }

    fn interact(&mut self) -> Result<Vec<ReactantChange>, Error> {
        let now = StepKey { key: self.key, step: self.state.step };
        let failed = |source| Error::Step { step: now.step, source };
        let Some(detector) = &mut self.detector else { return Ok(Vec::new()) };
        let particles = &mut self.state.particles;
        if self.reactions.is_empty() && !self.contacts.separate() {
            self.state.totals.pairs = detector.count(particles.spheres()?).map_err(failed)?;
            return Ok(Vec::new());
        }
        let pairs = detector.pairs(particles.spheres()?).map_err(failed)?;
        self.state.totals.pairs = pairs.len() as u64;
        let reactions = &self.reactions;
        let step_pairs = StepPairs { particles, pairs, spared: &self.spared, now };
        let chosen = self.matching.greedy(particles.len(), |consumed, best| {
            reactions.sample(step_pairs, |particle| consumed.contains(particle), best)
        })?;
        let outcomes = reactions.all_outcomes(particles, &chosen, now);
        chosen.iter().for_each(|c| self.state.totals.reacted[c.rule as usize] += 1);
        if self.contacts.separate() {
            // Reactants that come out unchanged stay free to move.
            let mut reacted: Vec<u32> = outcomes.iter().map(|outcome| outcome.at).collect();
            reacted.sort_unstable();
            let free = |at: u32| reacted.binary_search(&at).is_err();
            self.state.totals.contacts += self.contacts.resolve(particles, pairs, free, now);
        }
        Ok(outcomes)
    }

    /// Returns the dissociations by id.
    pub(crate) fn splits(&self) -> Vec<Dissociated> {
        let State { particles, step, .. } = &self.state;
        let mut splits = self.dissociation.splits(particles, &self.spared, self.key, *step);
        splits.sort_unstable_by_key(|split| split.id);
        splits
    }

    /// Applies reactions and dissociations. `parents` are ascending ids, in whose order second products get ids.
    pub(crate) fn conclude(
        &mut self,
        outcomes: &[ReactantChange],
        splits: &[Dissociated],
        parents: &[u32],
    ) -> Result<(), Error> {
        let first_id = self.state.next_id;
        let released = u64::from(first_id) + parents.len() as u64;
        if released > lazygrid::MAX_SPHERES {
            return Err(Error::OutOfIds { released });
        }
        self.state.next_id = released as u32;
        if self.model.logs_arrivals {
            for (id, &parent) in (first_id..).zip(parents) {
                self.state.origins.insert(id, self.state.origins.origin_of(parent));
            }
        }
        let mut removed = Vec::new();
        for outcome in outcomes {
            self.state.particles.set_position(outcome.at as usize, outcome.position);
            self.transform(outcome.at, outcome.product, &mut removed);
        }
        let mut born = Vec::new();
        for split in splits {
            self.state.totals.decayed[split.decay as usize] += 1;
            let nth = parents.partition_point(|&parent| parent < split.id) as u32;
            born.extend(self.second_product(split, first_id + nth));
            self.transform(split.at, split.products[0].map(|(species, ..)| species), &mut removed);
            if let Some((_, _, position)) = split.products[0] {
                self.state.particles.set_position(split.at as usize, position);
            }
        }
        let State { particles, totals, .. } = &mut self.state;
        particles.remove(&mut removed);
        for particle in born {
            totals.present[particle.species as usize] += 1;
            particles.push(particle, self.model.has_velocity());
        }
        Ok(())
    }

    /// Returns the second product. The particle at `split.at` must still be the parent.
    fn second_product(&self, split: &Dissociated, id: u32) -> Option<Particle> {
        let Self { model, key, state: State { particles, step, .. }, .. } = self;
        let (species, radius, position) = split.products[1]?;
        let parent = particles.get(split.at as usize);
        let words = || key.draw(split.id, 3, *step, Purpose::Velocity);
        let velocity = model.converted_velocity(parent.velocity, [parent.species, species], words);
        Some(Particle { position, velocity, radius, species, id })
    }

    pub(crate) fn finish(&mut self, moved: &StepMoves, slice: RankSlice) -> Result<(), Error> {
        self.state.step += 1;
        let State { step, next_id, .. } = self.state;
        let (events, key, receiver_moves) = (&self.partial_events, self.key, &moved.receiver_moves[..]);
        let at = ReleaseStep { events, key, step, next_id, receiver_moves };
        let arrivals = self.state.release(&self.model, at, slice)?;
        if self.model.logs_arrivals {
            self.arrivals.extend(arrivals);
        }
        Ok(())
    }
}

pub(crate) fn detector(model: &Model, algorithm: Algorithm) -> Result<Option<Detector>, Error> {
    let Some(table) = interactions(model)? else { return Ok(None) };
    let config = Config::default().backend(Backend::Cpu).algorithm(algorithm).order(Order::Unordered);
    Ok(Some(Detector::new(config.space(model.boundary.space()?).interactions(table))?))
}

#[cfg(test)]
mod tests;
