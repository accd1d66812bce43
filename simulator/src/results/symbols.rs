//! What becomes of symbols: how much of one arrives during later ones, and how often a receiver that counts takes one
//! for another.

use super::log::Log;
use super::mean::Moments;
use super::response::Way;
use crate::instant::step_of;
use crate::message::{Message, Modulation};
use crate::philox::Key;
use crate::{Model, Schedule};

/// The slots of a message that a run reaches the end of: from the step at which each symbol is sent to that of the next,
/// or by a delay later.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Slots {
    /// The steps at which slots begin, and that at which the last one ends.
    bounds: Vec<u32>,
}

impl Slots {
    /// The slots of a message that begin so many steps after its symbols, in a run of `steps`.
    pub fn new(message: &Message, time_step: f64, delay: u32, steps: u32) -> Self {
        let begin = |k: u32| step_of(message.time_of(k), time_step).unwrap_or(u32::MAX).saturating_add(delay);
        let bounds = (0..=message.symbols.len()).map(begin).take_while(|&step| step <= steps).collect();
        Self { bounds }
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.bounds.len().saturating_sub(1)
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// In which slot a symbol is that is released after so many steps.
    fn of_release(&self, step: u32) -> Option<usize> {
        let after = self.bounds.partition_point(|&begin| begin <= step);
        (1..=self.len()).contains(&after).then(|| after - 1)
    }

    /// In which slot a particle arrives in the step that ends after so many.
    fn of_arrival(&self, step: u32) -> Option<usize> {
        self.of_release(step.checked_sub(1)?)
    }
}

/// The transmitters of a model that send messages.
pub fn messages(model: &Model) -> impl Iterator<Item = (usize, &Message)> {
    model.transmitters.iter().enumerate().filter_map(|(place, transmitter)| match &transmitter.schedule {
        Schedule::Message(message) => Some((place, message)),
        _ => None,
    })
}

/// Inter-symbol interference: the part of a symbol's particles that arrives in its own slot, in the next one, and so
/// on, over replicas.
#[derive(Clone, Debug, PartialEq)]
pub struct Interference {
    /// Of whom.
    pub way: Way,
    /// By the number of slots from the release to the arrival.
    pub by_lag: Vec<Moments>,
    /// Of those that arrive within these slots, the part that comes behind its own.
    pub late: Moments,
}

impl Interference {
    /// None yet, up to so many slots.
    pub fn new(way: Way, lags: usize) -> Self {
        Self { way, by_lag: vec![Moments::default(); lags], late: Moments::default() }
    }

    /// Enters a replica. A lag is seen by the symbols after which there are that many slots.
    pub fn add(&mut self, log: &Log, slots: &Slots) {
        let (way, lags) = (self.way, self.by_lag.len());
        let mut released = vec![0_u64; slots.len()];
        for release in log.releases.iter().filter(|r| r.transmitter == way.transmitter) {
            if let Some(slot) = slots.of_release(release.step)
                && way.is_from(log, release.species)
            {
                released[slot] += release.count;
            }
        }
        let mut arrived = vec![0_u64; lags];
        for arrival in &log.arrivals {
            let Some((transmitter, step)) = arrival.origin else { continue };
            let is_own = (transmitter, arrival.receiver, arrival.species)
                == (way.transmitter, way.receiver, way.species);
            if let (true, Some(from), Some(to)) =
                (is_own, slots.of_release(step), slots.of_arrival(arrival.step))
                && to - from < lags
            {
                arrived[to - from] += 1;
            }
        }
        let mut parts = Vec::new();
        for (lag, arrived) in arrived.into_iter().enumerate() {
            let seen: u64 = released[..slots.len().saturating_sub(lag)].iter().sum();
            if seen > 0 {
                parts.push(arrived as f64 / seen as f64);
                self.by_lag[lag].add(arrived as f64 / seen as f64);
            }
        }
        let all: f64 = parts.iter().sum();
        if all > 0.0 {
            self.late.add(parts[1..].iter().sum::<f64>() / all);
        }
    }
}

/// Bit errors of on–off keying at a receiver that counts what arrives in each slot, of the species that are sent, and
/// takes it for 1 from a threshold on.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BitErrors {
    /// The transmitter, by its place in the model.
    pub transmitter: usize,
    /// The receiver, by its place in the model.
    pub receiver: usize,
    /// How many steps after a symbol its slot begins.
    pub delay: u32,
    /// How many bits there were in all.
    pub bits: u64,
    /// How many of them were 1.
    pub ones: u64,
    /// Replica by replica: what was sent, and how many arrived.
    slots: Vec<Vec<(bool, u64)>>,
}

