use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use crate::error::bare;

/// Radii by species name, which win over a radius column.
pub type Radii = BTreeMap<String, f64>;

/// The species of a file in the order of appearance, and their given radii.
///
/// A name with a state, `acid(solution)`, takes the radius of `acid` unless it has its own.
#[derive(Clone, Debug, Default)]
pub struct Species {
    names: Vec<String>,
    keys: Vec<Box<[u8]>>,
    radii: Vec<Option<f64>>,
    ids: HashMap<Box<[u8]>, u32>,
    given: Arc<Radii>,
    last: usize,
}

impl Species {
    pub(super) fn new(given: Radii) -> Self {
        Self { given: Arc::new(given), ..Self::default() }
    }

    pub(super) fn with_names(&self) -> Self {
        Self { given: self.given.clone(), ..Self::default() }
    }

    /// Returns names by id.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Returns radii of unknown names, probably misspelled.
    pub fn unused_radii(&self) -> impl Iterator<Item = &str> {
        let met = |given: &str| self.names.iter().any(|name| name == given || bare(name) == given);
        self.given.keys().map(String::as_str).filter(move |given| !met(given))
    }

    pub(super) fn any_given(&self) -> bool {
        !self.given.is_empty()
    }

    /// Returns `true` if all given radii are `f32` numbers.
    pub(super) fn given_fit_f32(&self) -> bool {
        self.given.values().all(|&radius| f64::from(radius as f32) == radius)
    }

    pub(super) fn intern(&mut self, name: &[u8]) -> (u32, Option<f64>) {
        // Rows mostly repeat the species, without hashing.
        let same = self.keys.get(self.last).is_some_and(|last| **last == *name);
        let id = match same {
            true => self.last as u32,
            false => self.ids.get(name).copied().unwrap_or_else(|| self.add(name)),
        };
        self.last = id as usize;
        (id, self.radii[self.last])
    }

    pub(super) fn adopt(&mut self, part: &Self) -> Vec<u32> {
        part.keys.iter().map(|name| self.intern(name).0).collect()
    }

    fn add(&mut self, bytes: &[u8]) -> u32 {
        let name = String::from_utf8_lossy(bytes).into_owned();
        // A frame has fewer than 2³² spheres, each with at most one new name.
        let id = self.names.len() as u32;
        self.radii.push(self.given.get(&name).or_else(|| self.given.get(bare(&name))).copied());
        self.names.push(name);
        self.keys.push(bytes.into());
        self.ids.insert(bytes.into(), id);
        id
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_state_has_its_own_radius_or_that_of_the_bare_name() {
        let given = [("acid", 0.1), ("acid(front)", 0.2), ("salt", 0.3)].map(|(n, r)| (n.to_owned(), r));
        let mut species = Species::new(given.into());
        assert_eq!(species.intern(b"acid(solution)"), (0, Some(0.1)));
        assert_eq!(species.intern(b"acid(front)"), (1, Some(0.2)));
        assert_eq!(species.intern(b"water"), (2, None));
        assert_eq!(species.intern(b"acid(solution)"), (0, Some(0.1)));
        assert_eq!(species.names(), ["acid(solution)", "acid(front)", "water"]);
        assert_eq!(species.unused_radii().collect::<Vec<_>>(), ["salt"]);
    }
}
