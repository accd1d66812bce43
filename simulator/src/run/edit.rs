//! Changes between steps by a program. A GPU run reads the state back for each and uploads it again. New particles take
//! the next free ids, which determine their random numbers.

use std::ops::Range;

use crate::model::Model;
use crate::model::particles::{Particle, Particles};
use crate::motion::receiver_state::ReceiverMove;
use crate::random::philox::{Key, Purpose};
use crate::release::origins::Origin;
use crate::release::{Batch, Emission};
use crate::{AnySimulation, Error, Simulation, State};

impl State {
    pub(crate) fn add(
        &mut self,
        model: &Model,
        key: Key,
        species: u32,
        positions: &[[f32; 3]],
    ) -> Result<Range<u32>, Error> {
        let kind = known_species(model, species)?;
        if let Some(at) = positions.iter().position(|position| position.iter().any(|x| !x.is_finite())) {
            let position = positions[at];
            return Err(Error::Model(format!("position {at} is {position:?}; it must be finite")));
        }
        let ids = self.take_ids(positions.len() as u64)?;
        self.particles.reserve(positions.len() as u64, model.has_velocity())?;
        let domain = model.boundary.inset(kind.radius);
        for (id, &position) in ids.clone().zip(positions) {
            let velocity = model.own_velocity(species, key.draw(id, 0, 0, Purpose::Velocity));
            let position = domain.confine(position);
            let particle = Particle { position, velocity, radius: kind.radius, species, id };
            self.particles.push(particle, model.has_velocity());
        }
        self.next_id = ids.end;
        self.totals.released[species as usize] += positions.len() as u64;
        self.totals.present[species as usize] += positions.len() as u64;
        if model.logs_arrivals {
            self.origins.insert(ids.start, None);
        }
        Ok(ids)
    }

    pub(crate) fn remove(&mut self, ids: &[u32]) -> usize {
        let mut ids = ids.to_vec();
        ids.sort_unstable();
        let is_named = |id: u32| ids.binary_search(&id).is_ok();
        let indices = (0_u32..).zip(&self.particles.id).filter(|&(_, &id)| is_named(id));
        let mut indices: Vec<u32> = indices.map(|(index, _)| index).collect();
        for &index in &indices {
            self.totals.present[self.particles.species[index as usize] as usize] -= 1;
        }
        self.particles.remove(&mut indices);
        let before = self.bound.len();
        let (arrived, occupied) = (&mut self.totals.arrived, &mut self.totals.occupied);
        self.bound.retain(|bound| {
            let is_retained = !is_named(bound.id);
            if !is_retained {
                arrived[bound.receiver as usize][bound.species as usize] -= 1;
                occupied[bound.receptor as usize] -= 1;
            }
            is_retained
        });
        indices.len() + before - self.bound.len()
    }

    pub(crate) fn emit(&mut self, model: &Model, key: Key, emission: Emission) -> Result<Range<u32>, Error> {
        let Emission { transmitter, species, count } = emission;
        let from = model.transmitters.get(transmitter as usize).ok_or_else(|| {
            let known = model.transmitters.len();
            Error::Model(format!("there is no transmitter {transmitter}; the model has {known}"))
        })?;
        known_species(model, species)?;
        let ids = self.take_ids(count.into())?;
        self.particles.reserve(count.into(), model.has_velocity())?;
        let batch = Batch::from_ids(from, emission, ids.start, &ReceiverMove::at_rest(&self.centers));
        let released = model.burst(&batch, key)?;
        self.next_id = ids.end;
        self.totals.add_released(&released);
        self.particles.append(released.particles);
        if model.logs_arrivals {
            self.origins.insert(ids.start, Some(Origin { transmitter, step: self.step }));
        }
        Ok(ids)
    }

    fn take_ids(&self, count: u64) -> Result<Range<u32>, Error> {
        let released = u64::from(self.next_id) + count;
        match released > lazygrid::MAX_SPHERES {
            true => Err(Error::OutOfIds { released }),
            false => Ok(self.next_id..released as u32),
        }
    }
}

