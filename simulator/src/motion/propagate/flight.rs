//! The path of a particle, up to membranes and receivers.

use rayon::prelude::*;

use super::Propagator;
use crate::model::particles::{Particle, Particles};
use crate::motion::collisions::Flight;
use crate::motion::step_normals::{BLOCK, draw};
use crate::random::philox::{DrawContext, Purpose, StepKey};

#[derive(Clone, Copy, Debug)]
pub(super) struct FlightStart {
    pub(super) species: u32,
    pub(super) position: [f32; 3],
    pub(super) velocity: [f32; 3],
}

impl Propagator {
    pub(crate) fn flights(&self, particles: &Particles, now: StepKey) -> Vec<Flight> {
        let of_block = |(block, ids): (usize, &[u32])| {
            let mut random = [[0.0; BLOCK]; 3];
            draw(now, ids, &mut random);
            let one = |(k, &id): (usize, &u32)| {
                let normal = [0, 1, 2].map(|axis: usize| random[axis][k]);
                let Particle { species, position, velocity, .. } = particles.get(block * BLOCK + k);
                self.flight(FlightStart { species, position, velocity }, normal, now.for_particle(id))
            };
            ids.iter().enumerate().map(one).collect::<Vec<_>>()
        };
        particles.id.par_chunks(BLOCK).enumerate().flat_map_iter(of_block).collect()
    }

    #[inline(always)]
    pub(super) fn flight(&self, start: FlightStart, normal: [f32; 3], context: DrawContext) -> Flight {
        let FlightStart { species, position: before, velocity: mut tumbled_velocity } = start;
        let kind = &self.steps[species as usize];
        if let Some(tumbles) = &self.tumbles[species as usize] {
            let words = context.draw(0, Purpose::Tumble);
            tumbles.apply(before, &mut tumbled_velocity, words, &kind.domain);
        }
        let mut velocity = tumbled_velocity;
        let tracked_velocity = self.with_velocity.then_some(&mut velocity);
        let (path, free_end) = self.paths.path(kind, [before, normal], tracked_velocity, context);
        Flight { path, free_end, tumbled_velocity, velocity }
    }
}
