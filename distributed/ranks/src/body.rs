use glam::Vec3;
use lazygrid::{EffectiveRadius, Interactions, Orthogonalization, Space, Sphere};

use crate::{Class, Particle};

/// A sphere wrapped into the box, with its effective radius.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    /// Centre; along periodic axes within half a length of the origin. In a sheared space in straight coordinates, in which
    /// it is an orthogonal one.
    pub center: Vec3,
    /// Effective radius: any two spheres that may pair are at most the sum of theirs apart.
    pub radius: f32,
}

impl Body {
    /// The binade of its effective radius.
    #[inline]
    pub fn class(&self) -> Class {
        Class::of(self.radius)
    }
}

/// Turns spheres into bodies: knows the space, and the interactions if there are any.
#[derive(Clone, Debug, Default)]
pub struct Bodies {
    space: Space,
    /// The coordinates of a triclinic space.
    straight: Option<Orthogonalization>,
    /// Indexed by species; `None` where all that touch pair.
    reach: Option<Vec<EffectiveRadius>>,
}

impl Bodies {
    /// In this space, with these interactions.
    pub fn new(space: Space, interactions: Option<&Interactions>) -> Self {
        let reach =
            interactions.map(|table| (0..table.species()).map(|s| table.effective_radius(s)).collect());
        let straight = space.triclinic_cell().map(|shear| shear.orthogonal_space(Orthogonalization::SCALE));
        Self { space, straight, reach }
    }

    /// The space of the bodies: of a sheared one that of straight coordinates.
    pub fn space(&self) -> Space {
        self.straight.map_or(self.space, |straight| straight.space())
    }

    /// The body of a sphere. A species that is not in the table reaches as far as its radius.
    #[inline]
    pub fn body(&self, sphere: Sphere, species: u32) -> Body {
        let reach = self.reach.as_ref().and_then(|reach| reach.get(species as usize));
        let radius = reach.map_or(sphere.radius, |reach| reach.for_radius(sphere.radius));
        match &self.straight {
            None => Body { center: self.space.wrap(sphere.center), radius },
            Some(straight) => {
                let center = sphere.center.to_array().map(f64::from);
                let Sphere { center, radius } = straight.sphere(center, radius.into(), f64::from(f32::MAX));
                Body { center, radius }
            }
        }
    }

    /// The bodies of particles, in their order.
    pub fn of(&self, particles: &[Particle]) -> Vec<Body> {
        particles.iter().map(|particle| self.body(particle.sphere, particle.species)).collect()
    }
}
