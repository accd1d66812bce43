//! The time series: one row of counts after every so many steps.

use std::io::{self, Write};

use crate::{Model, Simulator};

/// The names of the columns: `step`, `time`, the particles of each species, the reactions and decays so far, what
/// each receiver says of each species that it sees, and the pairs and the settled overlaps of the last step.
pub(super) fn header(out: &mut impl Write, model: &Model) -> io::Result<()> {
    let mut names = vec!["step".to_owned(), "time".to_owned()];
    names.extend(model.species.iter().map(|species| species.name.clone()));
    names.extend(model.reactions.iter().map(|reaction| reaction.name.clone()));
    names.extend(model.decays.iter().map(|decay| decay.name.clone()));
    for receiver in &model.receivers {
        let seen = model.species.iter().zip(&receiver.sees).filter(|(_, sees)| **sees);
        names.extend(seen.map(|(species, _)| format!("{}:{}", receiver.name, species.name)));
    }
    names.extend(["pairs".to_owned(), "contacts".to_owned()]);
    writeln!(out, "{}", names.join(","))
}

/// One row.
pub(super) fn row(out: &mut impl Write, simulation: &Simulator) -> io::Result<()> {
    let (totals, model) = (simulation.totals(), simulation.model());
    write!(out, "{}", moment(simulation.step_count(), model))?;
    for count in totals.present.iter().chain(&totals.reacted).chain(&totals.decayed) {
        write!(out, ",{count}")?;
    }
    for (received, receiver) in simulation.received().iter().zip(&model.receivers) {
        for (count, _) in received.iter().zip(&receiver.sees).filter(|(_, sees)| **sees) {
            write!(out, ",{count}")?;
        }
    }
    writeln!(out, ",{},{}", totals.pairs, totals.contacts)
}

/// How a row begins.
pub(super) fn moment(step: u32, model: &Model) -> String {
    format!("{step},{}", f64::from(step) * model.time_step)
}

/// How many columns receivers have.
pub(super) fn seen(model: &Model) -> usize {
    model.receivers.iter().flat_map(|receiver| &receiver.sees).filter(|sees| **sees).count()
}
