//! Origins of particles, and arrivals.
//!
//! Ids ascend with time, so a few ranges store all origins. Products of a reaction take the origin with the id,
//! products of a decay that of the decayed particle.

use serde::{Deserialize, Serialize};

/// The release of a particle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Origin {
    pub transmitter: u32,
    /// Step at whose beginning it appeared.
    pub step: u32,
}

/// The removal of a particle by a receiver.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Arrival {
    pub receiver: u32,
    pub species: u32,
    pub id: u32,
    /// Completed steps, including that of the arrival.
    pub step: u32,
    /// `None` for inserted particles.
    pub origin: Option<Origin>,
}

#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Origins {
    /// First ids of ranges, ascending.
    ranges: Vec<(u32, Option<Origin>)>,
}

impl Origins {
    /// Records the origin of ids at or above `first`, which must not be below that of earlier calls.
    pub fn insert(&mut self, first: u32, origin: Option<Origin>) {
        match self.ranges.last_mut() {
            Some(last) if last.0 == first => last.1 = origin,
            Some(last) if last.1 == origin => {}
            _ => self.ranges.push((first, origin)),
        }
    }

    pub fn origin_of(&self, id: u32) -> Option<Origin> {
        let after = self.ranges.partition_point(|&(first, _)| first <= id);
        self.ranges[..after].last().and_then(|&(_, origin)| origin)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn id_determines_its_origin() {
        let from = |transmitter, step| Some(Origin { transmitter, step });
        let mut origins = Origins::default();
        assert_eq!(origins.origin_of(0), None);
        origins.insert(0, from(0, 0));
        origins.insert(10, from(1, 0));
        origins.insert(30, from(0, 7));
        origins.insert(30, from(1, 8));
        origins.insert(40, from(1, 8));
        origins.insert(50, None);
        let ids = [0, 9, 10, 29, 30, 45, 50, u32::MAX];
        let expected = [from(0, 0), from(0, 0), from(1, 0), from(1, 0), from(1, 8), from(1, 8), None, None];
        assert_eq!(ids.map(|id| origins.origin_of(id)), expected);
        assert_eq!(origins.ranges.len(), 4);
    }
}
