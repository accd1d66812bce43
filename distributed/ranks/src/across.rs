use std::ops::ControlFlow;

use lazygrid::{Detector, Error, Sphere, Spheres};

use crate::Ghosts;
use crate::memory::try_collect;

const CHUNK_PAIRS: usize = 1 << 14;

pub(crate) fn pairs_across<F>(
    detector: &mut Detector,
    owned: Spheres<'_>,
    ghosts: &Ghosts,
    mut consume: F,
) -> Result<(), Error>
where
    F: FnMut(&[[u32; 2]]) -> ControlFlow<()> + Send,
{
    let ghosts = GhostRows::new(owned, ghosts)?;
    detector.stream((owned, ghosts.spheres()?), CHUNK_PAIRS, |pairs| consume(bytemuck::cast_slice(pairs)))?;
    Ok(())
}

pub(crate) fn count_across(
    detector: &mut Detector,
    owned: Spheres<'_>,
    ghosts: &Ghosts,
) -> Result<u64, Error> {
    detector.count((owned, GhostRows::new(owned, ghosts)?.spheres()?))
}

struct GhostRows<'g> {
    /// Empty if the ghosts have `f64` rows.
    rows: Vec<Sphere>,
    doubles: Option<&'g [[f64; 4]]>,
    species: Option<Vec<u32>>,
}

impl<'g> GhostRows<'g> {
    fn new(owned: Spheres<'_>, ghosts: &'g Ghosts) -> Result<Self, Error> {
        let (doubles, ghosts) = (ghosts.doubles(), ghosts.particles());
        let species = owned.species().map(|_| {
            try_collect(ghosts.len(), ghosts.iter().map(|ghost| ghost.species), "the species of ghosts")
        });
        let rows = match doubles {
            Some(_) => Vec::new(),
            None => try_collect(ghosts.len(), ghosts.iter().map(|ghost| ghost.sphere), "ghosts")?,
        };
        Ok(Self { rows, doubles, species: species.transpose()? })
    }

    fn spheres(&self) -> Result<Spheres<'_>, Error> {
        let rows = self.doubles.map_or_else(|| Spheres::from(&self.rows), Spheres::from);
        Ok(match &self.species {
            Some(species) => rows.with_species(species)?,
            None => rows,
        })
    }
}
