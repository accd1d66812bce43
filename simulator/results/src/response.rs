use crate::log::{Log, LoggedRelease};
use crate::mean::RunningStats;
use lazygrid_sim::Model;

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Link {
    pub transmitter: usize,
    pub receiver: usize,
    /// Species on arrival.
    pub species: usize,
}

impl Link {
    pub fn all(model: &Model) -> Vec<Self> {
        let mut all = Vec::new();
        for transmitter in 0..model.transmitters.len() {
            for (receiver, model_receiver) in model.receivers.iter().enumerate() {
                let seen = (0..model.species.len()).filter(|&species| model_receiver.sees[species]);
                all.extend(seen.map(|species| Self { transmitter, receiver, species }));
            }
        }
        all
    }

    /// Returns the released species to which arrivals are compared.
    pub fn source(self, model: &Model) -> SourceSpecies {
        let mut released = model.transmitters[self.transmitter].species();
        match released.any(|species| species as usize == self.species) {
            true => SourceSpecies::Arriving,
            false => SourceSpecies::Any,
        }
    }

    pub(crate) fn releases(self, log: &Log, from: SourceSpecies) -> impl Iterator<Item = &LoggedRelease> {
        let is_from = move |release: &&LoggedRelease| {
            release.transmitter == self.transmitter
                && (from == SourceSpecies::Any || release.species == self.species)
        };
        log.releases.iter().filter(is_from)
    }
}

/// The released species of a link. A replica without a release of it adds no sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SourceSpecies {
    /// The transmitter releases the arriving species.
    Arriving,
    /// The arriving species is a product.
    Any,
}

/// The fraction of particles that arrives, or is inside, in each bin after their release.
#[derive(Clone, Debug, PartialEq)]
pub struct Response {
    pub link: Link,
    from: SourceSpecies,
    /// Steps per bin.
    pub width: u32,
    /// Fraction in each bin.
    pub fractions: Vec<RunningStats>,
    /// Fraction up to the end of each bin; empty for momentary counts.
    pub cumulative: Vec<RunningStats>,
}

impl Response {
    pub fn new(link: Link, from: SourceSpecies, width: u32, bins: usize) -> Self {
        let none = vec![RunningStats::default(); bins];
        Self { link, from, width, fractions: none.clone(), cumulative: none }
    }

    /// Adds a replica with these `rows` (steps). A bin's fraction inside is the mean over its rows.
    pub fn add_momentary(&mut self, log: &Log, rows: &[u32]) {
        self.cumulative.clear();
        let Self { link, from, width, .. } = *self;
        let bins = self.fractions.len();
        let (mut released, mut inside) = (vec![0_u64; bins], vec![0_u64; bins]);
        let bin = |step: u32, from: u32| ((step - from) / width) as usize;
        for release in link.releases(log, from) {
            let after =
                rows.iter().filter(|&&step| step >= release.step).map(|&step| bin(step, release.step));
            after.take_while(|&at| at < bins).for_each(|at| released[at] += release.count);
        }
        for inside_count in &log.inside {
            let Some((transmitter, step)) = inside_count.origin else { continue };
            if link == (Link { transmitter, receiver: inside_count.receiver, species: inside_count.species })
                && let Some(count) = inside.get_mut(bin(inside_count.step, step))
            {
                *count += inside_count.count;
            }
        }
        let all = self.fractions.iter_mut().zip(inside.iter().zip(&released));
        all.filter(|(_, (_, released))| **released > 0)
            .for_each(|(fraction, (inside, released))| fraction.add(*inside as f64 / *released as f64));
    }

    /// Adds a replica. Releases contribute only to bins that end within `steps`.
    pub fn add(&mut self, log: &Log, steps: u32) {
        let Self { link, from, width, .. } = *self;
        let bins = self.fractions.len();
        let mut released = vec![0_u64; bins];
        let whole = |step: u32| ((steps.saturating_sub(step)) / width) as usize;
        for release in link.releases(log, from) {
            released[..whole(release.step).min(bins)].iter_mut().for_each(|n| *n += release.count);
        }
        let mut arrived = vec![0_u64; bins];
        for arrival in &log.arrivals {
            let Some((transmitter, step)) = arrival.origin else { continue };
            let at = (arrival.step.saturating_sub(step).saturating_sub(1) / width) as usize;
            let is_own = (transmitter, arrival.receiver, arrival.species)
                == (link.transmitter, link.receiver, link.species);
            if is_own && at < bins.min(whole(step)) {
                arrived[at] += 1;
            }
        }
        let mut sum = 0.0;
        for k in 0..bins {
            if released[k] > 0 {
                let fraction = arrived[k] as f64 / released[k] as f64;
                sum += fraction;
                self.fractions[k].add(fraction);
                self.cumulative[k].add(sum);
            }
        }
    }

