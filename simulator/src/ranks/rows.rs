//! Particles as they travel, and as the functions of [`lazygrid_ranks`] take them.

use bytemuck::{Pod, Zeroable};
use lazygrid::Sphere;
use lazygrid_ranks::{SphereWrapper, WrappedSphere};
use rayon::prelude::*;

use crate::model::particles::{Particle, Particles};

/// Particles that one task looks at.
const TASK: usize = 4096;

/// A particle with all that belongs to it, 36 bytes.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Row {
    position: [f32; 3],
    velocity: [f32; 3],
    radius: f32,
    species: u32,
    id: u32,
}

/// The particle at a place as it changes rank.
pub(super) fn row(particles: &Particles, at: u32) -> Row {
    let Particle { position, velocity, radius, species, id } = particles.get(at as usize);
    Row { position, velocity, radius, species, id }
}

/// Particles that came.
pub(super) fn particles(rows: &[Row], with_velocity: bool) -> Particles {
    let mut particles = Particles::default();
    for &Row { position, velocity, radius, species, id } in rows {
        particles.push(Particle { position, velocity, radius, species, id }, with_velocity);
    }
    particles
}

/// The particle at a place as a ghost.
pub(super) fn ghost(particles: &Particles, at: u32) -> lazygrid_ranks::Particle {
    let Particle { position, radius, species, id, .. } = particles.get(at as usize);
    lazygrid_ranks::Particle { sphere: Sphere::new(position, radius), id: id.into(), species, index: at }
}

/// A ghost among the particles of a rank. Nobody asks for its velocity.
pub(super) fn of_ghost(ghost: &lazygrid_ranks::Particle) -> Particle {
    Particle {
        position: ghost.sphere.center.to_array(),
        velocity: [0.0; 3],
        radius: ghost.sphere.radius,
        species: ghost.species,
        // It came of one of 32 bits.
        id: ghost.id as u32,
    }
}

/// All particles wrapped into the box.
pub(super) fn wrapped(wrapper: &SphereWrapper, particles: &Particles) -> Vec<WrappedSphere> {
    let wrapped = |at: usize| {
        let sphere = Sphere::new(particles.position_of(at), particles.radius[at]);
        wrapper.wrap(sphere, particles.species[at])
    };
    (0..particles.len()).into_par_iter().with_min_len(TASK).map(wrapped).collect()
}
