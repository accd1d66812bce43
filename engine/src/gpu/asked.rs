//! Which spheres a detector on the GPU is asked about.

use lazygrid_kernels::{InputError, Sphere, Spheres};

/// The spheres of a call.
#[derive(Clone, Copy)]
pub(super) enum Asked<'a> {
    /// All pairs of these.
    One(Spheres<'a>),
    /// Pairs of one of each.
    Two(Spheres<'a>, Spheres<'a>),
}

impl<'a> Asked<'a> {
    /// The first set, and the second where there are two.
    pub(super) fn parts(self) -> (Spheres<'a>, Option<Spheres<'a>>) {
        match self {
            Self::One(all) => (all, None),
            Self::Two(a, b) => (a, Some(b)),
        }
    }

    /// What the device is given: `straight` spheres in place of these where space is sheared, and none of the exclusions,
    /// which are looked at when pairs have come back.
    pub(super) fn searched(self, straight: Option<&'a Vec<Sphere>>) -> Result<Self, InputError> {
        let like = |set: Spheres<'a>, from: usize| match straight {
            None => Ok(set.without_exclusions()),
            Some(straight) => {
                let spheres = Spheres::from(&straight[from..from + set.len()]);
                set.species().map_or(Ok(spheres), |species| spheres.with_species(species))
            }
        };
        Ok(match self {
            Self::One(all) => Self::One(like(all, 0)?),
            Self::Two(a, b) => Self::Two(like(a, 0)?, like(b, a.len())?),
        })
    }

    pub(super) fn len(self) -> usize {
        match self {
            Self::One(all) => all.len(),
            Self::Two(a, b) => a.len() + b.len(),
        }
    }

    /// How many spheres are of the first of two sets; 0 where there is one.
    pub(super) fn first(self) -> usize {
        match self {
            Self::One(_) => 0,
            Self::Two(a, _) => a.len(),
        }
    }
}
