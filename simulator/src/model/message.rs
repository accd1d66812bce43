use crate::model::time::step_of;
use crate::random::philox::{Key, Purpose};

#[derive(Clone, Debug, PartialEq)]
pub struct Message {
    /// In s.
    pub start: f64,
    /// In s.
    pub symbol_time: f64,
    pub symbols: Symbols,
    pub modulation: Modulation,
}

/// The symbols of a message, from 0.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Symbols {
    Given(Vec<u32>),
    /// Uniformly random, by the seed of the run.
    Random {
        count: u32,
        /// Distinct symbols, a power of two.
        alphabet: u32,
    },
}

impl Symbols {
    pub fn len(&self) -> u32 {
        match self {
            Self::Given(symbols) => symbols.len() as u32,
            Self::Random { count, .. } => *count,
        }
    }

    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

#[derive(Clone, Debug, PartialEq)]
pub enum Modulation {
    /// On–off keying: 1 sends a burst, 0 nothing.
    OnOff,
    /// Concentration shift keying: a factor of the burst for each symbol.
    Concentration(Vec<f64>),
    /// Molecule shift keying: an entry of the burst for each symbol.
    Molecule,
}

impl Modulation {
    pub fn alphabet(&self, entries: usize) -> usize {
        match self {
            Self::OnOff => 2,
            Self::Concentration(levels) => levels.len(),
            Self::Molecule => entries,
        }
    }

    pub fn burst(&self, symbol: u32, release: &[(u32, u32)]) -> Vec<(u32, u32)> {
        match self {
            Self::OnOff => {
                if symbol == 0 {
                    Vec::new()
                } else {
                    release.to_vec()
                }
            }
            Self::Concentration(levels) => {
                let level = levels.get(symbol as usize).copied().unwrap_or(0.0);
                release
                    .iter()
                    .map(|&(species, count)| (species, (level * f64::from(count)).round() as u32))
                    .collect()
            }
            Self::Molecule => release.get(symbol as usize).copied().into_iter().collect(),
        }
    }

    pub(crate) fn mean(&self, entries: usize) -> f64 {
        match self {
            Self::OnOff => 0.5,
            Self::Concentration(levels) => levels.iter().sum::<f64>() / levels.len() as f64,
            Self::Molecule => 1.0 / entries as f64,
        }
    }
}

impl Message {
    /// Returns the time of the `k`-th symbol, from 0, in s.
    pub fn time_of(&self, k: u32) -> f64 {
        self.start + f64::from(k) * self.symbol_time
    }

    /// Returns the `k`-th symbol, from 0, of a transmitter.
    pub fn symbol(&self, k: u32, transmitter: u32, key: Key) -> u32 {
        match &self.symbols {
            Symbols::Given(symbols) => symbols[k as usize],
            Symbols::Random { alphabet, .. } => {
                key.draw(transmitter, k, 0, Purpose::Symbol)[0] % (*alphabet).max(1)
            }
        }
    }

    pub(crate) fn faulty_symbol_time(&self, name: &str, time_step: f64) -> Option<String> {
        (self.symbol_time < time_step * (1.0 - 1e-9)).then(|| {
            format!(
                "the symbol time of {name} is {} s, and a step has {time_step} s, so that symbols share a step; make the \
                 symbol-time at least the time-step",
                self.symbol_time
            )
        })
    }

    pub(crate) fn due(&self, step: u32, time_step: f64) -> std::ops::Range<u32> {
        self.sent_before(step, time_step)..self.sent_before(step.saturating_add(1), time_step)
    }

    pub(crate) fn sent_before(&self, step: u32, time_step: f64) -> u32 {
        let is_sent =
            |k: u32| step_of(self.time_of(k), time_step).is_some_and(|symbol_step| symbol_step < step);
        let [mut low, mut high] = [0, self.symbols.len()];
        while low < high {
            let middle = low + (high - low) / 2;
            if is_sent(middle) { low = middle + 1 } else { high = middle }
        }
        low
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const KEY: Key = Key::new(3);

    #[test]
    fn symbols_fall_on_their_steps() {
        let symbols = Symbols::Given(vec![1, 0, 1, 1]);
        let message = Message { start: 0.1, symbol_time: 0.25, symbols, modulation: Modulation::OnOff };
        let due = |step| message.due(step, 0.1).map(|k| message.symbol(k, 0, KEY)).collect::<Vec<_>>();
        let expected = [(0, vec![]), (1, vec![1]), (4, vec![0]), (6, vec![1]), (8, vec![]), (9, vec![1])];
        for (step, symbols) in expected {
            assert_eq!(due(step), symbols, "{step}");
        }
        let fast = Message { start: 0.0, symbol_time: 0.04, ..message };
        assert_eq!(fast.due(1, 0.1), 1..3);
        assert_eq!((fast.sent_before(0, 0.1), fast.sent_before(9, 0.1)), (0, 4));
    }

    #[test]
    fn random_symbols_depend_on_seed_and_transmitter() {
        let symbols = Symbols::Random { count: 1000, alphabet: 4 };
        let message = Message { start: 0.0, symbol_time: 1.0, symbols, modulation: Modulation::Molecule };
        let all = |transmitter, seed| {
            (0..1000).map(|k| message.symbol(k, transmitter, Key::new(seed))).collect::<Vec<_>>()
        };
        assert_eq!(all(0, 1), all(0, 1));
        assert_ne!(all(0, 1), all(1, 1));
        assert_ne!(all(0, 1), all(0, 2));
        for symbol in 0..4 {
            let count = all(0, 1).into_iter().filter(|&s| s == symbol).count();
            assert!(
                (count as f64 - 250.0).abs() < 4.0 * (1000.0_f64 * 0.25 * 0.75).sqrt(),
                "{symbol}: {count}"
            );
        }
    }

    #[test]
    fn symbols_become_bursts() {
        let release = [(0, 10), (2, 20)];
        let burst = |modulation: &Modulation, symbol| modulation.burst(symbol, &release);
        assert_eq!((burst(&Modulation::OnOff, 0), burst(&Modulation::OnOff, 1)), (vec![], release.to_vec()));
        let levels = Modulation::Concentration(vec![0.0, 0.25, 1.0]);
        assert_eq!((burst(&levels, 1), burst(&levels, 2)), (vec![(0, 3), (2, 5)], release.to_vec()));
        assert_eq!(
            (burst(&Modulation::Molecule, 0), burst(&Modulation::Molecule, 1)),
            (vec![(0, 10)], vec![(2, 20)])
        );
        assert_eq!([&Modulation::OnOff, &levels, &Modulation::Molecule].map(|m| m.alphabet(2)), [2, 3, 2]);
    }
}
