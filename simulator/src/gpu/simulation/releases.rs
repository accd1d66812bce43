use super::transfer::{columns, velocities};
use super::{Burst, GpuSimulation};
use crate::Error;
use crate::gpu::device::filled;
use crate::gpu::dispatches::{Groups, Stage};
use crate::gpu::kernel as k;
use crate::gpu::receiver_trajectory::has_moving_receivers;
use crate::model::particles::Particles;
use crate::motion::receiver_state::{ReceiverMove, move_receivers};
use crate::release::ReleaseStep;

impl GpuSimulation {
    /// Returns the releases of the next steps, or the first one if particles may dissociate.
    pub(super) fn bursts(&self, steps: u32) -> Result<Vec<Burst>, Error> {
        let mut next_id = self.next_id;
        let mut bursts = Vec::new();
        let moves = has_moving_receivers(&self.model);
        let mut receiver_moves = ReceiverMove::at_rest(&self.centers);
        for step in self.step + 1..=self.step + steps {
            if moves {
                let centers: Vec<_> =
                    receiver_moves.iter().map(|receiver_move| receiver_move.center).collect();
                receiver_moves = move_receivers(&self.model, &centers, self.key, step - 1);
            }
            let (events, key) = (&self.partial_events, self.key);
            let at = ReleaseStep { events, key, step, next_id, receiver_moves: &receiver_moves };
            let released = self.model.release(at, self.slice)?;
            if released.next_id > next_id {
                next_id = released.next_id;
                bursts.push(Burst { step, released });
                // Dissociations change the ids of later releases.
                if self.tables.dissociates() {
                    break;
                }
            }
        }
        Ok(bursts)
    }

    pub(super) fn append(&mut self, particles: &Particles) -> Result<Stage, Error> {
        let (mut spheres, tags) = columns(particles);
        let count = spheres.len() as u32;
        if self.model.has_velocity() {
            spheres.extend(velocities(particles));
        }
        let burst = filled(&self.buffers.gpu, "burst", &[count, 0, 0, 0])?;
        let spheres = filled(&self.buffers.gpu, "burst_spheres", &spheres)?;
        let tags = filled(&self.buffers.gpu, "burst_tags", &tags)?;
        let (steps, control) = (&self.steps, self.buffers.buffer("control").clone());
        self.buffers.stage(&k::BURST_APPEND, Groups::Items(count), |name| match name {
            "burst" => burst.clone(),
            "burst_spheres" => spheres.clone(),
            "burst_tags" => tags.clone(),
            "control" => control.clone(),
            other => steps.buffer(other).clone(),
        })
    }
}
