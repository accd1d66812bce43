//! Who arrives where, and whose they are.
//!
//! Ids are given in order, so a few ranges of them say where all particles are from. What comes of a particle is from
//! where that was: a product of a reaction is from where the reactant is whose id it takes, and both products of a
//! decay are from where the one before was.

use serde::{Deserialize, Serialize};

/// Where a particle is from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Origin {
    /// The transmitter, by its place in the model.
    pub transmitter: u32,
    /// The step at whose beginning it was released.
    pub step: u32,
}

/// A particle that a receiver removed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Arrival {
    /// The receiver, by its place in the model.
    pub receiver: u32,
    /// The species as which it arrived.
    pub species: u32,
    /// Its id.
    pub id: u32,
    /// Where it is from; none where it was placed by hand.
    pub origin: Option<Origin>,
}

/// Where the particles of a run are from, by id.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Origins {
    /// First ids in ascending order; each entry holds up to the next one.
    ranges: Vec<(u32, Option<Origin>)>,
}

impl Origins {
    /// Says where particles are from that have ids from `first` on, which was not given before.
    pub fn enter(&mut self, first: u32, origin: Option<Origin>) {
        match self.ranges.last_mut() {
            // Nobody has an id of the range before.
            Some(last) if last.0 == first => last.1 = origin,
            Some(last) if last.1 == origin => {}
            _ => self.ranges.push((first, origin)),
        }
    }

    /// Where the particle with this id is from.
    pub fn of(&self, id: u32) -> Option<Origin> {
        let after = self.ranges.partition_point(|&(first, _)| first <= id);
        self.ranges[..after].last().and_then(|&(_, origin)| origin)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_id_says_where_it_is_from() {
        let from = |transmitter, step| Some(Origin { transmitter, step });
        let mut origins = Origins::default();
        assert_eq!(origins.of(0), None);
        origins.enter(0, from(0, 0));
        origins.enter(10, from(1, 0));
        // An empty batch, and one that goes on.
        origins.enter(30, from(0, 7));
        origins.enter(30, from(1, 8));
        origins.enter(40, from(1, 8));
        origins.enter(50, None);
        let ids = [0, 9, 10, 29, 30, 45, 50, u32::MAX];
        let expected = [from(0, 0), from(0, 0), from(1, 0), from(1, 0), from(1, 8), from(1, 8), None, None];
        assert_eq!(ids.map(|id| origins.of(id)), expected);
        assert_eq!(origins.ranges.len(), 4);
    }
}
