//! Pairs of one sphere of each of two sets: a search of both, in which spheres of one set never pair.

use lazygrid_host::Refinement;
use lazygrid_kernels::{Algorithm, Interaction, Interactions, Space, Sphere, Spheres, make_room};

use super::device_search::{Given, Search};
use super::session::GpuSession;
use crate::Error;

/// Searches both sets as one, with species that tell them apart: those of the second set come after all of the first.
#[derive(Debug)]
pub(super) struct TwoSets {
    pub(super) search: Search,
    table: Interactions,
    /// Whether spheres come with species, by which they pair.
    has_species: bool,
    spheres: Vec<Sphere>,
    species: Vec<u32>,
}

impl TwoSets {
    /// Beside a session of one set, with this table.
    ///
    /// # Errors
    /// [`Error::Setting`] for a table of more species than can be told apart; otherwise where the device refuses something.
    pub(super) fn new(beside: &GpuSession, table: Option<&Interactions>) -> Result<Self, Error> {
        let (has_species, table) = (table.is_some(), apart(table)?);
        let search = Search::new(beside.with_interactions(table.clone())?);
        Ok(Self { search, table, has_species, spheres: Vec::new(), species: Vec::new() })
    }

    /// Has `work` search both.
    ///
    /// # Errors
    /// Those of `work`, and [`Error::OutOfMemory`].
    pub(super) fn search<R>(
        &mut self,
        (a, b): (Spheres<'_>, Spheres<'_>),
        (space, algorithm): (Space, Algorithm),
        refinement: Option<&Refinement<'_>>,
        work: impl FnOnce(&mut Search, &Given<'_>) -> Result<R, Error>,
    ) -> Result<R, Error> {
        let Self { search, table, has_species, spheres, species } = self;
        let (count, second) = (a.len() + b.len(), table.species() / 2);
        spheres.clear();
        make_room(spheres, count, "both sets")?;
        spheres.extend(a.iter().chain(b.iter()));
        species.clear();
        make_room(species, count, "both sets")?;
        for (set, first) in [(a, 0), (b, second)] {
            match set.species().filter(|_| *has_species) {
                Some(ids) => species.extend(ids.iter().map(|id| first + id)),
                None => species.resize(species.len() + set.len(), first),
            }
        }
        let spheres = Spheres::from(&*spheres).with_species(species)?;
        work(search, &Given { spheres, interactions: Some(table), space, algorithm, refinement })
    }
}

/// The table of both sets.
fn apart(table: Option<&Interactions>) -> Result<Interactions, Error> {
    let species = table.map_or(1, Interactions::species);
    if species > Interactions::MAX_SPECIES / 2 {
        let range = "for pairs between two sets on a GPU choose at most 2048 species, or `Backend::Cpu`";
        return Err(Error::Setting { name: "species", value: species.to_string(), range });
    }
    let mut apart = Interactions::new(2 * species, Interaction::Never)?;
    for (a, b) in (0..species).flat_map(|a| (0..species).map(move |b| (a, b))) {
        apart.set(a, species + b, table.map_or(Interaction::Touch, |table| table.get(a, b)))?;
    }
    Ok(apart)
}