impl BitErrors {
    /// None yet. Only what is sent by on–off keying has bits, and only receivers that take particles in count arrivals.
    pub fn new(transmitter: usize, receiver: usize, delay: u32) -> Self {
        Self { transmitter, receiver, delay, ..Self::default() }
    }

    /// Enters a replica that had this seed, with the slots of this delay.
    pub fn add(&mut self, log: &Log, model: &Model, seed: u64, slots: &Slots) {
        let transmitter = &model.transmitters[self.transmitter];
        let Schedule::Message(message) = &transmitter.schedule else { return };
        let bit = |k: usize| message.symbol(k as u32, self.transmitter as u32, Key::new(seed)) == 1;
        let mut all: Vec<(bool, u64)> = (0..slots.len()).map(|k| (bit(k), 0)).collect();
        let is_sent = |species: usize| transmitter.release.iter().any(|&(own, _)| own as usize == species);
        for arrival in log.arrivals.iter().filter(|a| a.receiver == self.receiver && is_sent(a.species)) {
            if let Some(slot) = slots.of_arrival(arrival.step) {
                all[slot].1 += 1;
            }
        }
        self.bits += all.len() as u64;
        self.ones += all.iter().filter(|slot| slot.0).count() as u64;
        self.slots.push(all);
    }

    /// The largest number of arrivals in a slot.
    pub fn most(&self) -> u64 {
        self.slots.iter().flatten().map(|slot| slot.1).max().unwrap_or(0)
    }

    /// The part of the bits that is wrong where 1 begins at a threshold, over replicas, and the number of those.
    pub fn at(&self, threshold: u64) -> (Moments, u64) {
        let (mut rates, mut all) = (Moments::default(), 0);
        for slots in self.slots.iter().filter(|slots| !slots.is_empty()) {
            let wrong = slots.iter().filter(|&&(bit, count)| (count >= threshold) != bit).count();
            rates.add(wrong as f64 / slots.len() as f64);
            all += wrong as u64;
        }
        (rates, all)
    }

    /// The lowest threshold with the fewest errors.
    pub fn best(&self) -> u64 {
        (0..=self.most() + 1).min_by_key(|&threshold| self.at(threshold).1).unwrap_or(0)
    }

    /// The part of all bits that is wrong at that threshold; NaN of none.
    pub fn least(&self) -> f64 {
        self.at(self.best()).1 as f64 / self.bits as f64
    }
}

