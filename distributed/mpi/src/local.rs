use lazygrid::{InputError, MAX_SPHERES, Sphere, Spheres};
use lazygrid_ranks::Particle;

use crate::Error;

#[derive(Clone, Copy, Debug)]
pub struct LocalSpheres<'a> {
    pub(crate) spheres: Spheres<'a>,
    pub(crate) ids: &'a [u64],
}

impl<'a> LocalSpheres<'a> {
    /// Requires species if there are interactions, ids that are unique among all ranks, and one length unit and number
    /// type on all ranks.
    pub fn new(spheres: impl Into<Spheres<'a>>, ids: &'a [u64]) -> Self {
        Self { spheres: spheres.into(), ids }
    }

    pub(crate) fn check(&self, rank: u32, species: Option<u32>) -> Result<(), Error> {
        let refuse = |index: Option<u32>, error: InputError| {
            Err(Error::Input { rank, index, message: error.to_string() })
        };
        let (length, expected) = (self.ids.len(), self.spheres.len());
        if length != expected {
            return refuse(None, InputError::Lengths { what: "ids", length, expected });
        }
        if expected as u64 > MAX_SPHERES {
            return refuse(None, InputError::TooManySpheres { count: expected as u64 });
        }
        if self.spheres.groups().is_some() {
            let message = "groups are known within one process only; filter the pairs that are reported";
            return Err(Error::Input { rank, index: None, message: message.to_owned() });
        }
        let mut bad = (0..expected).filter(|&k| !self.spheres.is_valid(k));
        if let Some(first) = bad.next() {
            let (count, index) = (1 + bad.count() as u64, first as u32);
            let [x, y, z, radius] = self.spheres.get_f64(first);
            let (center, total) = ([x, y, z], expected as u64);
            return refuse(Some(index), InputError::Sphere { index, center, radius, count, total });
        }
        match (species, self.spheres.species()) {
            (Some(_), None) if expected > 0 => refuse(None, InputError::SpeciesMissing),
            (Some(count), Some(ids)) => match (0..).zip(ids).find(|&(_, &id)| id >= count) {
                Some((index, &id)) => {
                    refuse(Some(index), InputError::SpeciesId { index: Some(index), id, count })
                }
                None => Ok(()),
            },
            _ => Ok(()),
        }
    }

    pub(crate) fn particles(self) -> impl ExactSizeIterator<Item = Particle> {
        (0..self.ids.len()).map(move |k| self.particle(k as u32))
    }

    /// Rounds `f64` numbers.
    #[inline]
    pub(crate) fn particle(&self, k: u32) -> Particle {
        let species = self.spheres.species().map_or(0, |species| species[k as usize]);
        Particle { sphere: self.spheres.get(k as usize), id: self.ids[k as usize], species, index: k }
    }

    #[inline]
    pub(crate) fn row(&self, k: u32) -> [f64; 4] {
        self.spheres.get_f64(k as usize)
    }
}

/// Spheres that [`rebalance`](crate::Distributed::rebalance) moves.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OwnedSpheres {
    /// Empty if the numbers are `f64`.
    pub spheres: Vec<Sphere>,
    /// Rows `x, y, z, r` in place of `spheres`.
    pub doubles: Option<Vec<[f64; 4]>>,
    /// Unique among all ranks.
    pub ids: Vec<u64>,
    /// Present with interactions.
    pub species: Option<Vec<u32>>,
}

impl OwnedSpheres {
    /// Borrows the spheres.
    ///
    /// # Errors
    /// [`InputError::Lengths`] unless each sphere has a species.
    pub fn local(&self) -> Result<LocalSpheres<'_>, InputError> {
        let spheres = match &self.doubles {
            Some(doubles) => Spheres::from(doubles),
            None => Spheres::from(&self.spheres),
        };
        let spheres = match &self.species {
            Some(species) => spheres.with_species(species)?,
            None => spheres,
        };
        Ok(LocalSpheres { spheres, ids: &self.ids })
    }
}
