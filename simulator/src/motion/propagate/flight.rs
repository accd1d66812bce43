//! The path of a particle in a step, up to membranes and receivers.

use rayon::prelude::*;

use super::{Propagator, SpeciesStep};
use crate::model::particles::Particles;
use crate::motion::collisions::Flight;
use crate::motion::path_hit::{DrawContext, Path};
use crate::motion::step_normals::{BLOCK, draw};
use crate::motion::vessel_flow::StepDrift;
use crate::motion::wall::reflected;
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
        let (path, free_end) = self.path(kind, [before, normal], own, who);
        Flight { path, free_end, begun, velocity }
    }

    /// Also returns the end without walls, which reverse the velocity.
    #[inline(always)]
    fn path(
        &self,
        kind: &SpeciesStep,
        [before, normal]: [[f32; 3]; 2],
        mut velocity: Option<&mut [f32; 3]>,
        who: DrawContext,
    ) -> (Path, [f32; 3]) {
        let SpeciesStep { length, lengths, diffusion, ref domain, .. } = *kind;
        let StepDrift { mut drift, at_wall } = kind.drift;
        if let Some(own) = &velocity {
            drift = std::array::from_fn(|axis| drift[axis] + own[axis] * self.time_step);
        }
        let free_end = |drift: [f32; 3]| -> [f32; 3] {
            std::array::from_fn(|axis| before[axis] + (lengths[axis] * normal[axis] + drift[axis]))
        };
        if let Some(field) = &self.field {
            let carried = field.carry(domain, [before, free_end(drift)]);
            drift = std::array::from_fn(|axis| drift[axis] + carried[axis]);
        }
        let end = free_end(drift);
        let words = || who.key.draw(who.id, 0, who.step, Purpose::Wall);
        if let Some(stream) = &self.stream {
            let reflect_at_end = |ends: [f32; 2]| match stream.vessel.along.filter(|&along| at_wall[along]) {
                Some(along) => reflected(domain.axes[along], ends, length, words()[along]).unwrap_or(ends[1]),
                None => ends[1],
            };
            let mut still = [0.0; 3];
            let own = velocity.unwrap_or(&mut still);
            let carried = stream.carry(domain, [before, end], own, reflect_at_end);
            // Arrays indexed by variables stay in memory, whose round trip delays all other particles.
            let carry = |from: [f32; 3]| {
                let along = |axis| {
                    if Some(axis) == stream.vessel.along { from[axis] + carried.by } else { from[axis] }
                };
                std::array::from_fn(along)
            };
            let (drift, free_end) = (carry(drift), carry(end));
            return (Path { before, end: carried.end, after: carried.after, drift, diffusion }, free_end);
        }
        if !self.bounded {
            return (Path { before, end, after: end, drift, diffusion }, end);
        }
        if let Some(own) = &mut velocity {
            (0..3).filter(|&axis| domain.axes[axis].turns(end[axis])).for_each(|axis| own[axis] = -own[axis]);
        }
        let free_end = end;
        let mut end = end;
        if at_wall != [false; 3] {
            let words = words();
            for axis in (0..3).filter(|&axis| at_wall[axis]) {
                let ends = [before[axis], end[axis]];
                end[axis] = reflected(domain.axes[axis], ends, length, words[axis]).unwrap_or(end[axis]);
            }
        }
        (Path { before, end, after: domain.confine(end), drift, diffusion }, free_end)
    }
}
