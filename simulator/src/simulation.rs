//! A run, step by step.

use lazygrid::{Algorithm, Backend, Config, Detector, Order};
use serde::{Deserialize, Serialize};

use crate::Error;
use crate::arrivals::{Arrival, Origin, Origins};
use crate::binding::{self, Bound, Leaving};
use crate::bodies;
use crate::contact::Contacts;
use crate::decay::Decays;
use crate::dissociation::{self, Dissociation};
use crate::matching::Matching;
use crate::model::{Contact, Model};
use crate::motion::{Event, Motion};
use crate::particles::{Particle, Particles};
use crate::philox::{Key, Purpose};
use crate::reactions::{Outcome, Reactions, interactions};
use crate::receiver::{Kind, all_inside};
use crate::release::Released;
use crate::vicinity::Vicinity;

/// All that changes in a run: with the model and the seed it says how the run goes on, to the last bit.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// The particles.
    pub particles: Particles,
    /// How many steps are done.
    pub step: u32,
    /// The id that the next particle gets.
    pub next_id: u32,
    /// What was counted.
    pub totals: Totals,
    /// Where the centres of receivers are, in µm.
    pub centers: Vec<[f32; 3]>,
    /// What their receptors hold.
    pub bound: Vec<Bound>,
    /// Where the particles are from, in a model that logs arrivals.
    pub origins: Origins,
}

/// Counts since the beginning of a run.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Totals {
    /// Particles now, by species.
    pub present: Vec<u64>,
    /// Particles released, by species.
    pub released: Vec<u64>,
    /// Particles that receivers removed, or that their receptors hold now, by receiver and species.
    pub arrived: Vec<Vec<u64>>,
    /// Reactions, in the order of the model.
    pub reacted: Vec<u64>,
    /// Decays, in the order of the model.
    pub decayed: Vec<u64>,
    /// Pairs that the detector found in the last step.
    pub pairs: u64,
    /// Overlaps that were settled in the last step.
    pub contacts: u64,
}

impl State {
    /// The beginning of a run, at which transmitters have released what is due at once.
    ///
    /// # Errors
    /// [`Error::Model`] where the model makes no sense, [`Error::OutOfIds`] where it releases too many particles.
    pub fn new(model: &Model, seed: u64) -> Result<Self, Error> {
        model.check()?;
        let centers = model.receivers.iter().map(|receiver| receiver.center).collect();
        let mut state = Self { totals: Totals::of(model), centers, ..Self::default() };
        state.release(model, &Decays::new(model), Key::new(seed))?;
        Ok(state)
    }

    /// Whether it may be one of a model: there is a place for each receiver, and a receiver for what is bound.
    fn belongs_to(&self, model: &Model) -> bool {
        let receivers = model.receivers.len();
        let known = |held: &Bound| {
            (held.receiver as usize) < receivers && (held.species as usize) < model.species.len()
        };
        self.centers.len() == receivers
            && self.totals.arrived.len() == receivers
            && self.bound.iter().all(known)
    }

    /// Releases what is due at the beginning of the next step.
    fn release(&mut self, model: &Model, decays: &Decays, key: Key) -> Result<(), Error> {
        let released = model.release(decays, key, self.step, self.next_id)?;
        if model.logs_arrivals {
            let mut first = self.next_id;
            for (transmitter, _, count) in model.releases(self.step, key) {
                self.origins.enter(first, Some(Origin { transmitter, step: self.step }));
                first += count;
            }
        }
        self.next_id = released.next_id;
        self.totals.enter(&released);
        self.particles.append(released.particles);
        Ok(())
    }
}

impl Totals {
    /// Enters what was released.
    pub(crate) fn enter(&mut self, released: &Released) {
        let add =
            |totals: &mut Vec<u64>, more: &[u64]| totals.iter_mut().zip(more).for_each(|(t, m)| *t += m);
        add(&mut self.released, &released.released);
        add(&mut self.decayed, &released.decayed);
        released.particles.species.iter().for_each(|&species| self.present[species as usize] += 1);
    }

