use lazygrid::{
    Error, Interactions, Orthogonalization, Space, SpeciesRadius, Sphere, Spheres, TriclinicCell,
};

use crate::memory::try_collect;
use crate::species_groups::SpeciesGroups;
use crate::{Coordinate, Particle, SizeClass};

/// Growth of `f64` radii, as a fraction of the coordinates and lengths along periodic axes.
const ROUNDING: f64 = 1.0 / (1_u64 << 49) as f64;

/// A sphere wrapped into the box, with its effective radius.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WrappedSphere<T = f32> {
    /// Within half a length of the origin along periodic axes; orthogonalized in triclinic spaces.
    pub center: [T; 3],
    /// Effective radius: spheres that may pair are at most the sum of both apart.
    pub radius: T,
    pub group: u32,
}

impl<T: Coordinate> WrappedSphere<T> {
    #[inline]
    pub fn class(&self) -> SizeClass {
        SizeClass::from_radius(self.radius.into() as f32)
    }
}

#[derive(Clone, Debug, Default)]
pub struct SphereWrapper {
    space: Space,
    orthogonal: Option<Orthogonalization>,
    wrapped_space: Space,
    /// `None` if all touching spheres pair.
    species: Option<SpeciesTable>,
    needs_f64: bool,
}

#[derive(Clone, Debug)]
struct SpeciesTable {
    species_radii: Vec<SpeciesRadius>,
    groups: SpeciesGroups,
}

impl SphereWrapper {
    pub fn new(space: Space, interactions: Option<&Interactions>) -> Self {
        // Radii grow by the rounding of orthogonalized positions, but cutoffs would not.
        let has_cutoffs = space.triclinic_cell().is_none();
        let species = interactions.map(|table| SpeciesTable {
            species_radii: (0..table.species()).map(|species| table.species_radius(species)).collect(),
            groups: SpeciesGroups::new(table, has_cutoffs),
        });
        let scale = |cell| if space.fits_f32() { Orthogonalization::SCALE } else { scale_of(cell) };
        let orthogonal = space.triclinic_cell().map(|cell| cell.orthogonal_space(scale(cell)));
        let wrapped_space = orthogonal.map_or(space, |orthogonal| orthogonal.space());
        let needs_f64 = !space.fits_f32() || interactions.is_some_and(|table| !table.fits_f32());
        Self { space, orthogonal, wrapped_space, species, needs_f64 }
    }

    /// Returns `true` if `f32` does not represent the space or a distance, so `f32` spheres need
    /// [`wrap_f64`](Self::wrap_f64).
    #[inline]
    pub fn needs_f64(&self) -> bool {
        self.needs_f64
    }

    #[inline]
    pub(crate) fn wrapped_space(&self) -> &Space {
        &self.wrapped_space
    }

    #[inline]
    pub(crate) fn cutoff(&self, one: u32, other: u32) -> Option<f64> {
        match &self.species {
            Some(species) => species.groups.cutoff(one, other),
            None => Some(f64::INFINITY),
        }
    }

    #[inline]
    fn radius_and_group<T>(
        &self,
        species: u32,
        radius: T,
        effective: impl FnOnce(&SpeciesRadius) -> T,
    ) -> (T, u32) {
        let Some(table) = &self.species else { return (radius, 0) };
        let of_species = table.species_radii.get(species as usize);
        (of_species.map_or(radius, effective), table.groups.group_of(species))
    }

    /// An unknown species has the sphere's radius and may pair with all.
    #[inline]
    pub fn wrap(&self, sphere: Sphere, species: u32) -> WrappedSphere {
        let effective = |of_species: &SpeciesRadius| of_species.effective.for_radius(sphere.radius);
        let (radius, group) = self.radius_and_group(species, sphere.radius, effective);
        match &self.orthogonal {
            None => WrappedSphere { center: self.space.wrap(sphere.center).to_array(), radius, group },
            Some(orthogonal) => {
                let center = sphere.center.to_array().map(f64::from);
                let Sphere { center, radius } = orthogonal.sphere(center, radius.into(), f64::from(f32::MAX));
                WrappedSphere { center: center.to_array(), radius, group }
            }
        }
    }

