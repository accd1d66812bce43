//! What transmitters release, and when: a pure function of the model, the seed and the step.

use crate::model::Model;
use crate::particles::{Particle, Particles};
use crate::philox::{Key, Purpose};
use crate::transmitter::Transmitter;
use crate::{Error, normal};

impl Model {
    /// Adds what all transmitters release at the beginning of a step, with ids from `next_id` on. Returns the id that
    /// comes after.
    ///
    /// # Errors
    /// [`Error::OutOfIds`] where there are too few ids left; then nothing is added.
    pub fn release(
        &self,
        key: Key,
        step: u32,
        next_id: u32,
        particles: &mut Particles,
    ) -> Result<u32, Error> {
        let due = || self.transmitters.iter().filter(|t| t.fires(step, self.time_step));
        let released = due().map(Transmitter::burst).fold(u64::from(next_id), u64::saturating_add);
        if released > lazygrid::MAX_SPHERES {
            return Err(Error::OutOfIds { released });
        }
        let mut id = next_id;
        for transmitter in due() {
            let mut place = 0;
            for &(species, count) in &transmitter.release {
                for _ in 0..count {
                    let particle = self.released(transmitter, key, (id, species, place));
                    particles.push(particle, self.has_velocity());
                    id += 1;
                    place += 1;
                }
            }
        }
        Ok(id)
    }

    /// A particle as it appears, the `place`th of its burst.
    fn released(&self, from: &Transmitter, key: Key, (id, species, place): (u32, u32, u32)) -> Particle {
        let kind = &self.species[species as usize];
        let velocity =
            normal::normals(key.draw(id, 0, 0, Purpose::Velocity)).map(|z| z * kind.thermal_speed as f32);
        let offset = from.shape.offset(key.draw(id, 0, 0, Purpose::Release), place);
        let room = self.boundary.inset(kind.radius);
        let position = room.place(std::array::from_fn(|k| from.center[k] + offset[k]));
        Particle { position, velocity, radius: kind.radius, species, id }
    }
}
