use thiserror::Error;

use crate::{MAX_SPHERES, Sphere};

/// What can be wrong with an input. Every message names the value, the limit and the remedy.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum InputError {
    /// Some spheres have a centre that is not finite, or a radius that is negative, infinite or NaN.
    #[error(
        "sphere {index} has centre ({x}, {y}, {z}) and radius {r}: {count} of {total} spheres are not finite \
         or have a negative radius; remove or mend them",
        x = .sphere.center.x, y = .sphere.center.y, z = .sphere.center.z, r = .sphere.radius
    )]
    Sphere {
        /// Index of the first such sphere.
        index: u32,
        /// Its value.
        sphere: Sphere,
        /// How many such spheres there are.
        count: u64,
        /// How many spheres there are in all.
        total: u64,
    },
    /// Columns or ids of different lengths.
    #[error("`{what}` has {length} values where {expected} are needed: one per sphere")]
    Lengths {
        /// Which column.
        what: &'static str,
        /// Its length.
        length: usize,
        /// The length of the others.
        expected: usize,
    },
    /// More spheres than indices.
    #[error("{count} spheres are more than the {MAX_SPHERES} that 32-bit indices can name; split the input")]
    TooManySpheres {
        /// How many were given.
        count: u64,
    },
    /// A species id outside the interaction table.
    #[error(
        "species id {id}{at} is not below the {count} species of the interaction table",
        at = .index.map(|i| format!(" of sphere {i}")).unwrap_or_default()
    )]
    SpeciesId {
        /// The first sphere that has it; `None` where it was an argument.
        index: Option<u32>,
        /// The id.
        id: u32,
        /// How many species the table has.
        count: u32,
    },
    /// Too large an interaction table.
    #[error("an interaction table for {count} species is above the limit of {limit}; merge species")]
    SpeciesCount {
        /// How many were asked for.
        count: u32,
        /// The most there may be.
        limit: u32,
    },
    /// An interaction table is set but the spheres carry no species ids.
    #[error(
        "interactions are set but the spheres have no species ids; add them with `Spheres::with_species`"
    )]
    SpeciesMissing,
    /// A length of a periodic axis that is no length.
    #[error(
        "the length {length} of the periodic axis {axis} must be finite and above 0; leave an unbounded axis out"
    )]
    Period {
        /// Which axis: `x`, `y` or `z`.
        axis: char,
        /// The length given.
        length: f32,
    },
    /// An interaction distance that is negative or not finite.
    #[error("the interaction distance {distance} of species {a} and {b} must be finite and not negative")]
    Distance {
        /// One species.
        a: u32,
        /// The other.
        b: u32,
        /// The distance given.
        distance: f32,
    },
}