    /// Wraps a valid sphere `x, y, z, r` like [`wrap`](Self::wrap).
    ///
    /// # Correctness
    ///
    /// 1. Wrapping along an axis of length `L` rounds nothing, so wrapped centers are exact images.
    /// 2. The contact test computes `(cj − ci) + S·L`, whose roundings add up to `2⁻⁵³·(4|ci| + 4|cj| + 2L)`
    ///    at most along an axis, and √3 times that in space. The boxes' distance across the boundary
    ///    rounds by less than `2⁻⁵¹·L`. Each radius grows by `2⁻⁴⁹·(|c| + L)`.
    /// 3. If this test takes another image than the nearest, the nearest is closer.
    /// 4. Orthogonalized radii grow in the same way ([`Orthogonalization`]).
    #[inline]
    pub fn wrap_f64(&self, [x, y, z, radius]: [f64; 4], species: u32) -> WrappedSphere<f64> {
        let (radius, group) =
            self.radius_and_group(species, radius, |of_species| of_species.for_radius(radius));
        let mut center = [x, y, z];
        if let Some(orthogonal) = &self.orthogonal {
            let Sphere { center, radius } = orthogonal.sphere(center, radius, f64::from(f32::MAX));
            // Larger radii are cut.
            let radius = if radius < f32::MAX { f64::from(radius) } else { f64::INFINITY };
            return WrappedSphere { center: center.to_array().map(f64::from), radius, group };
        }
        let mut rounded = 0.0_f64;
        for (x, length) in center.iter_mut().zip(self.space.lengths()) {
            if let Some(length) = length {
                rounded = rounded.max(x.abs() + length);
                *x = wrap(*x, length);
            }
        }
        WrappedSphere { center, radius: radius + ROUNDING * rounded, group }
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

    /// Wraps spheres of either type as `f64` numbers.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    pub fn wrap_all_f64(&self, spheres: Spheres<'_>) -> Result<Vec<WrappedSphere<f64>>, Error> {
        let species = |k: usize| spheres.species().map_or(0, |species| species[k]);
        let wrapped = (0..spheres.len()).map(|k| self.wrap_f64(spheres.get_f64(k), species(k)));
        try_collect(spheres.len(), wrapped, "spheres wrapped into the box")
    }
}

/// Returns the image of `x` nearest to the origin, without rounding.
#[inline]
fn wrap(x: f64, length: f64) -> f64 {
    let rest = x % length;
    // The operands are within a factor of two.
    if rest.abs() > 0.5 * length { rest - length.copysign(rest) } else { rest }
}

/// Returns a power of two that scales the longest cell vector to about 1.
fn scale_of(cell: &TriclinicCell) -> f64 {
    const EXPONENTS: u64 = 2046;
    let exponent = (cell.longest().to_bits() >> 52).clamp(1, EXPONENTS - 1);
    f64::from_bits((EXPONENTS - exponent) << 52)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrapping_in_f64_rounds_nothing() {
        for (x, length, expected) in [
            (0.3, 1.0, 0.3),
            (-7.5, 10.0, 2.5),
            (1e300, 0.1, 1e300 % 0.1),
            (10.1 * 3.0, 10.1, 10.1 * 3.0 % 10.1),
            (1.7e308, 1.2e308, 1.7e308 % 1.2e308),
            (-3e-324, 5e-324, 0.0),
        ] {
            let wrapped = wrap(x, length);
            let is_image = wrapped == expected || (wrapped - expected).abs() == length;
            assert!(is_image && wrapped.abs() <= 0.5 * length, "{x:e} in {length:e}: {wrapped:e}");
        }
    }

    #[test]
    fn cells_beyond_f32_have_orthogonalized_lengths_near_1() {
        for size in [1e-300, 1e-60, 1e60, 1e300] {
            let vectors = [[1.0, 0.0, 0.0], [0.4, 1.0, 0.0], [0.0, 0.0, 1.0]];
            let space = Space::triclinic(vectors.map(|vector| Some(vector.map(|x| x * size)))).unwrap();
            let wrapper = SphereWrapper::new(space, None);
            assert!(wrapper.needs_f64(), "{size:e}");
            let lengths = wrapper.wrapped_space().lengths().into_iter().flatten();
            assert!(lengths.clone().count() == 3 && lengths.into_iter().all(|l| (0.5..4.0).contains(&l)));
        }
    }
}