fn known_species(model: &Model, species: u32) -> Result<&crate::Species, Error> {
    model.species.get(species as usize).ok_or_else(|| {
        let known = model.species.len();
        Error::Model(format!("there is no species {species}; the model has {known}"))
    })
}

impl Simulation {
    /// Adds particles at positions in µm, confined to the boundary, with velocities as released. Returns the ids.
    ///
    /// # Errors
    /// [`Error::Model`] for an unknown species or a non-finite position; [`Error::OutOfIds`]; those of
    /// [`Particles::reserve`]. Then nothing changes.
    pub fn add(&mut self, species: u32, positions: &[[f32; 3]]) -> Result<Range<u32>, Error> {
        self.state.add(&self.model, self.key, species, positions)
    }

    /// Removes free or bound particles by id, and returns their number. Ignores unknown ids.
    pub fn remove(&mut self, ids: &[u32]) -> usize {
        self.state.remove(ids)
    }

    /// Releases particles besides the schedule. Their ids determine lattice sites.
    ///
    /// # Errors
    /// [`Error::Model`] for an unknown transmitter or species; otherwise as [`add`](Self::add).
    pub fn emit(&mut self, transmitter: u32, species: u32, count: u32) -> Result<Range<u32>, Error> {
        self.state.emit(&self.model, self.key, Emission { transmitter, species, count })
    }

    /// Takes the particles, which a program can keep, and leaves a copy.
    ///
    /// # Errors
    /// See [`Particles::reserve`]; nothing changes then.
    pub fn detach_particles(&mut self) -> Result<Particles, Error> {
        let copy = self.state.particles.try_clone()?;
        Ok(std::mem::replace(&mut self.state.particles, copy))
    }
}

impl AnySimulation {
    /// See [`Simulation::add`].
    ///
    /// # Errors
    /// Also [`Error::Detection`] from the GPU.
    pub fn add(&mut self, species: u32, positions: &[[f32; 3]]) -> Result<Range<u32>, Error> {
        self.edit(|state, model, key| state.add(model, key, species, positions))
    }

    /// See [`Simulation::remove`].
    ///
    /// # Errors
    /// [`Error::Detection`] if the GPU fails.
    pub fn remove(&mut self, ids: &[u32]) -> Result<usize, Error> {
        self.edit(|state, _, _| Ok(state.remove(ids)))
    }

    /// See [`Simulation::emit`].
    ///
    /// # Errors
    /// Also [`Error::Detection`] from the GPU.
    pub fn emit(&mut self, transmitter: u32, species: u32, count: u32) -> Result<Range<u32>, Error> {
        let emission = Emission { transmitter, species, count };
        self.edit(|state, model, key| state.emit(model, key, emission))
    }

