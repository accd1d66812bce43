//! How a run stands: all that a checkpoint keeps.

use serde::{Deserialize, Serialize};

use crate::Error;
use crate::arrivals::{Origin, Origins};
use crate::binding::Bound;
use crate::decay::Decays;
use crate::model::Model;
use crate::particles::Particles;
use crate::philox::Key;
use crate::ranks::Share;
use crate::receiver::Kind;
use crate::release::Released;

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
        Self::new_share(model, seed, Share::WHOLE)
    }

    /// The same where a rank of several has its share of what is released.
    pub(crate) fn new_share(model: &Model, seed: u64, share: Share) -> Result<Self, Error> {
        model.check()?;
        let centers = model.receivers.iter().map(|receiver| receiver.center).collect();
        let mut state = Self { totals: Totals::of(model), centers, ..Self::default() };
        state.release(model, (&Decays::new(model), Key::new(seed)), share)?;
        Ok(state)
    }

    /// All that does not belong to single particles, with these counts.
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

    /// The same as the part that one rank has of it. Of what was counted it has what it holds itself, and besides `is_first`
    /// says whether it has all.
    pub(crate) fn part(self, model: &Model, is_first: bool) -> Self {
        let mut totals = if is_first { self.totals } else { Totals::of(model) };
        totals.present.fill(0);
        self.particles.species.iter().for_each(|&species| totals.present[species as usize] += 1);
        for (receiver, held) in model.receivers.iter().zip(&mut totals.arrived) {
            if let Kind::Receptors(_) = receiver.kind {
                held.fill(0);
            }
        }
        for &Bound { receiver, species, .. } in &self.bound {
            totals.arrived[receiver as usize][species as usize] += 1;
        }
        Self { totals, ..self }
    }

    /// Whether it may be one of a model: there is a place for each receiver, and a receiver for what is bound.
    pub(crate) fn belongs_to(&self, model: &Model) -> bool {
        let receivers = model.receivers.len();
        let is_known = |species: u32| (species as usize) < model.species.len();
        let known = |held: &Bound| (held.receiver as usize) < receivers && is_known(held.species);
        self.centers.len() == receivers
            && self.totals.arrived.len() == receivers
            && self.bound.iter().all(known)
            && self.particles.species.iter().all(|&species| is_known(species))
    }

    /// Releases what is due at the beginning of the next step.
    pub(crate) fn release(
        &mut self,
        model: &Model,
        (decays, key): (&Decays, Key),
        share: Share,
    ) -> Result<(), Error> {
        let released = model.release_share((decays, key), self.step, self.next_id, share)?;
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

    /// All counts, in an order that depends on the model only.
    pub(crate) fn counts(&self) -> impl Iterator<Item = &u64> {
        let Self { present, released, arrived, reacted, decayed, pairs, contacts } = self;
        let lists = [present, released, reacted, decayed].into_iter().chain(arrived);
        lists.flatten().chain([pairs, contacts])
    }

    /// The same, to be changed.
    pub(crate) fn counts_mut(&mut self) -> impl Iterator<Item = &mut u64> {
        let Self { present, released, arrived, reacted, decayed, pairs, contacts } = self;
        let lists = [present, released, reacted, decayed].into_iter().chain(arrived);
        lists.flatten().chain([pairs, contacts])
    }

    /// Nothing yet.
    pub(crate) fn of(model: &Model) -> Self {
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
