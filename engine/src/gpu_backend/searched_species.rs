//! The species that a device searches. A search reaches as far as the interactions of its species require, so partners
//! that are absent would make it compare distant spheres.

use lazygrid_host::SpeciesGroups;
use lazygrid_kernels::{Interactions, SpeciesReach};

use crate::Error;

/// Species are left out only if the reach of a present one falls below this fraction, because other interactions need
/// new buffers on the device.
const MAX_REACH: f64 = 0.5;
const MAX_PATIENCE: u32 = 255;

#[derive(Debug, Default)]
pub(super) struct SearchedSpecies {
    /// `true` for a species that is not searched; empty if all are.
    are_left_out: Vec<bool>,
    /// Version of the present species at the last call.
    version: u32,
    /// `true` if species that are absent enlarge the reach of others.
    is_too_far: bool,
    /// Successive calls with a reach that is too far.
    waited: u32,
    /// Value of `waited` at which absent species are left out. It doubles when one of them returns.
    patience: u32,
}

impl SearchedSpecies {
    /// Returns the interactions for this call and later ones, or `None` to keep the `searched` ones. The device must
    /// accept them before the change is [recorded](Self::record).
    ///
    /// # Errors
    /// [`Error::Input`] if memory for the interactions is refused.
    pub(super) fn next(
        &mut self,
        present: &SpeciesGroups,
        all: &Interactions,
        searched: &Interactions,
    ) -> Result<Option<Interactions>, Error> {
        if self.version == present.version() && !self.is_too_far {
            return Ok(None);
        }
        let is_too_far =
            |species: u32| is_smaller(present.reaches()[species as usize], searched.reach(species));
        if self.lacks(present) {
            self.patience = (2 * self.patience + 1).min(MAX_PATIENCE);
        } else {
            self.is_too_far =
                (0..all.species()).any(|species| present.is_present(species) && is_too_far(species));
            if !self.is_too_far || self.waited < self.patience {
                self.waited = if self.is_too_far { self.waited + 1 } else { 0 };
                self.version = present.version();
                return Ok(None);
            }
        }
        Ok(Some(all.among(|species| present.is_present(species))?))
    }

    /// Returns `true` if a present species is not searched, so that the interactions must change.
    pub(super) fn lacks(&self, present: &SpeciesGroups) -> bool {
        (0..)
            .zip(&self.are_left_out)
            .any(|(species, is_left_out)| *is_left_out && present.is_present(species))
    }

    /// Keeps the searched interactions until other species are present.
    pub(super) fn keep(&mut self, present: &SpeciesGroups) {
        (self.version, self.is_too_far, self.waited) = (present.version(), false, 0);
    }

    /// Records that the device searches the `present` ones of all `species`.
    pub(super) fn record(&mut self, present: &SpeciesGroups, species: u32) {
        self.keep(present);
        self.are_left_out = (0..species).map(|species| !present.is_present(species)).collect();
    }
}

fn is_smaller(of_present: SpeciesReach, searched: SpeciesReach) -> bool {
    let touches = searched.effective.touches && !of_present.effective.touches;
    touches || of_present.largest_half < MAX_REACH * searched.largest_half
}
