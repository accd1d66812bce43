use std::ops::ControlFlow;

use lazygrid::{Detector, Error, Sphere, Spheres};

use crate::Particle;
use crate::memory::try_collect;

const CHUNK_PAIRS: usize = 1 << 14;

pub(crate) fn pairs_across<F>(
    detector: &mut Detector,
    owned: Spheres<'_>,
    ghosts: &[Particle],
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
    ghosts: &[Particle],
) -> Result<u64, Error> {
    detector.count((owned, GhostRows::new(owned, ghosts)?.spheres()?))
}

struct GhostRows {
    rows: Vec<Sphere>,
    species: Option<Vec<u32>>,
}

impl GhostRows {
    fn new(owned: Spheres<'_>, ghosts: &[Particle]) -> Result<Self, Error> {
        let species = owned.species().map(|_| {
            try_collect(ghosts.len(), ghosts.iter().map(|ghost| ghost.species), "the species of ghosts")
        });
        let rows = try_collect(ghosts.len(), ghosts.iter().map(|ghost| ghost.sphere), "ghosts")?;
        Ok(Self { rows, species: species.transpose()? })
    }

    fn spheres(&self) -> Result<Spheres<'_>, Error> {
        let rows = Spheres::from(&self.rows);
        Ok(match &self.species {
            Some(species) => rows.with_species(species)?,
            None => rows,
        })
    }
}
