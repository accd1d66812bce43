use crate::log::Log;
use crate::mean::RunningStats;
use crate::response::{Link, SourceSpecies};
use lazygrid_sim::model::message::Message;
use lazygrid_sim::model::time::step_of;
use lazygrid_sim::{Model, Schedule};

/// The complete slots of a message, with a delay.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SymbolSlots {
    /// First step of each slot, and the end of the last.
    pub(crate) bounds: Vec<u32>,
}

impl SymbolSlots {
    /// Returns the slots that begin `delay` steps after the symbols.
    pub fn new(message: &Message, time_step: f64, delay: u32, steps: u32) -> Self {
        let begin = |k: u32| step_of(message.time_of(k), time_step).unwrap_or(u32::MAX).saturating_add(delay);
        let bounds = (0..=message.symbols.len()).map(begin).take_while(|&step| step <= steps).collect();
        Self { bounds }
    }

    pub fn len(&self) -> usize {
        self.bounds.len().saturating_sub(1)
    }

    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the slot of a release or a row. Momentary counts include the releases of their step, so the row at a
    /// slot's end belongs to the next one.
    pub(crate) fn slot_of_release(&self, step: u32) -> Option<usize> {
        let after = self.bounds.partition_point(|&begin| begin <= step);
        (1..=self.len()).contains(&after).then(|| after - 1)
    }

    /// Returns the slot of an arrival, whose step ends at `step`.
    pub(crate) fn slot_of_arrival(&self, step: u32) -> Option<usize> {
        self.slot_of_release(step.checked_sub(1)?)
    }
}

pub fn messages(model: &Model) -> impl Iterator<Item = (usize, &Message)> {
    model.transmitters.iter().enumerate().filter_map(|(index, transmitter)| match &transmitter.schedule {
        Schedule::Message(message) => Some((index, message)),
        _ => None,
    })
}

/// The fraction of a symbol's particles that arrives, or is inside on average, in its own slot and each later one.
#[derive(Clone, Debug, PartialEq)]
pub struct Interference {
    pub link: Link,
    from: SourceSpecies,
    /// Indexed by the number of slots since the symbol's own.
    pub by_lag: Vec<RunningStats>,
    /// Fraction of a symbol's arrivals after its own slot.
    pub late: RunningStats,
}

impl Interference {
    pub fn new(link: Link, from: SourceSpecies, lags: usize) -> Self {
        Self { link, from, by_lag: vec![RunningStats::default(); lags], late: RunningStats::default() }
    }

    /// Adds a replica. Symbols contribute only to lags whose slots are complete.
    pub fn add(&mut self, log: &Log, slots: &SymbolSlots) {
        let (link, lags) = (self.link, self.by_lag.len());
        let released = released(link, self.from, log, slots);
        let mut arrived = vec![0_u64; lags];
        for arrival in &log.arrivals {
            let Some((transmitter, step)) = arrival.origin else { continue };
            let is_own = (transmitter, arrival.receiver, arrival.species)
                == (link.transmitter, link.receiver, link.species);
            if let (true, Some(from), Some(to)) =
                (is_own, slots.slot_of_release(step), slots.slot_of_arrival(arrival.step))
                && let Some(count) = to.checked_sub(from).and_then(|lag| arrived.get_mut(lag))
            {
                *count += 1;
            }
        }
        let seen = |lag: usize| released[..slots.len().saturating_sub(lag)].iter().sum::<u64>();
        self.add_fractions(arrived.into_iter().enumerate().map(|(lag, arrived)| (arrived, seen(lag))));
    }

    /// Adds a replica: the mean fraction inside in the `rows` (steps) of a slot.
    pub fn add_momentary(&mut self, log: &Log, rows: &[u32], slots: &SymbolSlots) {
        let (link, lags) = (self.link, self.by_lag.len());
        let released = released(link, self.from, log, slots);
        let (mut inside, mut seen) = (vec![0_u64; lags], vec![0_u64; lags]);
        for slot in rows.iter().filter_map(|&step| slots.slot_of_release(step)) {
            (0..lags.min(slot + 1)).for_each(|lag| seen[lag] += released[slot - lag]);
        }
        for inside_count in &log.inside {
            let Some((transmitter, step)) = inside_count.origin else { continue };
            if link == (Link { transmitter, receiver: inside_count.receiver, species: inside_count.species })
                && let (Some(from), Some(to)) =
                    (slots.slot_of_release(step), slots.slot_of_release(inside_count.step))
                && let Some(count) = to.checked_sub(from).and_then(|lag| inside.get_mut(lag))
            {
                *count += inside_count.count;
            }
        }
        self.add_fractions(inside.into_iter().zip(seen));
    }

    fn add_fractions(&mut self, counts: impl Iterator<Item = (u64, u64)>) {
        // Without a sample of own slots, the late fraction is unknown.
        let (mut own_fraction, mut late) = (None, 0.0);
        for (lag, (count, seen)) in counts.enumerate().filter(|(_, (_, seen))| *seen > 0) {
            let fraction = count as f64 / seen as f64;
            self.by_lag[lag].add(fraction);
            match lag {
                0 => own_fraction = Some(fraction),
                _ => late += fraction,
            }
        }
        if let Some(own_fraction) = own_fraction.filter(|own_fraction| own_fraction + late > 0.0) {
            self.late.add(late / (own_fraction + late));
        }
    }
}