/// Whether a message consists of bits, one for each symbol.
pub fn is_on_off(message: &Message) -> bool {
    message.modulation == Modulation::OnOff
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message::Symbols;
    use crate::results::log::{Arrived, Released};
    use crate::{Kind, Receiver, Species, Transmitter};

    /// The bits 1, 0, 1, 1, one every 10 steps from step 5 on.
    fn model() -> Model {
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
                kind: Kind::Absorbing,
                sees: vec![true],
                velocity: [0.0; 3],
                diffusion: 0.0,
            }],
            ..Model::default()
        }
    }

    /// So many arrivals in each slot of each symbol.
    fn log(arrivals: &[(usize, usize, usize)]) -> Log {
        let begin = |slot: usize| 5 + 10 * slot as u32;
        let arrived = |&(from, to, count): &(usize, usize, usize)| {
            // The first and the last step of a slot are its own.
            let step = move |k: usize| begin(to) + [1, 10][k % 2];
            let origin = Some((0, begin(from)));
            (0..count).map(move |k| Arrived { step: step(k), receiver: 0, species: 0, origin })
        };
        let released = |slot| Released { step: begin(slot), transmitter: 0, species: 0, count: 10 };
        Log {
            arrivals: arrivals.iter().flat_map(arrived).collect(),
            releases: [0, 2, 3].map(released).to_vec(),
        }
    }

    fn slots(steps: u32) -> Slots {
        let model = model();
        let (_, message) = messages(&model).next().unwrap();
        Slots::new(message, model.time_step, 0, steps)
    }

    #[test]
    fn slots_end_with_the_run() {
        assert_eq!(slots(100).bounds, [5, 15, 25, 35, 45]);
        assert_eq!((slots(44).len(), slots(45).len(), slots(4).len()), (3, 4, 0));
        assert!(slots(14).is_empty());
        let slots = slots(100);
        assert_eq!(
            [4, 5, 14, 15, 44, 45].map(|step| slots.of_release(step)),
            [None, Some(0), Some(0), Some(1), Some(3), None]
        );
        assert_eq!(
            [5, 6, 15, 16, 45, 46].map(|step| slots.of_arrival(step)),
            [None, Some(0), Some(0), Some(1), Some(3), None]
        );
    }

    #[test]
    fn interference_goes_by_slots_from_the_release() {
        // Of 10 each: 6, 4, 5 in their own slots, 2 and 1 in the next ones, 1 after that.
        let log = log(&[(0, 0, 6), (0, 1, 2), (0, 2, 1), (2, 2, 4), (2, 3, 1), (3, 3, 5)]);
        let way = Way { transmitter: 0, receiver: 0, species: 0 };
        let mut interference = Interference::new(way, 4);
        interference.add(&log, &slots(100));
        let parts: Vec<f64> = interference.by_lag.iter().map(Moments::mean).collect();
        // All three have an own slot, the last one has none behind it, and the first alone has more than two.
        assert_eq!(parts, [15.0 / 30.0, 3.0 / 20.0, 1.0 / 10.0, 0.0]);
        assert!((interference.late.mean() - 0.25 / 0.75).abs() < 1e-12);
    }

    #[test]
    fn bit_errors_of_a_known_sequence() {
        // 1 0 1 1 arrives as 6, 3, 4, 2.
        let log = log(&[(0, 0, 6), (0, 1, 3), (2, 2, 4), (3, 3, 2)]);
        let mut errors = BitErrors::new(0, 0, 0);
        errors.add(&log, &model(), 1, &slots(100));
        let counts: Vec<u64> = (0..=7).map(|threshold| errors.at(threshold).1).collect();
        // 0 is taken for 1 up to a threshold of 3; then the last 1 for 0, the middle one from 5 on, the first from 7 on.
        assert_eq!(counts, [1, 1, 1, 2, 1, 2, 2, 3]);
        assert_eq!((errors.bits, errors.ones, errors.most(), errors.best()), (4, 3, 6, 0));
        // Another replica in which nothing is late has a best threshold without errors of its own.
        errors.add(&self::log(&[(0, 0, 6), (2, 2, 4), (3, 3, 5)]), &model(), 2, &slots(100));
        let (rates, all) = errors.at(4);
        assert_eq!((rates.mean(), rates.standard_error(), all), (0.125, Some(0.125), 1));
        assert_eq!(errors.best(), 1);
    }

    #[test]
    fn a_delay_moves_the_slots_of_bits() {
        let model = model();
        let (_, message) = messages(&model).next().unwrap();
        let late = Slots::new(message, model.time_step, 10, 100);
        assert_eq!(late.bounds, [15, 25, 35, 45, 55]);
        // All arrive one slot after their own.
        let mut errors = BitErrors::new(0, 0, 10);
        errors.add(&log(&[(0, 1, 6), (2, 3, 4)]), &model, 1, &late);
        // The last 1 arrives behind everything.
        assert_eq!((errors.at(1).1, errors.at(5).1, errors.at(0).1, errors.least()), (1, 2, 1, 0.25));
    }
}