    /// Nothing yet.
    fn of(model: &Model) -> Self {
        let species = model.species.len();
        Self {
            present: vec![0; species],
            released: vec![0; species],
            arrived: vec![vec![0; species]; model.receivers.len()],
            reacted: vec![0; model.reactions.len()],
            decayed: vec![0; model.decays.len()],
            ..Self::default()
        }
    }
}

/// A run: a model, a seed, and what has become of it.
#[derive(Debug)]
pub struct Simulation {
    model: Model,
    key: Key,
    state: State,
    motion: Motion,
    vicinity: Option<Vicinity>,
    reactions: Reactions,
    contacts: Contacts,
    dissociation: Dissociation,
    detector: Option<Detector>,
    matching: Matching,
    arrivals: Vec<Arrival>,
}

impl Simulation {
    /// The beginning of a run, in which pairs are found by `algorithm`, which does not change the result.
    ///
    /// The work is done in the rayon pool of whoever calls.
    ///
    /// # Errors
    /// As [`State::new`], and [`Error::Detection`] where the detector refuses the model.
    pub fn new(model: Model, seed: u64, algorithm: Algorithm) -> Result<Self, Error> {
        let state = State::new(&model, seed)?;
        Self::resume(model, seed, algorithm, state)
    }

    /// A run that goes on from a state of the same model and seed.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn resume(model: Model, seed: u64, algorithm: Algorithm, state: State) -> Result<Self, Error> {
        model.check()?;
        if !state.belongs_to(&model) {
            return Err(Error::Model("the state is one of another model".to_owned()));
        }
        let motion = Motion::new(&model);
        let detector = match interactions(&model)? {
            None => None,
            Some(table) => {
                let config = Config::default().backend(Backend::Cpu).algorithm(algorithm);
                let config = config.space(model.boundary.space()?);
                Some(Detector::new(config.order(Order::Unordered).interactions(table))?)
            }
        };
        Ok(Self {
            key: Key::new(seed),
            vicinity: Vicinity::new(&motion.bodies, &model.boundary)?,
            motion,
            reactions: Reactions::new(&model),
            contacts: Contacts::new(&model),
            dissociation: Dissociation::new(&model),
            detector,
            matching: Matching::default(),
            arrivals: Vec::new(),
            model,
            state,
        })
    }

    /// What is simulated.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Where the run stands.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// The time that has passed, in s.
    pub fn time(&self) -> f64 {
        f64::from(self.state.step) * self.model.time_step
    }

    /// Places particles by hand, beside what transmitters release. Their ids must not have been used.
    ///
    /// # Errors
    /// [`Error::Model`] for a species that the model does not have; then nothing is placed.
    pub fn insert(&mut self, particles: &Particles) -> Result<(), Error> {
        let with_velocity = self.model.has_velocity();
        let known = self.model.species.len();
        if let Some(species) = particles.species.iter().find(|&&species| species as usize >= known) {
            return Err(Error::Model(format!(
                "a particle is of species {species} and the model has {known}"
            )));
        }
        self.state.particles.reserve(particles.len() as u64, with_velocity)?;
        if self.model.logs_arrivals {
            self.state.origins.enter(self.state.next_id, None);
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

    /// How many particles of each species are now inside a receiver's sphere.
    pub fn inside(&self, receiver: usize) -> Vec<u64> {
        let center = self.state.centers[receiver];
        self.model.receivers[receiver].inside(center, &self.model.boundary, &self.state.particles)
    }

    /// What each receiver has to say, by species: arrivals so far, what its receptors hold, or how many are inside a
    /// transparent one.
    pub fn received(&self) -> Vec<Vec<u64>> {
        let Self { model, state: State { particles, totals, centers, .. }, .. } = self;
        let mut received = all_inside(&model.receivers, centers, &model.boundary, particles);
        let counting = model.receivers.iter().zip(&totals.arrived).zip(&mut received);
        for ((_, arrived), says) in counting.filter(|((r, _), _)| r.kind != Kind::Transparent) {
            says.clone_from(arrived);
        }
        received
    }

    /// Who arrived in the last step, in the order of ids, in a model that logs arrivals.
    pub fn arrivals(&self) -> &[Arrival] {
        &self.arrivals
    }

    /// Does one step: receivers and particles move, these meet walls and receivers, come off receptors, and may decay; pairs
    /// are found, react, and push each other away; transmitters release what is due next.
    ///
    /// # Errors
    /// [`Error::OutOfIds`], and [`Error::Step`] with what the detector said, such as that there are too many pairs.
    pub fn step(&mut self) -> Result<(), Error> {
        let Self { model, key, state, motion, vicinity, .. } = self;
        let now = (*key, state.step);
        let free = binding::free(model, &state.totals.arrived);
        let leaving = binding::leaving(model, &state.bound, &free, now);
        let places = bodies::moved(model, &state.centers, *key, state.step);
        motion.bodies.set(&state.centers, &places, &free);
        let events = motion.advance(&mut state.particles, vicinity.as_mut(), now)?;
        state.centers = places.iter().map(|place| place.center).collect();
        self.apply_events(&events, &free);
        self.let_off(&leaving);
        self.interact()?;
        self.state.step += 1;
        self.state.release(&self.model, &self.motion.decays, self.key)
    }

    fn apply_events(&mut self, events: &[Event], free: &[u32]) {
        let mut gone = Vec::new();
        self.arrivals.clear();
        let refused = binding::refused(events, free, |at| self.state.particles.id[at as usize]);
        for (k, event) in events.iter().enumerate() {
            match *event {
                Event::Arrived { at, receiver } => {
                    let species = self.state.particles.species[at as usize];
                    self.state.totals.arrived[receiver as usize][species as usize] += 1;
                    if self.model.logs_arrivals {
                        let id = self.state.particles.id[at as usize];
                        let origin = self.state.origins.of(id);
                        self.arrivals.push(Arrival { receiver, species, id, origin });
                    }
                    self.transform(at, None, &mut gone);
                }
                Event::Bound { at, receiver, direction, .. } if refused.binary_search(&k).is_err() => {
                    let Particle { species, id, .. } = self.state.particles.get(at as usize);
                    self.state.totals.arrived[receiver as usize][species as usize] += 1;
                    self.state.bound.push(Bound { id, species, receiver, direction });
                    self.transform(at, None, &mut gone);
                }
                Event::Bound { .. } => {}
                Event::Decayed { at, decay, product } => {
                    self.state.totals.decayed[decay as usize] += 1;
                    self.transform(at, product, &mut gone);
                }
            }
        }
        self.arrivals.sort_unstable_by_key(|arrival| arrival.id);
        self.state.particles.remove(&mut gone);
    }

    /// Puts what came off receptors back among the particles.
    fn let_off(&mut self, leaving: &[Leaving]) {
        let Self { model, key, state, .. } = self;
        let with_velocity = model.has_velocity();
        // Those behind move up into the gaps, and are done already.
        for leaving in leaving.iter().rev() {
            let held = state.bound[leaving.at()];
            let center = state.centers[held.receiver as usize];
            let Some(position) = binding::place_of(model, &held, *leaving, center) else { continue };
            let Bound { id, species, receiver, .. } = state.bound.swap_remove(leaving.at());
            let kind = &model.species[species as usize];
            let velocity = kind.own_velocity(key.draw(id, 2, state.step, Purpose::Velocity));
            let particle = Particle { position, velocity, radius: kind.radius, species, id };
            state.particles.push(particle, with_velocity);
            state.totals.present[species as usize] += 1;
            state.totals.arrived[receiver as usize][species as usize] -= 1;
        }
    }

    /// Turns a particle into another species, or enters it among those to be removed.
    fn transform(&mut self, at: u32, product: Option<u32>, gone: &mut Vec<u32>) {
        let Self { model, key, state, .. } = self;
        let State { particles, totals, step, .. } = state;
        let place = at as usize;
        let from = particles.species[place];
        totals.present[from as usize] -= 1;
        let Some(species) = product else { return gone.push(at) };
        totals.present[species as usize] += 1;
        let [old, new] = [from, species].map(|species| &model.species[species as usize]);
        particles.species[place] = species;
        particles.radius[place] = new.radius;
        if !model.boundary.is_open() {
            // What is larger than it was may stand in a wall.
            let room = model.boundary.inset(new.radius);
            particles.set_position(place, room.place(particles.position_of(place)));
        }
        if old.speed != new.speed {
            let velocity = match old.speed > 0.0 && new.speed > 0.0 {
                true => particles.get(place).velocity.map(|v| v * (new.speed / old.speed) as f32),
                false => new.own_velocity(key.draw(particles.id[place], 1, *step, Purpose::Velocity)),
            };
            (0..3).for_each(|axis| particles.velocity[axis][place] = velocity[axis]);
        }
    }

    /// Finds pairs and lets them react or push each other away, and lets apart what comes apart.
    fn interact(&mut self) -> Result<(), Error> {
        let (key, step) = (self.key, self.state.step);
        let failed = |source| Error::Step { step, source };
        let particles = &mut self.state.particles;
        let mut outcomes = Vec::new();
        match &mut self.detector {
            None => {}
            Some(detector) if self.reactions.is_empty() && self.model.contact == Contact::Count => {
                self.state.totals.pairs = detector.count(particles.spheres()?).map_err(failed)?;
            }
            Some(detector) => {
                let pairs = detector.pairs(particles.spheres()?).map_err(failed)?;
                self.state.totals.pairs = pairs.len() as u64;
                let mut candidates = self.reactions.candidates(particles, pairs, key, step);
                let chosen = self.matching.greedy(&mut candidates, particles.len());
                let reacts = || chosen.iter().map(|&c| &candidates[c as usize]);
                // All outcomes are found before any is applied, since a catalyst may be in several.
                outcomes.extend(
                    reacts().flat_map(|c| self.reactions.outcomes(particles, c, key, step)).flatten(),
                );
                reacts().for_each(|c| self.state.totals.reacted[c.rule as usize] += 1);
                if self.contacts.act() {
                    let mut reacted: Vec<u32> = reacts().flat_map(|c| c.at).collect();
                    reacted.sort_unstable();
                    let free = |at: u32| reacted.binary_search(&at).is_err();
                    self.state.totals.contacts = self.contacts.settle(particles, pairs, free, (key, step));
                }
            }
        }
        self.conclude(&outcomes)
    }

    /// Applies what comes of reactions, and what comes apart of the particles that are not used up by them.
    fn conclude(&mut self, outcomes: &[Outcome]) -> Result<(), Error> {
        let (key, step) = (self.key, self.state.step);
        let mut splits = Vec::new();
        if !self.dissociation.is_empty() {
            let mut taken: Vec<u32> = outcomes.iter().map(|outcome| outcome.at).collect();
            taken.sort_unstable();
            splits = self.dissociation.splits(&self.state.particles, &taken, key, step);
            // Ids are given in an order that does not depend on places.
            splits.sort_unstable_by_key(|split| split.id);
        }
        let mut gone = Vec::new();
        for outcome in outcomes {
            self.state.particles.set_position(outcome.at as usize, outcome.position);
            self.transform(outcome.at, outcome.product, &mut gone);
        }
        let mut born = Vec::new();
        for split in &splits {
            self.state.totals.decayed[split.decay as usize] += 1;
            let velocity = self.state.particles.get(split.at as usize).velocity;
            if self.model.logs_arrivals && split.products[1].is_some() {
                self.state.origins.enter(self.state.next_id, self.state.origins.of(split.id));
            }
            born.extend(dissociation::second(split, velocity, self.state.next_id));
            self.state.next_id = self.state.next_id.saturating_add(u32::from(split.products[1].is_some()));
            self.transform(split.at, split.products[0].map(|(species, ..)| species), &mut gone);
            if let Some((_, _, position)) = split.products[0] {
                self.state.particles.set_position(split.at as usize, position);
            }
        }
        let State { particles, totals, next_id, .. } = &mut self.state;
        if u64::from(*next_id) > lazygrid::MAX_SPHERES {
            return Err(Error::OutOfIds { released: (*next_id).into() });
        }
        particles.remove(&mut gone);
        for particle in born {
            totals.present[particle.species as usize] += 1;
            particles.push(particle, self.model.has_velocity());
        }
        Ok(())
    }
}
