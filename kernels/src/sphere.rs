use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use crate::{Exclusions, InputError};

/// The most spheres one call can name: indices are `u32` and the last two values are reserved.
pub const MAX_SPHERES: u64 = u32::MAX as u64 - 1;

/// A sphere: centre and radius in the caller's length unit, 16 bytes, laid out as `[f32; 4]` = `x, y, z, r`.
///
/// Any finite centre is allowed, anywhere in space. Radius 0 is a point; a negative, infinite or NaN radius
/// and a centre that is not finite are refused by the detectors.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Sphere {
    /// Centre.
    pub center: Vec3,
    /// Radius, ≥ 0.
    pub radius: f32,
}

impl Sphere {
    /// A sphere from anything that converts to a vector, such as `[x, y, z]`.
    pub fn new(center: impl Into<Vec3>, radius: f32) -> Self {
        Self { center: center.into(), radius }
    }

    /// Whether the detectors accept this sphere: all values finite and the radius not negative.
    #[inline]
    pub fn is_valid(&self) -> bool {
        self.center.is_finite() && self.radius.is_finite() && self.radius >= 0.0
    }
}

impl From<[f32; 4]> for Sphere {
    fn from([x, y, z, r]: [f32; 4]) -> Self {
        Self::new([x, y, z], r)
    }
}

/// A borrowed set of spheres: rows (`&[Sphere]`, `&[[f32; 4]]`) or columns (four `&[f32]`), never copied here,
/// and optionally a species id and a group per sphere, and pairs that are to be left out.
///
/// ```
/// # use lazygrid_kernels::{Sphere, Spheres};
/// let rows = vec![[0.0, 0.0, 0.0, 1.0_f32], [1.5, 0.0, 0.0, 1.0]];
/// let spheres = Spheres::from(&rows);
/// assert_eq!(spheres.get(1), Sphere::new([1.5, 0.0, 0.0], 1.0));
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Spheres<'a> {
    layout: Layout<'a>,
    species: Option<&'a [u32]>,
    groups: Option<&'a [u32]>,
    exclusions: Option<&'a Exclusions>,
}

#[derive(Clone, Copy, Debug)]
enum Layout<'a> {
    Rows(&'a [Sphere]),
    Columns([&'a [f32]; 4]),
}

impl<'a> Spheres<'a> {
    /// The group of spheres that are in none: see [`with_groups`](Self::with_groups).
    pub const NO_GROUP: u32 = u32::MAX;

    fn of(layout: Layout<'a>) -> Self {
        Self { layout, species: None, groups: None, exclusions: None }
    }

    /// Spheres stored as structure of arrays: `x`, `y`, `z` and `r`, all of one length.
    ///
    /// # Errors
    /// [`InputError::Lengths`] where the lengths differ.
    pub fn columns(x: &'a [f32], y: &'a [f32], z: &'a [f32], r: &'a [f32]) -> Result<Self, InputError> {
        for (what, column) in [("y", y), ("z", z), ("r", r)] {
            if column.len() != x.len() {
                return Err(InputError::Lengths { what, length: column.len(), expected: x.len() });
            }
        }
        Ok(Self::of(Layout::Columns([x, y, z, r])))
    }

    /// Adds a species id per sphere, for [`Interactions`](crate::Interactions).
    ///
    /// # Errors
    /// [`InputError::Lengths`] where there is not one id per sphere.
    pub fn with_species(mut self, species: &'a [u32]) -> Result<Self, InputError> {
        if species.len() != self.len() {
            let (length, expected) = (species.len(), self.len());
            return Err(InputError::Lengths { what: "species", length, expected });
        }
        self.species = Some(species);
        Ok(self)
    }

    /// Adds a group per sphere: a molecule, a rigid body. Two spheres of one group are never a pair, but for those of
    /// [`NO_GROUP`](Self::NO_GROUP). In a search between two sets groups of both are the same where their numbers are.
    ///
    /// # Errors
    /// [`InputError::Lengths`] where there is not one group per sphere.
    pub fn with_groups(mut self, groups: &'a [u32]) -> Result<Self, InputError> {
        if groups.len() != self.len() {
            let (length, expected) = (groups.len(), self.len());
            return Err(InputError::Lengths { what: "groups", length, expected });
        }
        self.groups = Some(groups);
        Ok(self)
    }

    /// Adds pairs that are to be left out, such as bonds. In a search between two sets they come with the first one and are
    /// made by [`Exclusions::between`].
    ///
    /// # Errors
    /// [`InputError::ExclusionsOfOthers`] where they were made for another number of spheres.
    pub fn with_exclusions(mut self, exclusions: &'a Exclusions) -> Result<Self, InputError> {
        let (made_for, given) = (exclusions.spheres(), self.len());
        if made_for.0 != given {
            return Err(InputError::ExclusionsOfOthers { made_for, given: (given, made_for.1) });
        }
        self.exclusions = Some(exclusions);
        Ok(self)
    }

    /// How many spheres there are.
    #[inline]
    pub fn len(&self) -> usize {
        match self.layout {
            Layout::Rows(rows) => rows.len(),
            Layout::Columns([x, ..]) => x.len(),
        }
    }

    /// Whether there is no sphere.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Sphere `i`.
    ///
    /// # Panics
    /// Where `i` is not below [`len`](Self::len), as indexing a slice does.
    #[inline]
    pub fn get(&self, i: usize) -> Sphere {
        match self.layout {
            Layout::Rows(rows) => rows[i],
            Layout::Columns([x, y, z, r]) => Sphere::new([x[i], y[i], z[i]], r[i]),
        }
    }

    /// The spheres as one slice where they are stored as rows.
    #[inline]
    pub fn as_rows(&self) -> Option<&'a [Sphere]> {
        match self.layout {
            Layout::Rows(rows) => Some(rows),
            Layout::Columns(_) => None,
        }
    }

    /// The species ids, if any were given.
    #[inline]
    pub fn species(&self) -> Option<&'a [u32]> {
        self.species
    }

    /// The groups, if any were given.
    #[inline]
    pub fn groups(&self) -> Option<&'a [u32]> {
        self.groups
    }

    /// The pairs that are to be left out, if any were given.
    #[inline]
    pub fn exclusions(&self) -> Option<&'a Exclusions> {
        self.exclusions
    }

    /// The same without groups and without pairs to be left out.
    pub fn without_exclusions(self) -> Self {
        Self { groups: None, exclusions: None, ..self }
    }

    /// All spheres in order.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = Sphere> + '_ {
        (0..self.len()).map(|i| self.get(i))
    }
}

impl<'a> From<&'a [Sphere]> for Spheres<'a> {
    fn from(rows: &'a [Sphere]) -> Self {
        Self::of(Layout::Rows(rows))
    }
}

impl<'a> From<&'a Vec<Sphere>> for Spheres<'a> {
    fn from(rows: &'a Vec<Sphere>) -> Self {
        Self::from(rows.as_slice())
    }
}

impl<'a, const N: usize> From<&'a [Sphere; N]> for Spheres<'a> {
    fn from(rows: &'a [Sphere; N]) -> Self {
        Self::from(rows.as_slice())
    }
}

impl<'a> From<&'a [[f32; 4]]> for Spheres<'a> {
    fn from(rows: &'a [[f32; 4]]) -> Self {
        Self::from(bytemuck::cast_slice::<[f32; 4], Sphere>(rows))
    }
}

impl<'a> From<&'a Vec<[f32; 4]>> for Spheres<'a> {
    fn from(rows: &'a Vec<[f32; 4]>) -> Self {
        Self::from(rows.as_slice())
    }
}
