use std::ops::ControlFlow;

use lazygrid::{Detector, Error, Sphere, Spheres};

use crate::Particle;

/// Hands over the pairs of one owned sphere and one ghost, by their places, in chunks and in any order.
///
/// The detector searches both sets together, and what is not of this kind is left out.
pub(crate) fn between<F>(
    detector: &mut Detector,
    owned: Spheres<'_>,
    ghosts: &[Particle],
    mut consume: F,
) -> Result<(), Error>
where
    F: FnMut(&[[u32; 2]]) -> ControlFlow<()> + Send,
{
    const CHUNK: usize = 1 << 14;
    let first = owned.len() as u32;
    let rows: Vec<Sphere> = owned.iter().chain(ghosts.iter().map(|ghost| ghost.sphere)).collect();
    let species: Option<Vec<u32>> = owned
        .species()
        .map(|owned| owned.iter().copied().chain(ghosts.iter().map(|ghost| ghost.species)).collect());
    let mut both = Spheres::from(&rows);
    if let Some(species) = &species {
        both = both.with_species(species)?;
    }
    let mut kept = Vec::new();
    detector.stream(both, CHUNK, |pairs| {
        kept.clear();
        let across = pairs.iter().filter(|pair| pair.i < first && pair.j >= first);
        kept.extend(across.map(|pair| [pair.i, pair.j - first]));
        if kept.is_empty() { ControlFlow::Continue(()) } else { consume(&kept) }
    })?;
    Ok(())
}
