//! The spheres that a call is given: one set, or two of which only pairs across count.

use lazygrid_kernels::{InputError, Interactions, MAX_SPHERES, Space, Sphere, Spheres};

use crate::Error;
use crate::memory::resize;
use crate::refinement::Refinement;
use crate::survey::{check, check_species};
use crate::threads::Threads;

/// Spheres per piece of a copy.
const PIECE: usize = 1 << 14;

/// What a call is given.
#[derive(Clone, Copy)]
pub(crate) enum Given<'a> {
    /// All pairs of these.
    One(Spheres<'a>),
    /// Pairs of one of each.
    Two(Spheres<'a>, Spheres<'a>),
}

/// Buffers for spheres that cannot be taken as they are given.
#[derive(Debug, Default)]
pub(crate) struct Near {
    spheres: Vec<Sphere>,
    species: Vec<u32>,
}

impl<'a> Given<'a> {
    /// The first set, and the second where there are two.
    fn parts(self) -> (Spheres<'a>, Option<Spheres<'a>>) {
        match self {
            Self::One(all) => (all, None),
            Self::Two(a, b) => (a, Some(b)),
        }
    }

    /// How many spheres there are in all.
    pub(crate) fn len(self) -> usize {
        let (a, b) = self.parts();
        a.len() + b.map_or(0, |b| b.len())
    }

    /// How many of them are of the first of two sets.
    pub(crate) fn split(self) -> Option<usize> {
        let (a, b) = self.parts();
        b.map(|_| a.len())
    }

    /// Runs a check of each set; what is wrong with the second one says so.
    fn each(self, check: impl Fn(Spheres<'_>) -> Result<(), InputError>) -> Result<(), InputError> {
        let (a, b) = self.parts();
        check(a)?;
        b.map_or(Ok(()), |b| check(b).map_err(|error| InputError::Second(Box::new(error))))
    }

    /// Refuses more spheres than indices, and species outside the table.
    ///
    /// # Errors
    /// Those of [`check_species`].
    pub(crate) fn check_species(
        self,
        table: Option<&Interactions>,
        threads: Threads,
    ) -> Result<(), InputError> {
        if self.len() as u64 > MAX_SPHERES {
            return Err(InputError::TooManySpheres { count: self.len() as u64 });
        }
        self.each(|spheres| check_species(spheres, table, threads))
    }

    /// Refuses spheres that are not valid.
    ///
    /// # Errors
    /// Those of [`check`].
    pub(crate) fn check(self, threads: Threads) -> Result<(), InputError> {
        self.each(|spheres| check(spheres, threads))
    }

    /// What is asked of pairs besides touching.
    ///
    /// # Errors
    /// Those of [`Refinement::new`].
    pub(crate) fn refinement(
        self,
        table: Option<&'a Interactions>,
        space: &'a Space,
    ) -> Result<Option<Refinement<'a>>, InputError> {
        let (a, b) = self.parts();
        Refinement::new(a, b, table, space)
    }

    /// The spheres that were given, where there is one set and space is unbounded: there is nothing to copy.
    pub(crate) fn as_they_are(self, space: &Space) -> Option<Spheres<'a>> {
        match self {
            Self::One(all) if !space.is_periodic() => Some(all),
            _ => None,
        }
    }

    /// The spheres one after another, as their images nearest to the origin.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    pub(crate) fn near(
        self,
        space: &Space,
        near: &'a mut Near,
        threads: Threads,
    ) -> Result<Spheres<'a>, Error> {
        let (a, b) = self.parts();
        let Near { spheres, species } = near;
        resize(spheres, self.len(), "nearest images of spheres")?;
        let (first, second) = spheres.split_at_mut(a.len());
        copy(a, space, first, threads);
        let Some(b) = b else {
            let all = Spheres::from(&*spheres);
            return Ok(a.species().map_or(Ok(all), |ids| all.with_species(ids))?);
        };
        copy(b, space, second, threads);
        let all = Spheres::from(&*spheres);
        let (Some(of_a), Some(of_b)) = (a.species(), b.species()) else { return Ok(all) };
        resize(species, of_a.len() + of_b.len(), "species of spheres")?;
        let (first, second) = species.split_at_mut(of_a.len());
        first.copy_from_slice(of_a);
        second.copy_from_slice(of_b);
        Ok(all.with_species(species)?)
    }
}

impl Near {
    /// The spheres one after another, as they are searched in a sheared space.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    pub(crate) fn straight(
        &mut self,
        refinement: &Refinement<'_>,
        count: usize,
        threads: Threads,
    ) -> Result<Spheres<'_>, Error> {
        resize(&mut self.spheres, count, "straight spheres")?;
        threads.each_stretch(&mut self.spheres, PIECE, |piece, targets| {
            for (target, k) in targets.iter_mut().zip(piece * PIECE..) {
                *target = refinement.searched(k);
            }
        });
        Ok(Spheres::from(&self.spheres))
    }
}

/// Writes the images nearest to the origin.
fn copy(spheres: Spheres<'_>, space: &Space, targets: &mut [Sphere], threads: Threads) {
    let is_periodic = space.is_periodic();
    threads.each_stretch(targets, PIECE, |piece, targets| {
        for (target, k) in targets.iter_mut().zip(piece * PIECE..) {
            let Sphere { center, radius } = spheres.get(k);
            *target = Sphere { center: if is_periodic { space.wrap(center) } else { center }, radius };
        }
    });
}
