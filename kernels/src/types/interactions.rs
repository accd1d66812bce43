use std::sync::{Arc, OnceLock};

use crate::InputError;

/// The condition for spheres of two species to pair.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Interaction {
    /// Never a pair.
    Never,
    /// A pair if the spheres touch: center distance ≤ `ri + rj`.
    #[default]
    Touch,
    /// A pair if the center distance is at most this distance, for any radii.
    Within(f64),
}

impl Interaction {
    /// Returns the cutoff for the sum of radii `radii`; `None` if the spheres never pair.
    #[inline]
    pub fn cutoff(self, radii: f64) -> Option<f64> {
        self.distance().map(|distance| distance.unwrap_or(radii))
    }

    /// Returns the cutoff, or `Some(None)` if radii decide it; `None` if the spheres never pair.
    #[inline]
    pub fn distance(self) -> Option<Option<f64>> {
        match self {
            Self::Never => None,
            Self::Touch => Some(None),
            Self::Within(distance) => Some(Some(distance)),
        }
    }
}

/// A symmetric table of interactions between species, for reaction–diffusion models.
///
/// With up to 512 species (on a GPU in the table, else in the call), a search compares few spheres of species that
/// never pair; with more, all nearby spheres.
///
/// ```
/// # use lazygrid_kernels::{Interaction, Interactions};
/// let (acid, base) = (0, 1);
/// let mut reactions = Interactions::new(2, Interaction::Never)?;
/// reactions.set(acid, base, Interaction::Within(0.2))?;
/// assert_eq!(reactions.get(base, acid), Interaction::Within(0.2));
/// # Ok::<(), lazygrid_kernels::InputError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Interactions {
    species: u32,
    /// Shared by clones until one changes.
    table: Arc<Vec<Interaction>>,
    fits_f32: bool,
    /// Computed once; `None` if memory was refused.
    species_radii: OnceLock<Option<Arc<Vec<SpeciesRadius>>>>,
}

/// The radius of a species in a search, which covers its distances with others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpeciesRadius {
    /// Half the largest distance of a pair, or 0.
    pub largest_half: f64,
    /// The rule for the effective radius.
    pub effective: EffectiveRadius,
}

impl SpeciesRadius {
    /// The radius of a species that never pairs.
    pub const NONE: Self =
        Self { largest_half: 0.0, effective: EffectiveRadius { touches: false, half: 0.0 } };

    /// Returns the effective radius of a sphere with this radius.
    #[inline]
    pub fn for_radius(&self, radius: f64) -> f64 {
        if self.effective.touches { self.largest_half.max(radius) } else { self.largest_half }
    }

    fn from_interactions(interactions: impl Iterator<Item = Interaction>) -> Self {
        interactions.fold(Self::NONE, |mut radius, with| {
            match with {
                Interaction::Never => {}
                Interaction::Touch => radius.effective.touches = true,
                Interaction::Within(distance) => {
                    radius.largest_half = radius.largest_half.max(0.5 * distance);
                    radius.effective.half = radius.effective.half.max(half_up(distance));
                }
            }
            radius
        })
    }
}

impl PartialEq for Interactions {
    fn eq(&self, other: &Self) -> bool {
        self.table == other.table
    }
}

impl Interactions {
    /// Maximum species of a table; 4096² entries take 256 MiB, and 64 MiB on a device.
    pub const MAX_SPECIES: u32 = 4096;

    /// Creates a table for species `0..species` in which every pair has the interaction `all`.
    ///
    /// # Errors
    /// [`InputError::SpeciesCount`] above [`Self::MAX_SPECIES`], [`InputError::TableMemory`] if memory is refused, and
    /// [`InputError::Distance`] as in [`Self::set`].
    pub fn new(species: u32, all: Interaction) -> Result<Self, InputError> {
        if species > Self::MAX_SPECIES {
            return Err(InputError::SpeciesCount { count: species, limit: Self::MAX_SPECIES });
        }
        check(0, 0, all)?;
        let mut table = reserved(species)?;
        table.resize(entries(species), all);
        Ok(Self { species, table: Arc::new(table), fits_f32: fits_f32(all), species_radii: OnceLock::new() })
    }

