//! The path of a particle in a step, up to membranes and receivers.

use rayon::prelude::*;

use super::Propagator;
use crate::model::particles::Particles;
use crate::motion::collisions::Flight;
use crate::motion::path_hit::DrawContext;
use crate::motion::step_normals::{BLOCK, draw};
use crate::random::philox::{Key, Purpose};

impl Propagator {
    pub(crate) fn flights(&self, particles: &Particles, (key, step): (Key, u32)) -> Vec<Flight> {
        let of_block = |(block, ids): (usize, &[u32])| {
            let mut random = [[0.0; BLOCK]; 3];
            draw(key, ids, step, &mut random);
            let one = |(k, &id): (usize, &u32)| {
                let particle = particles.get(block * BLOCK + k);
                let normal = [0, 1, 2].map(|axis: usize| random[axis][k]);
                let who = DrawContext { key, id, step };
                self.flight(particle.species, (particle.position, particle.velocity), normal, who)
            };
            ids.iter().enumerate().map(one).collect::<Vec<_>>()
        };
        particles.id.par_chunks(BLOCK).enumerate().flat_map_iter(of_block).collect()
    }

    #[inline(always)]
    pub(super) fn flight(
        &self,
        species: u32,
        (before, mut begun): ([f32; 3], [f32; 3]),
        normal: [f32; 3],
        who: DrawContext,
    ) -> Flight {
        let kind = &self.steps[species as usize];
        let DrawContext { key, id, step } = who;
        if let Some(tumbles) = &self.tumbles[species as usize] {
            let words = key.draw(id, 0, step, Purpose::Tumble);
            tumbles.apply(before, &mut begun, words, &kind.domain);
        }
        let mut velocity = begun;
        let own = self.with_velocity.then_some(&mut velocity);
        let (path, free_end) = self.paths.path(kind, [before, normal], own, who);
        Flight { path, free_end, begun, velocity }
    }
}
