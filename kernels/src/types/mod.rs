mod basis;
mod contact_test;
pub(crate) mod exclusions;
pub(crate) mod interactions;
pub(crate) mod lattice;
pub(crate) mod minimum_image;
pub(crate) mod orthogonalization;
pub(crate) mod pair;
pub(crate) mod query;
#[cfg(test)]
mod random;
pub(crate) mod real;
pub(crate) mod space;
pub(crate) mod sphere;
pub(crate) mod triclinic;
