use std::collections::HashMap;
use std::fmt::Display;

use lazygrid::Space;

use super::serial::Serial;
use super::species::Species;
use super::{Options, Precision};
use crate::error::{Error, Location, Position, excerpt};

pub(super) struct ReadContext {
    pub(super) species: Species,
    pub(super) space: Option<Space>,
    pub(super) ids: bool,
    pub(super) groups: bool,
    pub(super) precision: Precision,
    pub(super) doubles: bool,
    /// Line of each serial number.
    serials: HashMap<Serial, u64>,
    pub(super) rounding: Option<String>,
}

impl ReadContext {
    pub(super) fn new(options: Options) -> Result<Self, Error> {
        let Options { mut radii, space, ids, groups, precision, .. } = options;
        let doubles = precision != Precision::F32;
        let rounded = |radius: f64| if doubles { radius } else { f64::from(radius as f32) };
        let is_refused = |radius: f64| !(rounded(radius).is_finite() && radius >= 0.0);
        if let Some((species, &radius)) = radii.iter().find(|(_, radius)| is_refused(**radius)) {
            return Err(Error::Radius { species: excerpt(species.as_bytes()), radius });
        }
        radii.values_mut().for_each(|radius| *radius = rounded(*radius));
        let (species, serials) = (Species::new(radii), HashMap::new());
        Ok(Self { species, space, ids, groups, precision, doubles, serials, rounding: None })
    }

    pub(super) fn warn_of_rounding(&mut self, location: Location, column: &str, text: impl Display) {
        if self.rounding.is_none() {
            let warning = format!(
                "{location}: {column} is {text}, which the 32-bit numbers of spheres cannot represent; it is rounded, as \
                 later ones may be; if that matters, search 64-bit numbers (lazygrid detect --precision f64; in Python \
                 dtype='float64'), or move the origin near the spheres"
            );
            log::warn!("{warning}");
            self.rounding = Some(warning);
        }
    }

    pub(super) fn listed(&mut self, serials: &[(Serial, u64)], file: &Location) -> Result<(), Error> {
        let spheres = (self.serials.len() + serials.len()) as u64;
        let refused = |_| Error::OutOfMemory { location: file.clone(), spheres };
        self.serials.try_reserve(serials.len()).map_err(refused)?;
        for &(serial, line) in serials {
            if let Some(first) = self.serials.insert(serial, line) {
                let serial = match serial {
                    (whole, None) => whole.to_string(),
                    (high, Some(low)) => format!("{high}.{low}"),
                };
                let location = Location { at: Position::Line(line), ..file.clone() };
                return Err(Error::RepeatedMolecule { location, serial, first });
            }
        }
        Ok(())
    }
}