    fn edit<T>(
        &mut self,
        change: impl FnOnce(&mut State, &Model, Key) -> Result<T, Error>,
    ) -> Result<T, Error> {
        match self {
            Self::Cpu(run) => change(&mut run.state, &run.model, run.key),
            #[cfg(feature = "gpu")]
            Self::Gpu(run) => {
                let (mut state, model, seed) = (run.state()?, run.model().clone(), run.seed());
                let changed = change(&mut state, &model, Key::new(seed))?;
                *self = Self::begin(
                    &model,
                    seed,
                    lazygrid::Backend::Gpu,
                    lazygrid::Algorithm::Auto,
                    Some(state),
                )?;
                Ok(changed)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use lazygrid::Algorithm;

    use super::*;
    use crate::{Shape, Species, Transmitter};

    fn simulation() -> Simulation {
        let species =
            |name: &str, radius| Species { name: name.into(), diffusion: 10.0, radius, ..Species::default() };
        let ball = Transmitter {
            name: "ball".into(),
            shape: Shape::Shell(0.0, 2.0),
            release: vec![(0, 50)],
            ..Transmitter::default()
        };
        let model = Model {
            time_step: 0.001,
            species: vec![species("a", 0.1), species("b", 0.2)],
            transmitters: vec![ball],
            logs_arrivals: true,
            ..Model::default()
        };
        Simulation::new(model, 7, Algorithm::Auto).expect("a valid model")
    }

    #[test]
    fn added_particles_take_the_next_ids_and_move_with_the_others() {
        let mut run = simulation();
        let ids = run.add(1, &[[1.0, 2.0, 3.0], [-1.0, 0.0, 0.0]]).expect("a known species");
        assert_eq!(ids, 50..52);
        assert_eq!(
            (run.state.totals.present.clone(), run.state.totals.released.clone()),
            (vec![50, 2], vec![50, 2])
        );
        let particles = &run.state.particles;
        assert_eq!(
            (particles.position_of(50), particles.radius[50], particles.id[51]),
            ([1.0, 2.0, 3.0], 0.2, 51)
        );
        assert_eq!(run.state.origins.origin_of(50), None);
        run.step().expect("a step");
        assert_ne!(run.state.particles.position_of(50), [1.0, 2.0, 3.0]);
        let refused = run.add(2, &[[0.0; 3]]).expect_err("an unknown species").to_string();
        assert_eq!(refused, "there is no species 2; the model has 2");
        assert!(run.add(0, &[[0.0, f32::NAN, 0.0]]).is_err());
        assert_eq!(run.state.particles.len(), 52);
    }

    #[test]
    fn inserted_particles_must_have_the_radius_of_their_species() {
        let mut run = simulation();
        let mut one = Particles::default();
        one.push(Particle { species: 1, radius: 0.2, id: 60, ..Particle::default() }, false);
        run.insert(&one).expect("the radius of b");
        assert_eq!((run.state.particles.len(), run.state.next_id), (51, 61));
        for (radius, species, error) in [
            (0.1, 1, "a particle of species b has the radius 0.1 µm; use 0.2 µm"),
            (0.1, 2, "a particle is of species 2 and the model has 2"),
        ] {
            (one.radius[0], one.species[0]) = (radius, species);
            let refused = run.insert(&one).expect_err("a fault").to_string();
            assert!(refused.contains(error), "{refused}");
        }
        assert_eq!(run.state.particles.len(), 51);
    }

    #[test]
    fn removed_particles_leave_totals_and_columns() {
        let mut run = simulation();
        run.add(1, &[[0.0; 3]]).expect("a known species");
        assert_eq!(run.remove(&[50, 3, 3, 1000]), 2);
        assert_eq!(run.state.totals.present, [49, 0]);
        assert!(!run.state.particles.id.contains(&3) && !run.state.particles.id.contains(&50));
        run.step().expect("a step");
        assert_eq!(run.add(0, &[[0.0; 3]]).expect("a known species"), 51..52, "ids are never used twice");
    }

    #[test]
    fn emitted_particles_have_the_shape_and_origin_of_their_transmitter() {
        let mut run = simulation();
        (0..3).for_each(|_| run.step().expect("a step"));
        let ids = run.emit(0, 1, 1000).expect("a known transmitter");
        assert_eq!(ids, 50..1050);
        let origin = Some(Origin { transmitter: 0, step: 3 });
        assert_eq!([50, 1049].map(|id| run.state.origins.origin_of(id)), [origin; 2]);
        let radius =
            |at: usize| run.state.particles.position_of(at).map(|x| x * x).iter().sum::<f32>().sqrt();
        let radii: Vec<f32> = (50..1050).map(radius).collect();
        assert!(radii.iter().all(|&radius| radius <= 2.0));
        let inner = radii.iter().filter(|&&radius| radius < 2.0 * 0.5_f32.cbrt()).count();
        assert!(inner.abs_diff(500) < 64, "{inner}");
        assert!(run.emit(1, 0, 1).is_err() && run.emit(0, 2, 1).is_err());
    }

    #[test]
    fn edited_runs_depend_on_seed_and_edits_only() {
        let run = || {
            let mut run = simulation();
            run.step().expect("a step");
            run.emit(0, 0, 20).expect("a known transmitter");
            run.remove(&[0, 1]);
            run.step().expect("a step");
            run.state.clone()
        };
        assert_eq!(run(), run());
    }

    #[test]
    fn detached_particles_do_not_change() {
        let mut run = simulation();
        let detached = run.detach_particles().expect("memory");
        assert_eq!(detached, run.state.particles);
        run.step().expect("a step");
        assert_eq!(detached.len(), 50);
        assert_ne!(detached, run.state.particles);
    }
}
