use std::collections::HashMap;
use std::fmt::Display;

use lazygrid::Space;

use super::Options;
use super::serial::Serial;
use super::species::Species;
use crate::error::{Error, Location, Position};

pub(super) struct ReadContext {
    pub(super) species: Species,
    /// The space that was given.
    pub(super) space: Option<Space>,
    /// `true` if ids are wanted.
    pub(super) ids: bool,
    /// `true` if groups are wanted.
    pub(super) groups: bool,
    /// The lines of serial numbers, which must be unique.
    serials: HashMap<Serial, u64>,
    /// `true` if the loss of digits was logged.
    warned: bool,
}

impl ReadContext {
    pub(super) fn new(options: Options) -> Self {
        let Options { radii, space, ids, groups, .. } = options;
        Self { species: Species::new(radii), space, ids, groups, serials: HashMap::new(), warned: false }
    }

    /// Logs once per file that numbers have more digits than 32 bits hold.
    pub(super) fn warn_of_rounding(&mut self, place: Location, column: &str, text: impl Display) {
        if !std::mem::replace(&mut self.warned, true) {
            log::warn!(
                "{place}: {column} is {text}, more digits than the 32-bit numbers have that spheres are made of; it is \
                 rounded, as later ones may be; if that matters, move the origin near the spheres"
            );
        }
    }

    /// Records serial numbers with their lines, and refuses a repeated one.
    pub(super) fn listed(&mut self, serials: &[(Serial, u64)], file: &Location) -> Result<(), Error> {
        for &(serial, line) in serials {
            if let Some(first) = self.serials.insert(serial, line) {
                let serial = match serial {
                    (whole, None) => whole.to_string(),
                    (high, Some(low)) => format!("{high}.{low}"),
                };
                let place = Location { at: Position::Line(line), ..file.clone() };
                return Err(Error::RepeatedMolecule { place, serial, first });
            }
        }
        Ok(())
    }
}
