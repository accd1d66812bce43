//! Impulse responses: which part of what a transmitter releases arrives how long after its release.

use super::log::Log;
use super::mean::Moments;
use crate::Model;

/// Which particles a response is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Way {
    /// The transmitter, by its place in the model.
    pub transmitter: usize,
    /// The receiver, by its place in the model.
    pub receiver: usize,
    /// The species as which they arrive.
    pub species: usize,
}

impl Way {
    /// All ways of a model on which a receiver takes particles in.
    pub fn all(model: &Model) -> Vec<Self> {
        let mut all = Vec::new();
        for transmitter in 0..model.transmitters.len() {
            for (receiver, own) in model.receivers.iter().enumerate() {
                let seen = (0..model.species.len()).filter(|&species| own.sees[species]);
                all.extend(seen.map(|species| Self { transmitter, receiver, species }));
            }
        }
        all
    }

    /// Returns `true` if a release counts: of the species that arrives, where the transmitter has it, else of any that
    /// may have become it.
    pub(super) fn is_from(self, log: &Log, species: usize) -> bool {
        let own = |s: usize| log.releases.iter().any(|r| r.transmitter == self.transmitter && r.species == s);
        species == self.species || !own(self.species)
    }
}

/// The part of the particles that arrives within each stretch of time after their release.
#[derive(Clone, Debug, PartialEq)]
pub struct Response {
    /// Of whom.
    pub way: Way,
    /// The number of steps of an interval.
    pub width: u32,
    /// Stretch by stretch, over replicas.
    pub parts: Vec<Moments>,
    /// Up to the end of each stretch, over replicas.
    pub so_far: Vec<Moments>,
}

impl Response {
    /// A response without replicas.
    pub fn new(way: Way, width: u32, stretches: usize) -> Self {
        let none = vec![Moments::default(); stretches];
        Self { way, width, parts: none.clone(), so_far: none }
    }

    /// Enters a replica of so many steps. In each stretch those have a part whose release was that long before the
    /// end, or longer.
    pub fn add(&mut self, log: &Log, steps: u32) {
        let Self { way, width, .. } = *self;
        let stretches = self.parts.len();
        let mut released = vec![0_u64; stretches];
        let whole = |step: u32| ((steps.saturating_sub(step)) / width) as usize;
        let own = log.releases.iter().filter(|release| release.transmitter == way.transmitter);
        let is_from: Vec<usize> = {
            let mut species: Vec<usize> = own.clone().map(|release| release.species).collect();
            species.sort_unstable();
            species.dedup();
            species.into_iter().filter(|&species| way.is_from(log, species)).collect()
        };
        for release in own.filter(|release| is_from.contains(&release.species)) {
            released[..whole(release.step).min(stretches)].iter_mut().for_each(|n| *n += release.count);
        }
        let mut arrived = vec![0_u64; stretches];
        for arrival in &log.arrivals {
            let Some((transmitter, step)) = arrival.origin else { continue };
            let at = (arrival.step.saturating_sub(step).saturating_sub(1) / width) as usize;
            let is_own = (transmitter, arrival.receiver, arrival.species)
                == (way.transmitter, way.receiver, way.species);
            if is_own && at < stretches.min(whole(step)) {
                arrived[at] += 1;
            }
        }
        let mut sum = 0.0;
        for k in 0..stretches {
            if released[k] > 0 {
                let part = arrived[k] as f64 / released[k] as f64;
                sum += part;
                self.parts[k].add(part);
                self.so_far[k].add(sum);
            }
        }
    }

    /// Returns `true` if anybody arrives.
    pub fn is_any(&self) -> bool {
        self.parts.iter().any(|part| part.mean() > 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::log::{Arrived, Released};

    const WAY: Way = Way { transmitter: 0, receiver: 0, species: 0 };

    fn released(step: u32, count: u64) -> Released {
        Released { step, transmitter: 0, species: 0, count }
    }

    fn arrived(step: u32, from: u32) -> Arrived {
        Arrived { step, receiver: 0, species: 0, origin: Some((0, from)) }
    }

    #[test]
    fn parts_are_of_those_who_had_the_time() {
        // Ten at the beginning and ten more after 8 steps of 12, in stretches of 4 steps.
        let log = Log {
            arrivals: vec![arrived(1, 0), arrived(4, 0), arrived(5, 0), arrived(12, 0), arrived(12, 8)],
            releases: vec![released(0, 10), released(8, 10)],
        };
        let mut response = Response::new(WAY, 4, 4);
        response.add(&log, 12);
        let parts: Vec<f64> = response.parts.iter().map(Moments::mean).collect();
        // 3 of 20 in the first stretch, of which the second burst sees no more; then 1 of 10 each.
        assert_eq!(parts[..3], [0.15, 0.1, 0.1]);
        assert!(parts[3].is_nan(), "nobody had 16 steps");
        let so_far: Vec<f64> = response.so_far.iter().map(Moments::mean).collect();
        assert!((so_far[2] - 0.35).abs() < 1e-12);
        // Another replica in which nobody arrives.
        response.add(&Log { arrivals: vec![], ..log.clone() }, 12);
        assert_eq!((response.parts[0].mean(), response.parts[0].standard_error()), (0.075, Some(0.075)));
        // Others have nothing to do with it.
        let mut other = Response::new(Way { receiver: 1, ..WAY }, 4, 4);
        other.add(&log, 12);
        assert!(response.is_any() && !other.is_any());
    }

    #[test]
    fn what_became_another_species_is_a_part_of_what_it_was() {
        let log =
            Log { arrivals: vec![Arrived { species: 1, ..arrived(2, 0) }], releases: vec![released(0, 4)] };
        let mut response = Response::new(Way { species: 1, ..WAY }, 4, 1);
        response.add(&log, 4);
        assert_eq!(response.parts[0].mean(), 0.25);
    }
}
