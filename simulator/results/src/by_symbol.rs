use std::collections::BTreeMap;

use crate::columns::column_of;
use crate::mean::IntegerStats;
use crate::response::Link;
use crate::series::Series;
use crate::symbols::SymbolSlots;
use lazygrid_sim::Model;
use lazygrid_sim::model::transmitter::Schedule;
use lazygrid_sim::random::philox::Key;

/// A receiver's count by symbol and time within the slot. Arrivals count from the last row at or before the slot's
/// beginning to the row at its end. Momentary counts assign that row to the next slot, because it includes its burst.
#[derive(Clone, Debug, PartialEq)]
pub struct CountsBySymbol {
    pub link: Link,
    /// Indexed by symbol and steps within the slot.
    pub symbols: BTreeMap<u32, BTreeMap<u32, IntegerStats>>,
}

impl CountsBySymbol {
    pub fn new(link: Link) -> Self {
        Self { link, symbols: BTreeMap::new() }
    }

    pub fn is_any(&self) -> bool {
        self.symbols.values().flat_map(BTreeMap::values).any(|sample| sample.mean() > 0.0)
    }

    /// Adds a replica, with slots that begin with their symbols.
    pub fn add(&mut self, series: &Series, model: &Model, seed: u64, slots: &SymbolSlots) {
        let Link { transmitter, receiver, species } = self.link;
        let Schedule::Message(message) = &model.transmitters[transmitter].schedule else { return };
        let Some(column) = column_of(model, receiver, species) else { return };
        let grows = model.receivers[receiver].kind.absorbs();
        for (k, bounds) in slots.bounds.windows(2).enumerate() {
            let symbol = message.symbol(k as u32, transmitter as u32, Key::new(seed));
            let first = series.steps.partition_point(|&step| step < bounds[0]);
            let before = series.steps.partition_point(|&step| step <= bounds[0]).checked_sub(1);
            let base = before.filter(|_| grows).map_or(0, |row| series.row(row)[column]);
            let by_time = self.symbols.entry(symbol).or_default();
            let is_in = |&row: &usize| series.steps[row] < bounds[1] + u32::from(grows);
            for row in (first..series.steps.len()).take_while(is_in) {
                let lag = series.steps[row] - bounds[0];
                by_time.entry(lag).or_default().add(series.row(row)[column].saturating_sub(base));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::symbols::tests::{model, slots};
    use lazygrid_sim::ReceiverKind;

    #[test]
    fn slots_of_a_symbol_are_averaged_over_its_own() {
        // Bits 1 0 1 1 in slots of 10 steps from step 5; a row every 5 steps.
        let mut model = model();
        let counts = [0, 1, 4, 6, 6, 6, 10, 12, 13, 15];
        let series = Series {
            names: lazygrid_sim::series::names(&model),
            steps: (0..10).map(|k| 5 * k).collect(),
            times: (0..10).map(|k| 0.5 * f64::from(k)).collect(),
            counts: counts.iter().flat_map(|&count| [0, count, 0, 0]).collect(),
        };
        let by_symbol = |model: &Model| {
            let mut counts_by_symbol = CountsBySymbol::new(Link { transmitter: 0, receiver: 0, species: 0 });
            counts_by_symbol.add(&series, model, 1, &slots(100));
            let means = |times: &BTreeMap<u32, IntegerStats>| -> Vec<(u32, f64, u64)> {
                times.iter().map(|(&lag, sample)| (lag, sample.mean(), sample.count())).collect()
            };
            counts_by_symbol.symbols.iter().map(|(&symbol, times)| (symbol, means(times))).collect::<Vec<_>>()
        };
        // Arrivals since the beginning: 0 3 5, 0 4 6, 0 1 3 after a 1; 0 0 0 after the 0.
        let after_one = |a, b, c| vec![(0, a, 3), (5, b, 3), (10, c, 3)];
        let expected =
            [(0, vec![(0, 0.0, 1), (5, 0.0, 1), (10, 0.0, 1)]), (1, after_one(0.0, 8.0 / 3.0, 14.0 / 3.0))];
        assert_eq!(by_symbol(&model), expected);
        model.receivers[0].kind = ReceiverKind::Transparent;
        let expected = [(0, vec![(0, 6.0, 1), (5, 6.0, 1)]), (1, vec![(0, 19.0 / 3.0, 3), (5, 9.0, 3)])];
        assert_eq!(by_symbol(&model), expected);
    }
}
