use bytemuck::{Pod, Zeroable};
use lazygrid::Sphere;
use lazygrid_ranks::{SphereWrapper, WrappedSphere};
use rayon::prelude::*;

use crate::model::particles::{Particle, Particles};

const CHUNK: usize = 4096;

#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct ParticleRow {
    position: [f32; 3],
    velocity: [f32; 3],
    radius: f32,
    species: u32,
    id: u32,
}

pub(super) fn row(particles: &Particles, at: u32) -> ParticleRow {
    let Particle { position, velocity, radius, species, id } = particles.get(at as usize);
    ParticleRow { position, velocity, radius, species, id }
}

pub(super) fn particles(rows: &[ParticleRow], with_velocity: bool) -> Particles {
    let mut particles = Particles::default();
    for &ParticleRow { position, velocity, radius, species, id } in rows {
        particles.push(Particle { position, velocity, radius, species, id }, with_velocity);
    }
    particles
}

pub(super) fn ghost(particles: &Particles, at: u32) -> lazygrid_ranks::Particle {
    let Particle { position, radius, species, id, .. } = particles.get(at as usize);
    lazygrid_ranks::Particle { sphere: Sphere::new(position, radius), id: id.into(), species, index: at }
}

pub(super) fn from_ghost(ghost: &lazygrid_ranks::Particle) -> Particle {
    Particle {
        position: ghost.sphere.center.to_array(),
        velocity: [0.0; 3],
        radius: ghost.sphere.radius,
        species: ghost.species,
        id: ghost.id as u32,
    }
}

pub(super) fn wrapped(wrapper: &SphereWrapper, particles: &Particles) -> Vec<WrappedSphere> {
    let wrapped = |at: usize| {
        let sphere = Sphere::new(particles.position_of(at), particles.radius[at]);
        wrapper.wrap(sphere, particles.species[at])
    };
    (0..particles.len()).into_par_iter().with_min_len(CHUNK).map(wrapped).collect()
}