    /// Sets the interaction of species `a` and `b`, in both orders.
    ///
    /// # Errors
    /// [`InputError::SpeciesId`] for an unknown species, [`InputError::Distance`] for a negative or non-finite
    /// distance, and [`InputError::TableMemory`] for a copy of a shared table.
    pub fn set(&mut self, a: u32, b: u32, interaction: Interaction) -> Result<(), InputError> {
        for id in [a, b] {
            if id >= self.species {
                return Err(InputError::SpeciesId { index: None, id, count: self.species });
            }
        }
        check(a, b, interaction)?;
        let n = self.species as usize;
        let table = own(&mut self.table, self.species)?;
        self.species_radii = OnceLock::new();
        self.fits_f32 &= fits_f32(interaction);
        table[a as usize * n + b as usize] = interaction;
        table[b as usize * n + a as usize] = interaction;
        Ok(())
    }

    /// Returns the interaction of two species.
    ///
    /// # Panics
    /// If a species is not in the table.
    #[inline]
    pub fn get(&self, a: u32, b: u32) -> Interaction {
        self.table[a as usize * self.species as usize + b as usize]
    }

    /// Returns the table with contact for every distance. Spheres with their [effective radii](Self::effective_radius)
    /// then have at least the pairs of this table.
    ///
    /// # Errors
    /// [`InputError::TableMemory`].
    #[doc(hidden)]
    pub fn contact_only(&self) -> Result<Self, InputError> {
        let contact = |interaction: &Interaction| match interaction {
            Interaction::Never => Interaction::Never,
            Interaction::Touch | Interaction::Within(_) => Interaction::Touch,
        };
        let mut table = reserved(self.species)?;
        table.extend(self.table.iter().map(contact));
        let species_radii = OnceLock::new();
        Ok(Self { species: self.species, table: Arc::new(table), fits_f32: true, species_radii })
    }

    /// Returns the table in which only the included species pair.
    ///
    /// # Errors
    /// [`InputError::TableMemory`].
    #[doc(hidden)]
    pub fn among(&self, is_included: impl Fn(u32) -> bool) -> Result<Self, InputError> {
        let mut table = reserved(self.species)?;
        for a in 0..self.species {
            let of_row =
                |b| if is_included(a) && is_included(b) { self.get(a, b) } else { Interaction::Never };
            table.extend((0..self.species).map(of_row));
        }
        let (table, species_radii) = (Arc::new(table), OnceLock::new());
        Ok(Self { species: self.species, table, fits_f32: self.fits_f32, species_radii })
    }

    /// Returns `true` if `f32` holds all distances to half an ulp, so `f32` spheres need no conversion.
    #[inline]
    pub fn fits_f32(&self) -> bool {
        self.fits_f32
    }

    /// Returns the number of species.
    pub fn species(&self) -> u32 {
        self.species
    }

    /// Returns the rule for this species' effective radius.
    pub fn effective_radius(&self, species: u32) -> EffectiveRadius {
        self.species_radius(species).effective
    }

    #[doc(hidden)]
    pub fn species_radius(&self, species: u32) -> SpeciesRadius {
        let species_radii = self.species_radii.get_or_init(|| {
            let mut species_radii = Vec::new();
            species_radii.try_reserve_exact(self.species as usize).ok()?;
            species_radii.extend((0..self.species).map(|species| self.scan(species)));
            Some(Arc::new(species_radii))
        });
        species_radii
            .as_ref()
            .map_or_else(|| self.scan(species), |species_radii| species_radii[species as usize])
    }

    #[doc(hidden)]
    pub fn species_radius_among(&self, species: u32, others: impl Iterator<Item = u32>) -> SpeciesRadius {
        SpeciesRadius::from_interactions(others.map(|other| self.get(species, other)))
    }

    fn scan(&self, species: u32) -> SpeciesRadius {
        let row = &self.table[species as usize * self.species as usize..][..self.species as usize];
        SpeciesRadius::from_interactions(row.iter().copied())
    }
}

/// The rule for a species' effective radius. Spheres that may pair are no farther apart than the sum of their effective
/// radii.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct EffectiveRadius {
    /// `true` if contact decides some pairs.
    pub touches: bool,
    /// Half the largest interaction distance, rounded up.
    pub half: f32,
}

