//! Likely mistakes that depend on overrides of a scenario.

use lazygrid_io::excerpt;

use super::Scenario;
use crate::model::message::Message;
use crate::{Model, Receiver, Schedule, Transmitter};

/// Rows in a symbol's time from which one more or less matters little.
const MANY_ROWS: f64 = 10.0;

impl Scenario {
    /// Returns warnings of settings without effect in a run of these steps and rows.
    pub fn run_warnings(&self) -> Vec<String> {
        let transmitters = &self.model.transmitters;
        let late = transmitters.iter().filter_map(|transmitter| self.late_release(transmitter));
        let unseen = transmitters.iter().filter_map(|transmitter| self.unequal_slots(transmitter));
        let all = late.chain(self.late_flow()).chain(absent_species(&self.model)).chain(unseen);
        all.chain(self.single_row()).collect()
    }

    fn end(&self) -> f64 {
        f64::from(self.steps) * self.model.time_step
    }

    fn late_release(&self, transmitter: &Transmitter) -> Option<String> {
        let (first, count) = transmitter.after(self.steps, self.model.time_step)?;
        let what = match count {
            Some(1) => "has a release".to_owned(),
            Some(count) => format!("has {count} releases"),
            None => "begins to release".to_owned(),
        };
        Some(format!(
            "transmitter {} {what} at or after {first} s, but the run ends at {} s; make `steps` more than {}, or remove \
             these times",
            excerpt(transmitter.name.as_bytes()),
            self.end(),
            (first / self.model.time_step).ceil()
        ))
    }

    fn late_flow(&self) -> Option<String> {
        let [from, _] = self.model.flow_pulse?;
        (from >= self.end()).then(|| {
            format!(
                "the flow begins at {from} s, but the run ends at {} s; make `steps` more than {}, or remove the flow",
                self.end(),
                (from / self.model.time_step).ceil()
            )
        })
    }

    fn single_row(&self) -> Option<String> {
        let (every, steps) = (self.output.every, self.steps);
        (every > steps && steps > 0).then(|| {
            format!(
                "the series has a row every {every} steps, but the run has {steps}, so that only the first row is written; make \
                 `every` at most {steps}"
            )
        })
    }

    /// Warns of symbols with unequal numbers of rows at a receiver with momentary counts.
    fn unequal_slots(&self, transmitter: &Transmitter) -> Option<String> {
        let Schedule::Message(Message { symbol_time, .. }) = &transmitter.schedule else { return None };
        let counts = |receiver: &&Receiver| {
            receiver.is_momentary() && transmitter.species().any(|species| receiver.counts(species as usize))
        };
        let receiver = self.model.receivers.iter().find(counts)?;
        let steps = symbol_time / self.model.time_step;
        let rows = steps / f64::from(self.output.every);
        let is_even = (rows - rows.round()).abs() < 1e-6 * rows && rows >= 1.0;
        (!is_even && rows < MANY_ROWS).then(|| {
            format!(
                "a symbol of {} takes {steps} steps, and the series has a row every {}, so that symbols have unequal numbers of \
                 rows at {}: bit errors leave out symbols without a row, and energy and strength of the others depend on \
                 the number; choose an `every` that divides the steps of a symbol",
                excerpt(transmitter.name.as_bytes()),
                self.output.every,
                excerpt(receiver.name.as_bytes())
            )
        })
    }
}

/// Warns of species without particles, by a misspelled equation or a forgotten transmitter.
fn absent_species(model: &Model) -> Option<String> {
    let released = model.transmitters.iter().flat_map(Transmitter::species);
    let reacted = model.reactions.iter().flat_map(|reaction| reaction.products).flatten();
    let decayed = model.decays.iter().flat_map(|decay| decay.products).flatten();
    let mut is_made = vec![false; model.species.len()];
    released.chain(reacted).chain(decayed).for_each(|species| is_made[species as usize] = true);
    let mut absent = model.species.iter().zip(is_made).filter(|(_, is_made)| !is_made);
    let (first, _) = absent.next()?;
    let more = match absent.count() {
        0 => String::new(),
        count => format!(" and {count} more"),
    };
    Some(format!(
        "no transmitter, source, reaction or decay makes species {}{more}, so that there are no such particles; release \
         some, or remove the species",
        excerpt(first.name.as_bytes())
    ))
}
