//! Warnings of reactions that are too fast for the time step.
//!
//! Products react only in the next step, and reactants disappear at its end. Rates are off by about half of the
//! fraction that reacts in a step.

use crate::{Model, Totals};

/// Fraction of reactants per step.
const FAST: f64 = 0.02;
/// Fraction of fast reactions that warns.
const MANY: f64 = 0.1;

#[derive(Clone, Debug, Default)]
pub(crate) struct TimeStepMonitor {
    /// Indexed by reaction: all, those in fast steps, and the largest fraction in a step.
    seen: Vec<(f64, f64, f64)>,
    released: u64,
}

impl TimeStepMonitor {
    /// Copies the totals before a step for [`see`](Self::see).
    pub(crate) fn part_of(Totals { present, released, reacted, .. }: &Totals) -> Totals {
        let [present, released, reacted] = [present, released, reacted].map(Clone::clone);
        Totals { present, released, reacted, ..Totals::default() }
    }

    pub(crate) fn see(&mut self, model: &Model, [before, after]: [&Totals; 2], steps: u32) {
        self.seen.resize(model.reactions.len(), (0.0, 0.0, 0.0));
        let released = before.released.iter().sum();
        if std::mem::replace(&mut self.released, released) != released && steps == 1 {
            // Particles released near each other react at once, at any time step.
            return;
        }
        for (place, reaction) in model.reactions.iter().enumerate() {
            let count = (after.reacted[place] - before.reacted[place]) as f64;
            let [a, b] = reaction.reactants.map(|species| before.present[species as usize] as f64);
            let there = if reaction.reactants[0] == reaction.reactants[1] { a / 2.0 } else { a.min(b) };
            let part = count / f64::from(steps.max(1)) / there.max(1.0);
            let (all, fast, worst) = &mut self.seen[place];
            *all += count;
            if part > FAST && there > 10.0 {
                *fast += count;
                *worst = worst.max(part);
            }
        }
    }

    pub(crate) fn warnings(&self, model: &Model) -> Vec<String> {
        let said = |(reaction, &(all, fast, worst)): (&crate::Reaction, &(f64, f64, f64))| {
            (fast > MANY * all).then(|| {
                format!(
                    "'{}': {:.0} % of it came in steps in which more than {:.0} % of the reactants reacted, {:.0} % at the \
                     most, so that its rate was off by up to about {:.0} %; a shorter time step would do, of about {:.2e} s",
                    reaction.name,
                    100.0 * fast / all,
                    100.0 * FAST,
                    100.0 * worst,
                    50.0 * worst,
                    model.time_step * FAST / worst
                )
            })
        };
        model.reactions.iter().zip(&self.seen).filter_map(said).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Reaction, Species};

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
        pace.see(&model, [&totals([1000, 100], [0, 0]), &totals([800, 60], [40, 50])], 10);
        assert_eq!(pace.warnings(&model).len(), 1);
        let said = &pace.warnings(&model)[0];
        assert!(
            said.starts_with("'A + B -> 0': 100 % of it") && said.contains("off by up to about 2 %"),
            "{said}"
        );
        assert!(said.contains("of about 5.00e-2 s"), "{said}");
        pace.see(&model, [&totals([800, 60], [40, 50]), &totals([400, 60], [500, 50])], 1000);
        assert_eq!(pace.warnings(&model), [""; 0]);
    }
}
