pub mod view;

use serde::{Deserialize, Serialize};

use crate::Error;
use crate::model::Model;
use crate::model::particles::Particles;
use crate::model::receiver::ReceiverKind;
use crate::motion::binding::Bound;
use crate::motion::receiver_state::ReceiverMove;
use crate::random::philox::Key;
use crate::release::origins::{Arrival, Origin, Origins};
use crate::release::rank_slice::RankSlice;
use crate::release::{PartialEvents, ReleaseStep, ReleasedParticles};

/// The state after a step and the releases at the beginning of the next one. With the model and the seed, it
/// determines the rest of the run bit for bit.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// Free particles.
    pub particles: Particles,
    /// Number of completed steps.
    pub step: u32,
    pub next_id: u32,
    pub totals: Totals,
    /// Centers of receivers, in µm.
    pub centers: Vec<[f32; 3]>,
    pub bound: Vec<Bound>,
    /// Empty if the model does not log arrivals.
    pub origins: Origins,
}

/// Counts of the moment, and sums since the beginning.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Totals {
    /// Free particles now, by species.
    pub present: Vec<u64>,
    /// Released particles, by species.
    pub released: Vec<u64>,
    /// Particles that were removed, or are bound now, by receiver and species.
    pub arrived: Vec<Vec<u64>>,
    /// Occupied receptors now, by receptor type in the order of receivers.
    pub occupied: Vec<u64>,
    /// Indexed by reaction.
    pub reacted: Vec<u64>,
    /// Indexed by decay.
    pub decayed: Vec<u64>,
    /// Pairs that the detector found in the last step.
    pub pairs: u64,
    /// Collisions and separated overlaps in the last step.
    pub contacts: u64,
}

#[derive(Clone, Copy, Debug)]
#[cfg_attr(not(feature = "gpu"), expect(dead_code, reason = "only the GPU path reads it"))]
pub(crate) struct RankStart<'a> {
    pub(crate) seed: u64,
    /// A [`State::into_rank_state`].
    pub(crate) state: &'a State,
    pub(crate) slice: RankSlice,
}

impl State {
    /// Creates the initial state, after the releases of step 0.
    ///
    /// # Errors
    /// [`Error::Model`] for an invalid model, and [`Error::OutOfIds`].
    pub fn new(model: &Model, seed: u64) -> Result<Self, Error> {
        Self::new_slice(model, seed, RankSlice::WHOLE)
    }

    pub(crate) fn new_slice(model: &Model, seed: u64, slice: RankSlice) -> Result<Self, Error> {
        model.check()?;
        let centers: Vec<_> = model.receivers.iter().map(|receiver| receiver.center).collect();
        let receiver_moves = ReceiverMove::at_rest(&centers);
        let mut state = Self { totals: Totals::new(model), centers, ..Self::default() };
        // No particle was released before step 0, so none arrives.
        let events = PartialEvents::new(model);
        let at = ReleaseStep {
            events: &events,
            key: Key::new(seed),
            step: 0,
            next_id: 0,
            receiver_moves: &receiver_moves,
        };
        state.release(model, at, slice)?;
        Ok(state)
    }

    pub(crate) fn without_particles(&self, totals: Totals) -> Self {
        let Self { particles: _, step, next_id, totals: _, centers, bound: _, origins } = self;
        Self {
            step: *step,
            next_id: *next_id,
            totals,
            centers: centers.clone(),
            origins: origins.clone(),
            ..Self::default()
        }
    }

    /// Returns the state of one rank, whose totals count its own particles. The first rank keeps all other totals.
    pub(crate) fn into_rank_state(self, model: &Model, is_first: bool) -> Self {
        let mut totals = if is_first { self.totals } else { Totals::new(model) };
        totals.present.fill(0);
        self.particles.species.iter().for_each(|&species| totals.present[species as usize] += 1);
        totals.occupied.fill(0);
        for (receiver, held) in model.receivers.iter().zip(&mut totals.arrived) {
            if let ReceiverKind::Receptors(_) = receiver.kind {
                held.fill(0);
            }
        }
        for &Bound { receiver, receptor, species, .. } in &self.bound {
            totals.arrived[receiver as usize][species as usize] += 1;
            totals.occupied[receptor as usize] += 1;
        }
        Self { totals, ..self }
    }

