use super::GpuSimulation;
use crate::gpu::device::{read, with_error_scope};
use crate::gpu::layout::{BOUND_RADIUS, ControlHeader, SPARED};
use crate::gpu::ligand_rows::LigandRow;
use crate::model::particles::{Particle, Particles, non_finite};
use crate::motion::binding::Bound;
use crate::{Error, State};

impl GpuSimulation {
    /// # Errors
    /// [`Error::Detection`] if the device fails, [`Error::UnknownState`] after such a failure in [`run`](Self::run), and
    /// [`Error::NotFinite`] if positions exceed the range of `f32`.
    pub fn state(&self) -> Result<State, Error> {
        self.check_state()?;
        let n = u64::from(self.alive);
        let sizes = self.steps.sizes;
        let half = 16 * u64::from(sizes.particles);
        let spheres = if sizes.has_velocity { half + 16 * n } else { 16 * n };
        let sources = [(self.steps.buffer("spheres"), spheres), (self.steps.buffer("tags"), 8 * n)];
        let read = read(&self.buffers.gpu, self.encoder(), &sources)?;
        let spheres: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&read[0][..16 * n as usize]);
        let velocities: Vec<[f32; 4]> = match sizes.has_velocity {
            true => bytemuck::pod_collect_to_vec(&read[0][half as usize..]),
            false => vec![[0.0; 4]; spheres.len()],
        };
        let tags: Vec<[u32; 2]> = bytemuck::pod_collect_to_vec(&read[1]);
        // The device's order depends on threads.
        let mut rows: Vec<_> = spheres.into_iter().zip(velocities).zip(tags).collect();
        rows.sort_unstable_by_key(|&(_, [_, id])| id);
        let (mut particles, mut bound) = (Particles::default(), Vec::new());
        for (([x, y, z, radius], [u, v, w, _]), [tag, id]) in rows {
            // A halted step leaves the mark of `tag.wgsl`.
            let species = tag & !SPARED;
            if radius >= 0.0 {
                let (position, velocity) = ([x, y, z], [u, v, w]);
                particles.push(Particle { position, velocity, radius, species, id }, sizes.has_velocity);
                continue;
            }
            let row = (BOUND_RADIUS - radius) as u32;
            let Ok(at) = self.ligands.binary_search_by_key(&row, |ligand| ligand.row) else {
                return Err(Error::Model(
                    "a particle on the device is bound to a receiver without receptors".to_owned(),
                ));
            };
            let LigandRow { receiver, receptor, .. } = self.ligands[at];
            bound.push(Bound { id, species, receiver, receptor, direction: [x, y, z] });
        }
        (0..self.due.len()).for_each(|at| particles.push(self.due.get(at), sizes.has_velocity));
        // Only the detector on the device looks for such positions.
        let lost = non_finite(particles.position.each_ref().map(Vec::as_slice)) as u64;
        if lost > 0 {
            return Err(Error::NotFinite { step: self.step.saturating_sub(1), particles: lost });
        }
        Ok(State { particles, bound, ..self.without_particles() })
    }

    pub(crate) fn without_particles(&self) -> State {
        let Self { step, next_id, .. } = *self;
        let (totals, centers) = (self.totals.clone(), self.centers.clone());
        let origins = self.origins.clone();
        State { step, next_id, totals, centers, origins, ..State::default() }
    }

    pub(super) fn upload(&self, state: &State) -> Result<(), Error> {
        let sizes = self.steps.sizes;
        let head = ControlHeader {
            alive: self.alive,
            done: self.step,
            step: self.step,
            capacity: sizes.particles,
            max_births: sizes.births,
            max_events: sizes.events,
            speed_factor: sizes.speed_factor().to_bits(),
            committed_contacts: self.totals.contacts.try_into().unwrap_or(u32::MAX),
            next_id: self.next_id,
            ..ControlHeader::default()
        };
        let (mut spheres, mut tags) = columns(&state.particles);
        let velocities = velocities(&state.particles);
        for &Bound { id, species, receptor, direction: [x, y, z], .. } in &state.bound {
            let found = self
                .ligands
                .binary_search_by_key(&(species, receptor), |ligand| (ligand.species, ligand.receptor));
            let Ok(at) = found else {
                return Err(Error::Model(
                    "a particle of the state is bound to a receiver without receptors".to_owned(),
                ));
            };
            spheres.push([x, y, z, BOUND_RADIUS - self.ligands[at].row as f32]);
            tags.push([species, id]);
        }
        let queue = &self.buffers.gpu.queue;
        with_error_scope(&self.buffers.gpu, "the particles", 0, || {
            queue.write_buffer(self.buffers.buffer("control"), 0, bytemuck::bytes_of(&head));
            queue.write_buffer(self.steps.buffer("spheres"), 0, bytemuck::cast_slice(&spheres));
            if sizes.has_velocity {
                let half = 16 * u64::from(sizes.particles);
                queue.write_buffer(self.steps.buffer("spheres"), half, bytemuck::cast_slice(&velocities));
            }
            queue.write_buffer(self.steps.buffer("tags"), 0, bytemuck::cast_slice(&tags));
        })
    }
}

pub(super) fn columns(particles: &Particles) -> (Vec<[f32; 4]>, Vec<[u32; 2]>) {
    let sphere = |at: usize| {
        let Particle { position: [x, y, z], radius, .. } = particles.get(at);
        [x, y, z, radius]
    };
    let n = particles.len();
    ((0..n).map(sphere).collect(), (0..n).map(|at| [particles.species[at], particles.id[at]]).collect())
}

pub(super) fn velocities(particles: &Particles) -> Vec<[f32; 4]> {
    let velocity = |at: usize| {
        let [u, v, w] = particles.get(at).velocity;
        [u, v, w, 0.0]
    };
    (0..particles.len()).map(velocity).collect()
}
