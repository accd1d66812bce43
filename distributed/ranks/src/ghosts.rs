use lazygrid::Space;
use rayon::prelude::*;

use crate::rule::{Side, travels};
use crate::{Body, Class, Hull};

/// The hulls that all ranks published.
#[derive(Clone, Debug, Default)]
pub struct Published {
    hulls: Vec<Hull>,
    /// The start of each rank's ghosts, and the end of the last.
    starts: Vec<usize>,
}

impl Published {
    /// The hulls of each rank.
    pub fn new(of_ranks: impl IntoIterator<Item = Vec<Hull>>) -> Self {
        let mut published = Self { hulls: Vec::new(), starts: vec![0] };
        for hulls in of_ranks {
            published.hulls.extend(hulls);
            published.starts.push(published.hulls.len());
        }
        published
    }

    /// The number of ranks.
    pub fn ranks(&self) -> u32 {
        self.starts.len().saturating_sub(1) as u32
    }

    /// The hulls of a rank.
    pub fn of(&self, rank: u32) -> &[Hull] {
        &self.hulls[self.starts[rank as usize]..self.starts[rank as usize + 1]]
    }

    /// What travels from `rank`, whose bodies these are: for each rank the places of those that may overlap something
    /// there and that [travel](travels) to it, ascending.
    pub fn ghosts(&self, rank: u32, bodies: &[Body], space: &Space) -> Vec<Vec<u32>> {
        let classes = members(bodies, self.of(rank));
        let to = |to: u32| {
            let mut ghosts = Vec::new();
            for (hull, members) in &classes {
                let near = self.near(Side { rank, class: hull.class() }, hull, (to, space));
                let meets = |&&k: &&u32| near.iter().any(|near| near.meets(space, &bodies[k as usize]));
                if !near.is_empty() {
                    ghosts.extend(members.iter().filter(meets));
                }
            }
            ghosts.sort_unstable();
            ghosts
        };
        (0..self.ranks()).into_par_iter().map(to).collect()
    }

    /// The hulls of rank `to` to which spheres of this side travel and that some sphere of their hull may meet.
    fn near(&self, from: Side, hull: &Hull, (to, space): (u32, &Space)) -> Vec<Hull> {
        let travels = |other: &&Hull| {
            travels(from, Side { rank: to, class: other.class() }, self.ranks())
                && hull.meets_hull(space, other)
        };
        self.of(to).iter().filter(travels).copied().collect()
    }
}

/// The hulls, each with the places of the bodies in it.
fn members<'a>(bodies: &[Body], hulls: &'a [Hull]) -> Vec<(&'a Hull, Vec<u32>)> {
    let mut place = [None; Class::COUNT];
    for (k, hull) in hulls.iter().enumerate() {
        place[hull.class().index()] = Some(k);
    }
    let mut classes: Vec<_> = hulls.iter().map(|hull| (hull, Vec::new())).collect();
    for (k, body) in (0..).zip(bodies) {
        if let Some(place) = place[body.class().index()] {
            classes[place].1.push(k);
        }
    }
    classes
}