    /// Returns the origins, restored if no arrivals were logged and all ids are those of scheduled releases.
    pub(crate) fn restored_origins(&self, model: &Model, key: Key) -> Origins {
        if !model.logs_arrivals || self.origins != Origins::default() {
            return self.origins.clone();
        }
        let (mut origins, mut first) = (Origins::default(), 0_u64);
        let steps =
            (0..=self.step).flat_map(|step| model.releases(step, key).map(move |release| (step, release)));
        for (step, (transmitter, _, count)) in steps {
            origins.insert(first as u32, Some(Origin { transmitter, step }));
            first += u64::from(count);
            if first > self.next_id.into() {
                break;
            }
        }
        // Dissociations and programs give ids, too.
        if first == u64::from(self.next_id) { origins } else { self.origins.clone() }
    }

    pub(crate) fn belongs_to(&self, model: &Model) -> bool {
        let receivers = model.receivers.len();
        let is_known = |species: u32| (species as usize) < model.species.len();
        let lengths = |totals: &Totals| totals.lists().map(Vec::len).collect::<Vec<_>>();
        let is_of_species = |(&species, &radius): (&u32, &f32)| {
            model.species.get(species as usize).is_some_and(|species| species.radius == radius)
        };
        let first_types = model.first_receptor_types();
        let known = |held: &Bound| {
            let receiver = held.receiver as usize;
            receiver < receivers
                && (first_types[receiver]..first_types[receiver + 1]).contains(&held.receptor)
                && is_known(held.species)
        };
        self.centers.len() == receivers
            && lengths(&self.totals) == lengths(&Totals::new(model))
            && self.particles.has_whole_columns()
            && (self.particles.is_empty() || self.particles.has_velocity() == model.has_velocity())
            && self.bound.iter().all(known)
            && self.particles.species.iter().zip(&self.particles.radius).all(is_of_species)
    }

    /// Returns the arrivals since the release, by id.
    pub(crate) fn release(
        &mut self,
        model: &Model,
        at: ReleaseStep<'_>,
        slice: RankSlice,
    ) -> Result<Vec<Arrival>, Error> {
        let released = model.release(at, slice)?;
        self.particles.reserve(released.particles.len() as u64, model.has_velocity())?;
        if model.logs_arrivals {
            let mut first = at.next_id;
            for (transmitter, _, count) in model.releases(at.step, at.key) {
                self.origins.insert(first, Some(Origin { transmitter, step: at.step }));
                first += count;
            }
        }
        self.next_id = released.next_id;
        self.totals.add_released(&released);
        self.particles.append(released.particles);
        Ok(released.arrivals)
    }
}

impl Totals {
    pub(crate) fn add_released(&mut self, released: &ReleasedParticles) {
        let add =
            |totals: &mut Vec<u64>, more: &[u64]| totals.iter_mut().zip(more).for_each(|(t, m)| *t += m);
        add(&mut self.released, &released.released);
        add(&mut self.decayed, &released.decayed);
        released.particles.species.iter().for_each(|&species| self.present[species as usize] += 1);
        for arrival in &released.arrivals {
            self.arrived[arrival.receiver as usize][arrival.species as usize] += 1;
        }
    }

    fn lists(&self) -> impl Iterator<Item = &Vec<u64>> {
        let Self { present, released, arrived, occupied, reacted, decayed, pairs: _, contacts: _ } = self;
        [present, released, occupied, reacted, decayed].into_iter().chain(arrived)
    }

    pub(crate) fn counts(&self) -> impl Iterator<Item = &u64> {
        self.lists().flatten().chain([&self.pairs, &self.contacts])
    }

    pub(crate) fn counts_mut(&mut self) -> impl Iterator<Item = &mut u64> {
        let Self { present, released, arrived, occupied, reacted, decayed, pairs, contacts } = self;
        let lists = [present, released, occupied, reacted, decayed].into_iter().chain(arrived);
        lists.flatten().chain([pairs, contacts])
    }

    pub(crate) fn new(model: &Model) -> Self {
        let species = model.species.len();
        Self {
            present: vec![0; species],
            released: vec![0; species],
            arrived: vec![vec![0; species]; model.receivers.len()],
            occupied: vec![0; model.receptor_types().count()],
            reacted: vec![0; model.reactions.len()],
            decayed: vec![0; model.decays.len()],
            ..Self::default()
        }
    }
}