impl EffectiveRadius {
    /// Returns the effective radius of a sphere with this radius.
    #[inline]
    pub fn for_radius(self, radius: f32) -> f32 {
        if self.touches { self.half.max(radius) } else { self.half }
    }
}

fn entries(species: u32) -> usize {
    species as usize * species as usize
}

fn reserved(species: u32) -> Result<Vec<Interaction>, InputError> {
    let mut table = Vec::new();
    let bytes = entries(species) as u64 * size_of::<Interaction>() as u64;
    table.try_reserve_exact(entries(species)).map_err(|_| InputError::TableMemory { species, bytes })?;
    Ok(table)
}

fn own(table: &mut Arc<Vec<Interaction>>, species: u32) -> Result<&mut Vec<Interaction>, InputError> {
    if Arc::get_mut(table).is_none() {
        let mut copy = reserved(species)?;
        copy.extend_from_slice(table);
        *table = Arc::new(copy);
    }
    Ok(Arc::make_mut(table))
}

/// Rounds half of `distance` up, but to a finite number.
fn half_up(distance: f64) -> f32 {
    let half = (0.5 * distance) as f32;
    let half = if 2.0 * f64::from(half) < distance { half.next_up() } else { half };
    half.min(f32::MAX)
}

fn fits_f32(interaction: Interaction) -> bool {
    match interaction {
        Interaction::Within(distance) => {
            let rounded = distance as f32;
            rounded.is_normal() || f64::from(rounded) == distance
        }
        Interaction::Never | Interaction::Touch => true,
    }
}

fn check(a: u32, b: u32, interaction: Interaction) -> Result<(), InputError> {
    match interaction {
        Interaction::Within(d) if !(d.is_finite() && d >= 0.0) => {
            Err(InputError::Distance { a, b, distance: d })
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changed_tables_have_other_effective_radii() {
        let mut table = Interactions::new(3, Interaction::Never).expect("few species");
        let radius = |table: &Interactions, species| table.effective_radius(species).for_radius(1.0);
        assert_eq!([0, 1, 2].map(|species| radius(&table, species)), [0.0; 3]);
        let before = table.clone();
        table.set(0, 2, Interaction::Within(6.0)).expect("known species");
        table.set(1, 1, Interaction::Touch).expect("known species");
        assert_eq!([0, 1, 2].map(|species| radius(&table, species)), [3.0, 1.0, 3.0]);
        let fields = |species| {
            (table.species_radius(species).largest_half, table.species_radius(species).effective.touches)
        };
        assert_eq!([0, 1, 2].map(fields), [(3.0, false), (0.0, true), (3.0, false)]);
        assert_eq!(table.species_radius_among(0, [0, 1].into_iter()), SpeciesRadius::NONE);
        assert_eq!(table.species_radius_among(2, [0].into_iter()), table.species_radius(2));
        let among = table.among(|species| species != 2).expect("memory");
        assert_eq!([0, 1, 2].map(|species| radius(&among, species)), [0.0, 1.0, 0.0]);
        assert_eq!([0, 1, 2].map(|species| radius(&before, species)), [0.0; 3]);
        assert!(table != before && table == table.clone());
        table.set(2, 0, Interaction::Never).expect("known species");
        assert_eq!([0, 1, 2].map(|species| radius(&table, species)), [0.0, 1.0, 0.0]);
        let mut same = table.clone();
        same.set(0, 0, Interaction::Within(1e300)).expect("known species");
        assert!(same != table);
        same.set(0, 0, Interaction::Never).expect("known species");
        assert!(same == table, "an earlier distance beyond `f32` has no effect");
    }

    #[test]
    fn effective_radii_are_computed_once() {
        let table = Interactions::new(Interactions::MAX_SPECIES, Interaction::Within(1.0)).expect("memory");
        let first = table.effective_radius(0);
        let shared = table.clone();
        for table in [&table, &shared] {
            assert_eq!(table.effective_radius(4095), first);
            let species_radii = table.species_radii.get().and_then(Option::as_ref).expect("they are cached");
            assert_eq!(Arc::strong_count(species_radii), 2);
        }
    }
}