fn released(link: Link, from: SourceSpecies, log: &Log, slots: &SymbolSlots) -> Vec<u64> {
    let mut released = vec![0_u64; slots.len()];
    for release in link.releases(log, from) {
        if let Some(slot) = slots.slot_of_release(release.step) {
            released[slot] += release.count;
        }
    }
    released
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::log::{LoggedArrival, LoggedCount, LoggedRelease};
    use lazygrid_sim::model::message::{Modulation, Symbols};
    use lazygrid_sim::{Receiver, ReceiverKind, Species, Transmitter};

    pub(crate) fn model() -> Model {
        let message = Message {
            start: 0.5,
            symbol_time: 1.0,
            symbols: Symbols::Given(vec![1, 0, 1, 1]),
            modulation: Modulation::OnOff,
        };
        Model {
            time_step: 0.1,
            species: vec![Species { name: "A".into(), ..Species::default() }],
            transmitters: vec![Transmitter {
                schedule: Schedule::Message(message),
                release: vec![(0, 10)],
                ..Transmitter::default()
            }],
            receivers: vec![Receiver {
                name: "rx".into(),
                center: [0.0; 3],
                radius: 1.0,
                kind: ReceiverKind::Absorbing,
                sees: vec![true],
                ..Receiver::default()
            }],
            ..Model::default()
        }
    }

    /// Arrivals by slot of the symbol and slot of arrival.
    pub(crate) fn log(arrivals: &[(usize, usize, usize)]) -> Log {
        let begin = |slot: usize| 5 + 10 * slot as u32;
        let arrived = |&(from, to, count): &(usize, usize, usize)| {
            // The first and the last step of a slot are its own.
            let step = move |k: usize| begin(to) + [1, 10][k % 2];
            let origin = Some((0, begin(from)));
            (0..count).map(move |k| LoggedArrival { step: step(k), receiver: 0, species: 0, origin })
        };
        let released = |slot| LoggedRelease { step: begin(slot), transmitter: 0, species: 0, count: 10 };
        Log {
            arrivals: arrivals.iter().flat_map(arrived).collect(),
            releases: [0, 2, 3].map(released).to_vec(),
            inside: Vec::new(),
        }
    }

    const LINK: Link = Link { transmitter: 0, receiver: 0, species: 0 };

    pub(crate) fn slots(steps: u32) -> SymbolSlots {
        let model = model();
        let (_, message) = messages(&model).next().unwrap();
        SymbolSlots::new(message, model.time_step, 0, steps)
    }

    #[test]
    fn slots_end_with_the_run() {
        assert_eq!(slots(100).bounds, [5, 15, 25, 35, 45]);
        assert_eq!((slots(44).len(), slots(45).len(), slots(4).len()), (3, 4, 0));
        assert!(slots(14).is_empty());
        let slots = slots(100);
        assert_eq!(
            [4, 5, 14, 15, 44, 45].map(|step| slots.slot_of_release(step)),
            [None, Some(0), Some(0), Some(1), Some(3), None]
        );
        assert_eq!(
            [5, 6, 15, 16, 45, 46].map(|step| slots.slot_of_arrival(step)),
            [None, Some(0), Some(0), Some(1), Some(3), None]
        );
    }

    #[test]
    fn interference_inside_is_a_mean_over_rows() {
        let rows = [10, 15, 20, 25, 30, 35, 40, 45];
        let inside =
            |step, from, count| LoggedCount { step, receiver: 0, species: 0, origin: Some((0, from)), count };
        let log = Log {
            inside: vec![
                inside(10, 5, 6),
                inside(20, 5, 3),
                inside(25, 5, 1),
                inside(30, 5, 2),
                inside(40, 35, 4),
            ],
            ..log(&[])
        };
        let mut interference = Interference::new(LINK, SourceSpecies::Arriving, 3);
        interference.add_momentary(&log, &rows, &slots(100));
        let fractions: Vec<f64> = interference.by_lag.iter().map(RunningStats::mean).collect();
        // Bursts of 10: five rows in their own slots, four in the next, two in the one after.
        assert_eq!(fractions, [10.0 / 50.0, 3.0 / 40.0, 3.0 / 20.0]);
    }

    #[test]
    fn late_fraction_needs_a_sample_of_own_slots() {
        // Rows in the second slot only, after a burst of 10 in the first.
        let one = LoggedCount { step: 20, receiver: 0, species: 0, origin: Some((0, 5)), count: 4 };
        let log = Log { inside: vec![one], ..log(&[]) };
        let mut interference = Interference::new(LINK, SourceSpecies::Arriving, 2);
        interference.add_momentary(&log, &[20], &slots(100));
        assert_eq!((interference.by_lag[0].count(), interference.by_lag[1].mean()), (0, 0.4));
        assert_eq!(interference.late.count(), 0);
    }

    #[test]
    fn burst_at_a_row_is_in_its_own_slot() {
        let one = |step| LoggedCount { step, receiver: 0, species: 0, origin: Some((0, step)), count: 10 };
        let log = Log { inside: [5, 25, 35].map(one).to_vec(), ..log(&[]) };
        let mut interference = Interference::new(LINK, SourceSpecies::Arriving, 2);
        interference.add_momentary(&log, &[5, 15, 25, 35, 45], &slots(100));
        assert_eq!([0, 1].map(|lag| interference.by_lag[lag].mean()), [1.0, 0.0]);
    }

    #[test]
    fn interference_counts_slots_from_the_release() {
        let log = log(&[(0, 0, 6), (0, 1, 2), (0, 2, 1), (2, 2, 4), (2, 3, 1), (3, 3, 5)]);
        let mut interference = Interference::new(LINK, SourceSpecies::Arriving, 4);
        interference.add(&log, &slots(100));
        let fractions: Vec<f64> = interference.by_lag.iter().map(RunningStats::mean).collect();
        assert_eq!(fractions, [15.0 / 30.0, 3.0 / 20.0, 1.0 / 10.0, 0.0]);
        assert!((interference.late.mean() - 0.25 / 0.75).abs() < 1e-12);
    }
}
