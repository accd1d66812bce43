//! The species that a device searches. Absent partners would enlarge the radii of others.

use lazygrid_host::SpeciesGroups;
use lazygrid_kernels::{Interactions, SpeciesRadius};

use crate::Error;

/// Absent species are omitted only if the radius of a present one falls below this fraction, because other interactions
/// need new buffers on the device.
const MAX_RADIUS_RATIO: f64 = 0.5;
const MAX_PATIENCE: u32 = 255;

#[derive(Debug, Default)]
pub(super) struct SearchedSpecies {
    are_omitted: Vec<bool>,
    version: u32,
    /// `true` if absent species enlarge radii of others.
    absent_enlarge_radii: bool,
    waited: u32,
    /// Value of `waited` at which absent species are omitted; it doubles when one of them returns.
    patience: u32,
}

impl SearchedSpecies {
    /// Returns new interactions, whose change must be [recorded](Self::record) after the device has accepted them.
    pub(super) fn next(
        &mut self,
        present: &SpeciesGroups,
        all: &Interactions,
        searched: &Interactions,
    ) -> Result<Option<Interactions>, Error> {
        if self.version == present.version() && !self.absent_enlarge_radii {
            return Ok(None);
        }
        let is_enlarged = |species: u32| {
            is_smaller(present.species_radii()[species as usize], searched.species_radius(species))
        };
        if self.lacks(present) {
            self.patience = (2 * self.patience + 1).min(MAX_PATIENCE);
        } else {
            self.absent_enlarge_radii =
                (0..all.species()).any(|species| present.is_present(species) && is_enlarged(species));
            if !self.absent_enlarge_radii || self.waited < self.patience {
                self.waited = if self.absent_enlarge_radii { self.waited + 1 } else { 0 };
                self.version = present.version();
                return Ok(None);
            }
        }
        Ok(Some(all.among(|species| present.is_present(species))?))
    }

    pub(super) fn lacks(&self, present: &SpeciesGroups) -> bool {
        (0..).zip(&self.are_omitted).any(|(species, is_omitted)| *is_omitted && present.is_present(species))
    }

    pub(super) fn keep(&mut self, present: &SpeciesGroups) {
        (self.version, self.absent_enlarge_radii, self.waited) = (present.version(), false, 0);
    }

    pub(super) fn record(&mut self, present: &SpeciesGroups, species: u32) {
        self.keep(present);
        self.are_omitted = (0..species).map(|species| !present.is_present(species)).collect();
    }
}

fn is_smaller(of_present: SpeciesRadius, searched: SpeciesRadius) -> bool {
    let touches = searched.effective.touches && !of_present.effective.touches;
    touches || of_present.largest_half < MAX_RADIUS_RATIO * searched.largest_half
}
