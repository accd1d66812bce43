use crate::columns::column_of;
use crate::interval::wilson;
use crate::log::Log;
use crate::mean::RunningStats;
use crate::series::Series;
use crate::symbols::SymbolSlots;
use lazygrid_sim::model::message::{Message, Modulation};
use lazygrid_sim::random::philox::Key;
use lazygrid_sim::{Model, Schedule};

/// The quantity of a slot by which a receiver decides.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SymbolDetector {
    Arrivals,
    /// Largest momentary count.
    Peak,
    /// Sum of the squares of the momentary counts.
    Energy,
    /// Sum of the momentary counts.
    Strength,
}

impl SymbolDetector {
    /// The detectors of receivers with momentary counts.
    pub const MOMENTARY: [Self; 3] = [Self::Peak, Self::Energy, Self::Strength];

    pub fn name(self) -> &'static str {
        match self {
            Self::Arrivals => "arrivals",
            Self::Peak => "peak",
            Self::Energy => "energy",
            Self::Strength => "strength",
        }
    }

    fn value(self, counts: impl Iterator<Item = u64>) -> u64 {
        match self {
            Self::Peak => counts.max().unwrap_or(0),
            Self::Energy => counts.map(|count| count.saturating_mul(count)).fold(0, u64::saturating_add),
            Self::Arrivals | Self::Strength => counts.sum(),
        }
    }
}

#[derive(Clone, Debug, Default)]
pub struct ReplicaFiles {
    pub seed: u64,
    /// Empty if the run logged no arrivals.
    pub log: Log,
    pub series: Series,
}

/// Bit errors at a receiver that observes the sent species in each slot, from any transmitter.
///
/// In on–off and concentration shift keying, a quantity at or above a threshold means the next higher level. In
/// molecule shift keying, the largest quantity decides, the first of equal ones.
#[derive(Clone, Debug, PartialEq)]
pub struct BitErrors {
    pub transmitter: usize,
    pub receiver: usize,
    pub detector: SymbolDetector,
    /// Steps from a symbol to the start of its slot.
    pub delay: u32,
    pub bits: u64,
    pub ones: u64,
    decision: DetectionRule,
    /// Bits per symbol.
    width: u32,
    slots: Vec<Vec<SymbolObservation>>,
}

#[derive(Clone, Debug, PartialEq)]
enum DetectionRule {
    /// Symbols from the lowest level to the highest.
    Level(Vec<u32>),
    Species,
}

/// A sent symbol, and the observed quantity or the detected symbol.
#[derive(Clone, Copy, Debug, PartialEq)]
struct SymbolObservation {
    sent: u32,
    seen: u64,
}

impl BitErrors {
    pub fn new(
        model: &Model,
        message: &Message,
        [transmitter, receiver]: [usize; 2],
        detector: SymbolDetector,
        delay: u32,
    ) -> Self {
        let entries = model.transmitters[transmitter].release.len();
        let decision = match &message.modulation {
            Modulation::OnOff => DetectionRule::Level(vec![0, 1]),
            Modulation::Concentration(levels) => {
                let mut symbols: Vec<u32> = (0..levels.len() as u32).collect();
                symbols.sort_by(|&a, &b| levels[a as usize].total_cmp(&levels[b as usize]));
                DetectionRule::Level(symbols)
            }
            Modulation::Molecule => DetectionRule::Species,
        };
        let width = message.modulation.alphabet(entries).max(1).ilog2();
        Self { transmitter, receiver, detector, delay, bits: 0, ones: 0, decision, width, slots: Vec::new() }
    }

    pub fn add(&mut self, files: &ReplicaFiles, model: &Model, slots: &SymbolSlots) {
        let transmitter = &model.transmitters[self.transmitter];
        let Schedule::Message(message) = &transmitter.schedule else { return };
        let entries = transmitter.release.len();
        let slot = |(k, counts): (usize, Vec<Vec<u64>>)| {
            let sent = message.symbol(k as u32, self.transmitter as u32, Key::new(files.seed));
            let seen = match self.decision {
                DetectionRule::Level(_) => {
                    self.detector.value(counts.iter().map(|entries| entries.iter().sum()))
                }
                DetectionRule::Species => {
                    let observed =
                        |entry: usize| self.detector.value(counts.iter().map(|entries| entries[entry]));
                    (0..entries).rev().max_by_key(|&entry| observed(entry)).unwrap_or(0) as u64
                }
            };
            SymbolObservation { sent, seen }
        };
        // A slot without a row shows not even a 0.
        let is_observed = |(_, rows): &(usize, Vec<Vec<u64>>)| !rows.is_empty();
        let all: Vec<SymbolObservation> = self
            .observed(files, model, slots)
            .into_iter()
            .enumerate()
            .filter(is_observed)
            .map(slot)
            .collect();
        self.bits += all.len() as u64 * u64::from(self.width);
        self.ones += all.iter().map(|slot| u64::from(slot.sent.count_ones())).sum::<u64>();
        self.slots.push(all);
    }

    /// Returns counts by slot, row (one for arrivals) and entry of the burst.
    fn observed(&self, files: &ReplicaFiles, model: &Model, slots: &SymbolSlots) -> Vec<Vec<Vec<u64>>> {
        let release = &model.transmitters[self.transmitter].release;
        if self.detector == SymbolDetector::Arrivals {
            let mut counts = vec![vec![vec![0_u64; release.len()]]; slots.len()];
            for arrival in files.log.arrivals.iter().filter(|arrival| arrival.receiver == self.receiver) {
                let entry = release.iter().position(|&(species, _)| species as usize == arrival.species);
                if let (Some(entry), Some(slot)) = (entry, slots.slot_of_arrival(arrival.step)) {
                    counts[slot][0][entry] += 1;
                }
            }
            return counts;
        }
        let columns: Vec<_> =
            release.iter().map(|&(species, _)| column_of(model, self.receiver, species as usize)).collect();
        let mut counts = vec![Vec::new(); slots.len()];
        for (row, &step) in files.series.steps.iter().enumerate() {
            if let Some(slot) = slots.slot_of_release(step) {
                let count = |column: &Option<usize>| column.map_or(0, |column| files.series.row(row)[column]);
                counts[slot].push(columns.iter().map(count).collect());
            }
        }
        counts
    }

