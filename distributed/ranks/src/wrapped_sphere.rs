use glam::Vec3;
use lazygrid::{EffectiveRadius, Error, Interactions, Orthogonalization, Space, Sphere};

use crate::memory::try_collect;
use crate::species_groups::SpeciesGroups;
use crate::{Particle, SizeClass};

/// A sphere wrapped into the box, with its effective radius.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WrappedSphere {
    /// Center, within half a length of the origin along periodic axes; orthogonalized in triclinic spaces.
    pub center: Vec3,
    /// Effective radius: spheres that may pair are at most the sum of both radii apart.
    pub radius: f32,
    /// Species group.
    pub group: u32,
}

impl WrappedSphere {
    #[inline]
    pub fn class(&self) -> SizeClass {
        SizeClass::of(self.radius)
    }
}

#[derive(Clone, Debug, Default)]
pub struct SphereWrapper {
    space: Space,
    orthogonal: Option<Orthogonalization>,
    /// The space of wrapped spheres, orthogonalized if triclinic.
    wrapped_space: Space,
    /// `None` if all touching spheres pair.
    species: Option<SpeciesTable>,
}

/// For the exchange of ghosts.
#[derive(Clone, Debug)]
struct SpeciesTable {
    effective_radius: Vec<EffectiveRadius>,
    groups: SpeciesGroups,
}

impl SphereWrapper {
    pub fn new(space: Space, interactions: Option<&Interactions>) -> Self {
        // Orthogonalized radii grow by the rounding of positions, which boxes do not hold and a cutoff would need.
        let has_cutoffs = space.triclinic_cell().is_none();
        let species = interactions.map(|table| SpeciesTable {
            effective_radius: (0..table.species()).map(|species| table.effective_radius(species)).collect(),
            groups: SpeciesGroups::new(table, has_cutoffs),
        });
        let orthogonal = space.triclinic_cell().map(|cell| cell.orthogonal_space(Orthogonalization::SCALE));
        let wrapped_space = orthogonal.map_or(space, |orthogonal| orthogonal.space());
        Self { space, orthogonal, wrapped_space, species }
    }

    /// Returns the space of wrapped spheres.
    #[inline]
    pub(crate) fn wrapped_space(&self) -> &Space {
        &self.wrapped_space
    }

    /// Returns the largest center distance at which spheres of two groups pair, infinite if only radii limit it; `None`
    /// if they never pair.
    #[inline]
    pub(crate) fn cutoff(&self, one: u32, other: u32) -> Option<f64> {
        match &self.species {
            Some(species) => species.groups.cutoff(one, other),
            None => Some(f64::INFINITY),
        }
    }

    /// An unknown species has the sphere's radius and may pair with all.
    #[inline]
    pub fn wrap(&self, sphere: Sphere, species: u32) -> WrappedSphere {
        let (radius, group) = match &self.species {
            None => (sphere.radius, 0),
            Some(table) => {
                let rule = table.effective_radius.get(species as usize);
                let radius = rule.map_or(sphere.radius, |rule| rule.for_radius(sphere.radius));
                (radius, table.groups.of(species))
            }
        };
        match &self.orthogonal {
            None => WrappedSphere { center: self.space.wrap(sphere.center), radius, group },
            Some(orthogonal) => {
                let center = sphere.center.to_array().map(f64::from);
                let Sphere { center, radius } = orthogonal.sphere(center, radius.into(), f64::from(f32::MAX));
                WrappedSphere { center, radius, group }
            }
        }
    }

    /// # Errors
    /// [`Error::OutOfMemory`].
    pub fn wrap_all(
        &self,
        particles: impl ExactSizeIterator<Item = Particle>,
    ) -> Result<Vec<WrappedSphere>, Error> {
        let wrapped = |particle: Particle| self.wrap(particle.sphere, particle.species);
        try_collect(particles.len(), particles.map(wrapped), "spheres wrapped into the box")
    }
}
