use std::io::{self, Write};

use crate::{Model, RunView};

pub(super) fn header(out: &mut impl Write, model: &Model) -> io::Result<()> {
    writeln!(out, "step,time,{}", names(model).join(","))
}

pub(super) fn row(out: &mut impl Write, simulation: &impl RunView) -> io::Result<()> {
    write!(out, "{}", moment(simulation.step_count(), simulation.model()))?;
    counts(simulation).iter().try_for_each(|count| write!(out, ",{count}"))?;
    writeln!(out)
}

/// Returns the names of the [`counts`]: particles by species, reactions and decays so far, `receiver:species`, and the
/// last step's `pairs` and resolved `contacts`.
pub fn names(model: &Model) -> Vec<String> {
    let mut names: Vec<_> = model.species.iter().map(|species| species.name.clone()).collect();
    names.extend(model.reactions.iter().map(|reaction| reaction.name.clone()));
    names.extend(model.decays.iter().map(|decay| decay.name.clone()));
    for receiver in &model.receivers {
        let seen = model.species.iter().enumerate().filter(|&(k, _)| receiver.counts(k));
        names.extend(seen.map(|(_, species)| format!("{}:{}", receiver.name, species.name)));
    }
    names.extend(["pairs".to_owned(), "contacts".to_owned()]);
    names
}

pub fn counts(simulation: &impl RunView) -> Vec<u64> {
    let (totals, model) = (simulation.totals(), simulation.model());
    let mut counts = [&totals.present[..], &totals.reacted, &totals.decayed].concat();
    for (received, receiver) in simulation.received().iter().zip(&model.receivers) {
        counts
            .extend(received.iter().enumerate().filter(|&(k, _)| receiver.counts(k)).map(|(_, count)| count));
    }
    counts.extend([totals.pairs, totals.contacts]);
    counts
}

pub(super) fn moment(step: u32, model: &Model) -> String {
    format!("{step},{}", f64::from(step) * model.time_step)
}

pub(super) fn seen(model: &Model) -> usize {
    let species = model.species.len();
    let seen = |receiver: &crate::Receiver| (0..species).filter(|&k| receiver.counts(k)).count();
    model.receivers.iter().map(seen).sum()
}