    /// Returns thresholds at which errors may change, and wrong bits; empty unless a single threshold decides.
    pub fn by_threshold(&self) -> Vec<(u64, u64)> {
        let DetectionRule::Level(symbols) = &self.decision else { return Vec::new() };
        let &[low, high] = symbols.as_slice() else { return Vec::new() };
        let mut seen: Vec<SymbolObservation> = self.slots.iter().flatten().copied().collect();
        seen.sort_unstable_by_key(|slot| slot.seen);
        let errors = |slots: &[SymbolObservation], symbol: u32| -> u64 {
            slots.iter().map(|slot| wrong_bits(slot.sent, symbol)).sum()
        };
        let mut wrong = errors(&seen, high);
        let mut all = vec![(0, wrong)];
        for slots in seen.chunk_by(|a, b| a.seen == b.seen) {
            wrong = wrong + errors(slots, low) - errors(slots, high);
            all.push((slots[0].seen + 1, wrong));
        }
        all
    }

    /// Returns the number of replicas with a slot.
    pub fn replicas(&self) -> usize {
        self.slots.iter().filter(|slots| !slots.is_empty()).count()
    }

    pub fn thresholds(&self) -> usize {
        match &self.decision {
            DetectionRule::Level(symbols) => symbols.len() - 1,
            DetectionRule::Species => 0,
        }
    }

    /// Returns the largest observed quantity, if thresholds decide.
    pub fn max_seen(&self) -> u64 {
        self.slots.iter().flatten().map(|slot| slot.seen).max().unwrap_or(0)
    }

    /// Returns the bit error rate over replicas, and the number of wrong bits.
    pub fn at(&self, thresholds: &[u64]) -> (RunningStats, u64) {
        let symbol = |seen: u64| match &self.decision {
            DetectionRule::Level(symbols) => {
                symbols[thresholds.partition_point(|&threshold| threshold <= seen)]
            }
            DetectionRule::Species => seen as u32,
        };
        let (mut rates, mut all) = (RunningStats::default(), 0);
        for slots in self.slots.iter().filter(|slots| !slots.is_empty()) {
            let wrong: u64 = slots.iter().map(|slot| wrong_bits(slot.sent, symbol(slot.seen))).sum();
            rates.add(wrong as f64 / (slots.len() as f64 * f64::from(self.width)));
            all += wrong;
        }
        (rates, all)
    }

    /// Returns the lowest thresholds with the fewest errors.
    pub fn best(&self) -> Vec<u64> {
        let DetectionRule::Level(symbols) = &self.decision else { return Vec::new() };
        let mut seen: Vec<SymbolObservation> = self.slots.iter().flatten().copied().collect();
        seen.sort_unstable_by_key(|slot| slot.seen);
        let numbers: Vec<&[SymbolObservation]> = seen.chunk_by(|a, b| a.seen == b.seen).collect();
        // Fewest errors from a level up, by rank of the quantity.
        let mut fewest = vec![vec![0_u64; symbols.len()]; numbers.len() + 1];
        let errors = |slots: &[SymbolObservation], level: usize| -> u64 {
            slots.iter().map(|slot| wrong_bits(slot.sent, symbols[level])).sum()
        };
        for k in (0..numbers.len()).rev() {
            let mut fewest_errors = u64::MAX;
            for level in (0..symbols.len()).rev() {
                fewest_errors = fewest_errors.min(errors(numbers[k], level) + fewest[k + 1][level]);
                fewest[k][level] = fewest_errors;
            }
        }
        let (mut thresholds, mut now) = (Vec::new(), 0);
        for (k, slots) in numbers.iter().enumerate() {
            let is_best = |&level: &usize| errors(slots, level) + fewest[k + 1][level] == fewest[k][now];
            // The highest level, since thresholds are the lowest.
            let level = (now..symbols.len()).rev().find(is_best).unwrap_or(now);
            let from = k.checked_sub(1).map_or(0, |before| numbers[before][0].seen + 1);
            thresholds.extend((now..level).map(|_| from));
            now = level;
        }
        thresholds.resize(symbols.len() - 1, numbers.last().map_or(0, |last| last[0].seen + 1));
        thresholds
    }

    /// Returns the 95 % interval of the rate, as if errors of bits were independent.
    pub fn interval(&self, wrong: u64) -> [f64; 2] {
        wilson(wrong, self.bits)
    }

    pub fn name(&self, model: &Model) -> String {
        let [from, to] = [&model.transmitters[self.transmitter].name, &model.receivers[self.receiver].name];
        match self.detector {
            SymbolDetector::Arrivals => format!("{from} to {to}"),
            detector => format!("{from} to {to} by {}", detector.name()),
        }
    }

    /// Returns the lowest bit error rate, or NaN without bits.
    pub fn lowest_rate(&self) -> f64 {
        self.at(&self.best()).1 as f64 / self.bits as f64
    }
}

fn wrong_bits(sent: u32, decided: u32) -> u64 {
    (sent ^ decided).count_ones().into()
}

#[cfg(test)]
pub(crate) mod tests;