    pub fn is_any(&self) -> bool {
        self.fractions.iter().any(|fraction| fraction.mean() > 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::{LoggedArrival, LoggedCount};

    const LINK: Link = Link { transmitter: 0, receiver: 0, species: 0 };
    const ARRIVING: SourceSpecies = SourceSpecies::Arriving;

    fn released(step: u32, count: u64) -> LoggedRelease {
        LoggedRelease { step, transmitter: 0, species: 0, count }
    }

    fn arrived(step: u32, from: u32) -> LoggedArrival {
        LoggedArrival { step, receiver: 0, species: 0, origin: Some((0, from)) }
    }

    #[test]
    fn fractions_are_of_the_releases_with_a_complete_window() {
        let log = Log {
            arrivals: vec![arrived(1, 0), arrived(4, 0), arrived(5, 0), arrived(12, 0), arrived(12, 8)],
            releases: vec![released(0, 10), released(8, 10)],
            inside: vec![],
        };
        let mut response = Response::new(LINK, ARRIVING, 4, 4);
        response.add(&log, 12);
        let fractions: Vec<f64> = response.fractions.iter().map(RunningStats::mean).collect();
        assert_eq!(fractions[..3], [0.15, 0.1, 0.1]);
        assert!(fractions[3].is_nan(), "no release had 16 steps");
        let cumulative: Vec<f64> = response.cumulative.iter().map(RunningStats::mean).collect();
        assert!((cumulative[2] - 0.35).abs() < 1e-12);
        response.add(&Log { arrivals: vec![], ..log.clone() }, 12);
        assert_eq!(
            (response.fractions[0].mean(), response.fractions[0].standard_error()),
            (0.075, Some(0.075))
        );
        let mut other = Response::new(Link { receiver: 1, ..LINK }, ARRIVING, 4, 4);
        other.add(&log, 12);
        assert!(response.is_any() && !other.is_any());
    }

    #[test]
    fn fraction_inside_is_a_mean_over_rows() {
        let inside =
            |step, from, count| LoggedCount { step, receiver: 0, species: 0, origin: Some((0, from)), count };
        let log = Log {
            inside: vec![
                inside(2, 0, 4),
                inside(4, 0, 2),
                inside(6, 0, 3),
                inside(10, 8, 5),
                inside(12, 8, 1),
            ],
            releases: vec![released(0, 10), released(8, 10)],
            ..Log::default()
        };
        let mut response = Response::new(LINK, ARRIVING, 4, 3);
        response.add_momentary(&log, &[0, 2, 4, 6, 8, 10, 12]);
        let fractions: Vec<f64> = response.fractions.iter().map(RunningStats::mean).collect();
        // Rows at 0, 2, 8, 10: 4 + 5 of 40; at 4, 6, 12: 2 + 3 + 1 of 30; at 8, 10: none of 20.
        assert_eq!(fractions, [9.0 / 40.0, 6.0 / 30.0, 0.0]);
        assert!(response.cumulative.is_empty());
    }

    #[test]
    fn replicas_without_a_release_of_the_species_add_no_sample() {
        let log = Log { releases: vec![LoggedRelease { species: 1, ..released(0, 4) }], ..Log::default() };
        let mut response = Response::new(LINK, ARRIVING, 4, 1);
        response.add(&log, 4);
        response.add_momentary(&log, &[0]);
        assert_eq!(response.fractions[0].count(), 0);
    }

    #[test]
    fn sources_of_links_follow_from_the_model() {
        let model = crate::symbols::tests::model();
        assert_eq!(LINK.source(&model), SourceSpecies::Arriving);
        assert_eq!(Link { species: 1, ..LINK }.source(&model), SourceSpecies::Any);
    }

    #[test]
    fn arrivals_after_a_reaction_count_for_the_released_species() {
        let log = Log {
            arrivals: vec![LoggedArrival { species: 1, ..arrived(2, 0) }],
            releases: vec![released(0, 4)],
            ..Log::default()
        };
        let mut response = Response::new(Link { species: 1, ..LINK }, SourceSpecies::Any, 4, 1);
        response.add(&log, 4);
        assert_eq!(response.fractions[0].mean(), 0.25);
    }
}
