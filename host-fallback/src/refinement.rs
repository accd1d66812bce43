//! What is asked of two spheres besides touching in the space that is searched.

use lazygrid_kernels::{
    Exclusions, InputError, Interaction, Interactions, Reach, Shear, Space, Sphere, Spheres,
};

/// What decides on pairs that a search has found: groups and pairs that are left out, and in a sheared space the distance.
///
/// A sheared space is searched in [straight coordinates](Shear::straighten), by any algorithm for orthogonal ones. There
/// radii are larger than they are, so that what touches is a candidate; only here the distance of nearest images is
/// taken, of the spheres as they were given. Indices are those of all spheres: of two sets the second one's come behind
/// the first one's.
#[derive(Clone, Debug)]
pub struct Refinement<'a> {
    first: Spheres<'a>,
    second: Option<Spheres<'a>>,
    sheared: Option<Sheared<'a>>,
    has_groups: bool,
    exclusions: Option<&'a Exclusions>,
}

/// What it takes to decide on distances in a sheared space.
#[derive(Clone, Debug)]
struct Sheared<'a> {
    shear: &'a Shear,
    interactions: Option<&'a Interactions>,
    reaches: Vec<Reach>,
}

impl<'a> Refinement<'a> {
    /// What is asked of the pairs of a set, or of pairs between two sets; `None` where touching is enough. Species ids are
    /// checked already.
    ///
    /// # Errors
    /// [`InputError::ExclusionsOfOthers`] for pairs to be left out that were made for other numbers of spheres,
    /// [`InputError::ExclusionsOfSecond`] for such with the second set.
    pub fn new(
        first: Spheres<'a>,
        second: Option<Spheres<'a>>,
        interactions: Option<&'a Interactions>,
        space: &'a Space,
    ) -> Result<Option<Self>, InputError> {
        let exclusions = first.exclusions();
        let given = (first.len(), second.map(|second| second.len()));
        if let Some(made_for) = exclusions.map(Exclusions::spheres).filter(|made_for| *made_for != given) {
            return Err(InputError::ExclusionsOfOthers { made_for, given });
        }
        if second.is_some_and(|second| second.exclusions().is_some()) {
            return Err(InputError::Second(Box::new(InputError::ExclusionsOfSecond)));
        }
        #[expect(clippy::disallowed_methods, reason = "a table has at most 4096 species")]
        let sheared = space.shear().map(|shear| {
            let reach = |table: &Interactions| (0..table.species()).map(|of| table.reach(of)).collect();
            Sheared { shear, interactions, reaches: interactions.map_or_else(Vec::new, reach) }
        });
        // Of two sets, spheres of one only are never of one group with any of the other.
        let has_groups = first.groups().is_some() && second.is_none_or(|second| second.groups().is_some());
        let is_needed = sheared.is_some() || has_groups || exclusions.is_some();
        Ok(is_needed.then_some(Self { first, second, sheared, has_groups, exclusions }))
    }

    /// Whether it decides on distances too: then what the search has found are candidates.
    pub fn is_sheared(&self) -> bool {
        self.sheared.is_some()
    }

    /// Whether two spheres that touch where they were searched are a pair.
    pub fn keeps(&self, i: u32, j: u32) -> bool {
        // The list last, which takes longest.
        !(self.has_groups && self.are_of_one_group(i, j))
            && self.sheared.as_ref().is_none_or(|sheared| self.touch(sheared, i, j))
            && !self.exclusions.is_some_and(|exclusions| self.are_listed(exclusions, i, j))
    }

    /// The set that a sphere is of, and its index there.
    fn of(&self, k: u32) -> (Spheres<'a>, usize) {
        let (k, first) = (k as usize, self.first.len());
        match self.second {
            Some(second) if k >= first => (second, k - first),
            _ => (self.first, k),
        }
    }

    fn group(&self, k: u32) -> u32 {
        let (set, k) = self.of(k);
        set.groups().map_or(Spheres::NO_GROUP, |groups| groups[k])
    }

    fn are_of_one_group(&self, i: u32, j: u32) -> bool {
        let group = self.group(i);
        group != Spheres::NO_GROUP && group == self.group(j)
    }

    fn are_listed(&self, exclusions: &Exclusions, i: u32, j: u32) -> bool {
        match self.second {
            None => exclusions.contains(i, j),
            Some(_) => exclusions.contains(i.min(j), i.max(j) - self.first.len() as u32),
        }
    }

    /// Whether nearest images are in reach of each other.
    fn touch(&self, sheared: &Sheared<'_>, i: u32, j: u32) -> bool {
        let [(a, of_a), (b, of_b)] = [i, j].map(|k| {
            let (set, k) = self.of(k);
            (set.get(k), set.species().map(|species| species[k]))
        });
        let interaction = match (sheared.interactions, of_a, of_b) {
            (Some(table), Some(a), Some(b)) => table.get(a, b),
            _ => Interaction::Touch,
        };
        let reach = match interaction {
            Interaction::Never => return false,
            Interaction::Touch => f64::from(a.radius) + f64::from(b.radius),
            Interaction::Within(distance) => f64::from(distance),
        };
        sheared.shear.distance_squared(a.center, b.center) <= reach * reach
    }

    /// A sphere as it is searched: in a sheared space straight, with the reach of its interactions as its radius.
    pub fn searched(&self, k: usize) -> Sphere {
        let (set, k) = self.of(k as u32);
        let sphere = set.get(k);
        let Some(sheared) = &self.sheared else { return sphere };
        match set.species().filter(|_| sheared.interactions.is_some() && sphere.is_valid()) {
            None => sheared.shear.straighten(sphere),
            Some(species) => {
                let radius = sheared.reaches[species[k] as usize].effective_radius(sphere.radius);
                sheared.shear.straighten(Sphere { radius, ..sphere })
            }
        }
    }
}
