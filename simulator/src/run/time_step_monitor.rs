//! Warnings of reactions that are too fast for the time step.
//!
//! Products react in the next step, and reactants disappear at its end: rates are off by about half of the fraction
//! that reacts in a step.

use std::ops::Range;

use crate::{Model, Schedule, Totals};

/// Fraction of reactants per step.
const FAST_FRACTION: f64 = 0.02;
/// Fraction of fast reactions that warns.
const MAX_FAST_FRACTION: f64 = 0.1;

#[derive(Clone, Debug, Default)]
pub(crate) struct TimeStepMonitor {
    /// Indexed by reaction: all, those in fast steps, and the largest fraction in a step.
    counts: Vec<(f64, f64, f64)>,
}

impl TimeStepMonitor {
    pub(crate) fn reaction_totals(Totals { present, reacted, .. }: &Totals) -> Totals {
        let [present, reacted] = [present, reacted].map(Clone::clone);
        Totals { present, reacted, ..Totals::default() }
    }

    pub(crate) fn add_steps(&mut self, model: &Model, [before, after]: [&Totals; 2], steps: Range<u32>) {
        self.counts.resize(model.reactions.len(), (0.0, 0.0, 0.0));
        if steps.len() == 1 && begins_with_burst(model, steps.start) {
            // Particles released together react at once at any time step.
            return;
        }
        for (index, reaction) in model.reactions.iter().enumerate() {
            let count = (after.reacted[index] - before.reacted[index]) as f64;
            let [a, b] = reaction.reactants.map(|species| before.present[species as usize] as f64);
            let reactants = if reaction.reactants[0] == reaction.reactants[1] { a / 2.0 } else { a.min(b) };
            let fraction = count / steps.len().max(1) as f64 / reactants.max(1.0);
            let (all, fast, worst) = &mut self.counts[index];
            *all += count;
            if fraction > FAST_FRACTION && reactants > 10.0 {
                *fast += count;
                *worst = worst.max(fraction);
            }
        }
    }

    pub(crate) fn warnings(&self, model: &Model) -> Vec<String> {
        let warning = |(reaction, &(all, fast, worst)): (&crate::Reaction, &(f64, f64, f64))| {
            (fast > MAX_FAST_FRACTION * all).then(|| {
                format!(
                    "'{}': {:.0} % of it came in steps in which more than {:.0} % of the reactants reacted, {:.0} % at the \
                     most, so that its rate was off by up to about {:.0} %; a shorter time step would do, of about {:.2e} s",
                    reaction.name,
                    100.0 * fast / all,
                    100.0 * FAST_FRACTION,
                    100.0 * worst,
                    50.0 * worst,
                    model.time_step * FAST_FRACTION / worst
                )
            })
        };
        model.reactions.iter().zip(&self.counts).filter_map(warning).collect()
    }
}

fn begins_with_burst(model: &Model, step: u32) -> bool {
    let bursts = model.transmitters.iter().filter(|one| !matches!(one.schedule, Schedule::Steady { .. }));
    let mut counts = bursts.flat_map(|one| one.mean_between([step, step.saturating_add(1)], model.time_step));
    counts.any(|(_, count)| count > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Reaction, Species, Transmitter};

    #[test]
    fn reactions_that_are_too_fast_are_named() {
        let reaction =
            |name: &str, reactants| Reaction { name: name.into(), reactants, ..Reaction::default() };
        let model = Model {
            time_step: 0.1,
            species: vec![Species::default(); 2],
            reactions: vec![reaction("A + B -> 0", [0, 1]), reaction("A + A -> 0", [0, 0])],
            ..Model::default()
        };
        let totals = |present: [u64; 2], reacted: [u64; 2]| Totals {
            present: present.to_vec(),
            reacted: reacted.to_vec(),
            ..Totals::default()
        };
        let mut pace = TimeStepMonitor::default();
        pace.add_steps(&model, [&totals([1000, 100], [0, 0]), &totals([800, 60], [40, 50])], 0..10);
        assert_eq!(pace.warnings(&model).len(), 1);
        let message = &pace.warnings(&model)[0];
        assert!(
            message.starts_with("'A + B -> 0': 100 % of it") && message.contains("off by up to about 2 %"),
            "{message}"
        );
        assert!(message.contains("of about 5.00e-2 s"), "{message}");
        pace.add_steps(&model, [&totals([800, 60], [40, 50]), &totals([400, 60], [500, 50])], 10..1010);
        assert_eq!(pace.warnings(&model), [""; 0]);
    }

    #[test]
    fn steps_with_bursts_do_not_count_and_others_do() {
        let reaction = Reaction { name: "A + A -> 0".into(), ..Reaction::default() };
        let steady = Schedule::Steady { from: 0.0, until: f64::INFINITY, rates: vec![(0, 1e4)] };
        let bursts = Transmitter { release: vec![(0, 9)], ..Transmitter::default() };
        let with = |transmitter: Transmitter, step: u32| {
            let model = Model {
                time_step: 0.1,
                species: vec![Species::default()],
                reactions: vec![reaction.clone()],
                transmitters: vec![transmitter],
                ..Model::default()
            };
            let mut pace = TimeStepMonitor::default();
            let totals = |present: u64, released: u64, reacted: u64| Totals {
                present: vec![present],
                released: vec![released],
                reacted: vec![reacted],
                ..Totals::default()
            };
            pace.add_steps(&model, [&totals(1000, 2000, 0), &totals(800, 3000, 200)], step..step + 1);
            pace.warnings(&model).len()
        };
        assert_eq!(with(Transmitter { schedule: steady, ..Transmitter::default() }, 3), 1);
        assert_eq!((with(bursts.clone(), 0), with(bursts, 3)), (0, 1));
    }
}
