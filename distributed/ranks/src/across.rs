//! The search between owned spheres and ghosts.

use std::ops::ControlFlow;

use lazygrid::{Detector, Error, Sphere, Spheres};

use crate::Particle;

/// Pairs handed over at a time, at most.
const CHUNK: usize = 1 << 14;

/// Hands over the pairs of one owned sphere and one ghost, by their places, in chunks and in any order.
pub(crate) fn pairs_across<F>(
    detector: &mut Detector,
    owned: Spheres<'_>,
    ghosts: &[Particle],
    mut consume: F,
) -> Result<(), Error>
where
    F: FnMut(&[[u32; 2]]) -> ControlFlow<()> + Send,
{
    let ghosts = Columns::of(owned, ghosts);
    detector.stream((owned, ghosts.spheres()?), CHUNK, |pairs| consume(bytemuck::cast_slice(pairs)))?;
    Ok(())
}

/// The number of such pairs.
pub(crate) fn count_across(
    detector: &mut Detector,
    owned: Spheres<'_>,
    ghosts: &[Particle],
) -> Result<u64, Error> {
    detector.count((owned, Columns::of(owned, ghosts).spheres()?))
}

/// Ghosts as a detector takes them.
struct Columns {
    rows: Vec<Sphere>,
    species: Option<Vec<u32>>,
}

impl Columns {
    /// With species where the owned spheres have them.
    fn of(owned: Spheres<'_>, ghosts: &[Particle]) -> Self {
        let species = owned.species().map(|_| ghosts.iter().map(|ghost| ghost.species).collect());
        Self { rows: ghosts.iter().map(|ghost| ghost.sphere).collect(), species }
    }

    fn spheres(&self) -> Result<Spheres<'_>, Error> {
        let rows = Spheres::from(&self.rows);
        Ok(match &self.species {
            Some(species) => rows.with_species(species)?,
            None => rows,
        })
    }
}
