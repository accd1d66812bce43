use std::collections::{BTreeMap, HashMap, TryReserveError};
use std::sync::Arc;

use crate::error::bare;
use crate::memory::{check_margin, try_collect, try_text};

/// Radii by species name.
pub type Radii = BTreeMap<String, f64>;

/// Names that are added between two checks of the memory that is left.
const NAMES_PER_CHECK: usize = 256;

/// The species of a file in order of appearance, and their given radii. `acid(solution)` takes the radius of
/// `acid` unless it has its own.
#[derive(Clone, Debug, Default)]
pub struct Species {
    names: Vec<String>,
    keys: Vec<Box<[u8]>>,
    radii: Vec<Option<f64>>,
    ids: HashMap<Box<[u8]>, u32>,
    radii_by_name: Arc<Radii>,
    last: usize,
}

impl Species {
    pub(super) fn new(radii_by_name: Radii) -> Self {
        Self { radii_by_name: Arc::new(radii_by_name), ..Self::default() }
    }

    pub(super) fn with_names(&self) -> Self {
        Self { radii_by_name: self.radii_by_name.clone(), ..Self::default() }
    }

    /// Returns names by id.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Returns names in `Options::radii` that no sphere has.
    pub fn unused_radii(&self) -> impl Iterator<Item = &str> {
        let met = |key: &str| self.names.iter().any(|name| name == key || bare(name) == key);
        self.radii_by_name.keys().map(String::as_str).filter(move |key| !met(key))
    }

    pub(super) fn has_radii(&self) -> bool {
        !self.radii_by_name.is_empty()
    }

    pub(super) fn radii_fit_f32(&self) -> bool {
        self.radii_by_name.values().all(|&radius| f64::from(radius as f32) == radius)
    }

    pub(super) fn intern(&mut self, name: &[u8]) -> Result<(u32, Option<f64>), TryReserveError> {
        // Most rows repeat the species.
        let same = self.keys.get(self.last).is_some_and(|last| **last == *name);
        let id = match same {
            true => self.last as u32,
            false => self.ids.get(name).copied().map_or_else(|| self.add(name), Ok)?,
        };
        self.last = id as usize;
        Ok((id, self.radii[self.last]))
    }

    pub(super) fn adopt(&mut self, other: &Self) -> Result<Vec<u32>, TryReserveError> {
        let mut ids = Vec::new();
        ids.try_reserve_exact(other.keys.len())?;
        for name in &other.keys {
            ids.push(self.intern(name)?.0);
        }
        Ok(ids)
    }

    fn add(&mut self, bytes: &[u8]) -> Result<u32, TryReserveError> {
        // Names must leave memory to allocations that cannot report a failure.
        if self.names.len().is_multiple_of(NAMES_PER_CHECK) {
            check_margin()?;
        }
        let name = try_text(bytes)?;
        let key = || try_collect(bytes.iter().copied()).map(Vec::into_boxed_slice);
        let [listed, mapped] = [key()?, key()?];
        self.radii.try_reserve(1)?;
        self.names.try_reserve(1)?;
        self.keys.try_reserve(1)?;
        self.ids.try_reserve(1)?;
        // A frame has fewer than 2³² new names.
        let id = self.names.len() as u32;
        self.radii
            .push(self.radii_by_name.get(&name).or_else(|| self.radii_by_name.get(bare(&name))).copied());
        self.names.push(name);
        self.keys.push(listed);
        self.ids.insert(mapped, id);
        Ok(id)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn interned(species: &mut Species, name: &[u8]) -> (u32, Option<f64>) {
        species.intern(name).unwrap()
    }

    #[test]
    fn a_state_has_its_own_radius_or_that_of_the_bare_name() {
        let radii = [("acid", 0.1), ("acid(front)", 0.2), ("salt", 0.3)].map(|(n, r)| (n.to_owned(), r));
        let mut species = Species::new(radii.into());
        assert_eq!(interned(&mut species, b"acid(solution)"), (0, Some(0.1)));
        assert_eq!(interned(&mut species, b"acid(front)"), (1, Some(0.2)));
        assert_eq!(interned(&mut species, b"water"), (2, None));
        assert_eq!(interned(&mut species, b"acid(solution)"), (0, Some(0.1)));
        assert_eq!(species.names(), ["acid(solution)", "acid(front)", "water"]);
        assert_eq!(species.unused_radii().collect::<Vec<_>>(), ["salt"]);
    }
}
