//! The mean length of a chain of decays within a step.
//!
//! # Correctness
//! 1. `N` is the number of decays of a particle in an exponentially distributed time of mean Δt. The process has no
//!    memory, so P(N > j + k) ≤ P(N > j)·P(N > k), each for the worst first species.
//! 2. After k sweeps, [`expected`] is at least the mean of min(N, k). If it is at most m, then P(N ≥ k) ≤ m/k.
//! 3. That time exceeds Δt with the probability 1/e. More than k decays in a step thus have a probability of at most
//!    e·m/k, which is 0.68 by [`MAX_EXPECTED_DECAYS`] and [`MAX_SWEEPS`], and more than 10⁶ one below 0.68²⁵⁰ < 10⁻⁴¹.

use crate::model::Model;
use crate::model::time::longest_step;

/// Largest mean number of decays of a particle in a step.
const MAX_EXPECTED_DECAYS: f64 = 1000.0;
const MAX_SWEEPS: u32 = 4000;
/// Largest change of a mean number that ends the sweeps: later ones then add at most 4.
const MAX_FINAL_CHANGE: f64 = 1e-3;

/// A decay of a species that does not dissociate.
struct Link {
    decay: usize,
    from: usize,
    to: Option<usize>,
    rate: f64,
}

/// Returns a decay that begins too long a chain, and a message.
pub(crate) fn faulty_chain(model: &Model) -> Option<(usize, String)> {
    let links = links(model);
    let starts = |time_step: f64| expected(&links, model.species.len(), time_step);
    let fit = |means: &[f64]| means.iter().all(|&count| count <= MAX_EXPECTED_DECAYS);
    let means = starts(model.time_step);
    if fit(&means) {
        return None;
    }
    let worst = (0..means.len()).max_by(|&a, &b| means[a].total_cmp(&means[b]))?;
    let fastest = links.iter().filter(|link| link.from == worst).max_by(|a, b| a.rate.total_cmp(&b.rate))?;
    let message = format!(
        "'{}' at {:.1} expected decays per step begins a chain of more than {MAX_EXPECTED_DECAYS} decays on average in a step; set \
         time-step to {:.2e} or less",
        model.decays[fastest.decay].name,
        fastest.rate * model.time_step,
        longest_step(model.time_step, |time_step| fit(&starts(time_step)))
    );
    Some((fastest.decay, message))
}

fn links(model: &Model) -> Vec<Link> {
    let dissociates = model.dissociating();
    let all = model.decays.iter().enumerate().filter(|(_, decay)| decay.rate > 0.0);
    let links = all.map(|(index, decay)| Link {
        decay: index,
        from: decay.reactant as usize,
        to: decay.products[0].map(|product| product as usize),
        rate: decay.rate,
    });
    links.filter(|link| !dissociates[link.from]).collect()
}

/// Returns the mean number of decays in a time of mean `time_step`, by the first species.
fn expected(links: &[Link], species: usize, time_step: f64) -> Vec<f64> {
    let mut rates = vec![0.0; species];
    links.iter().for_each(|link| rates[link.from] += link.rate);
    let mut means = vec![0.0; species];
    for _ in 0..MAX_SWEEPS {
        let mut next = vec![0.0; species];
        for &Link { from, to, rate, .. } in links {
            // The probability of this decay before the end of the time.
            let fraction = rate / rates[from] / (1.0 + 1.0 / (rates[from] * time_step));
            next[from] += fraction * (1.0 + to.map_or(0.0, |to| means[to]));
        }
        let change = means.iter().zip(&next).map(|(old, new): (&f64, &f64)| new - old).fold(0.0, f64::max);
        means = next;
        if change <= MAX_FINAL_CHANGE {
            break;
        }
    }
    means
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Decay, Species};

    fn cycle(rates: [f64; 2], time_step: f64) -> Model {
        let decay = |reactant: u32, rate| Decay {
            name: format!("{reactant} ->"),
            reactant,
            products: [Some(1 - reactant), None],
            rate,
            ..Decay::default()
        };
        Model {
            time_step,
            species: vec![Species::default(); 2],
            decays: vec![decay(0, rates[0]), decay(1, rates[1])],
            ..Model::default()
        }
    }

    #[test]
    fn long_chain_is_refused_with_a_time_step_that_works() {
        let (index, message) = faulty_chain(&cycle([3e6, 1e6], 1e-3)).expect("1500 decays per step");
        assert!(index == 0 && message.contains("'0 ->' at 3000.0 expected decays per step"), "{message}");
        let advised = message.split("time-step to ").nth(1).and_then(|rest| rest.split(' ').next());
        let advised: f64 = advised.and_then(|text| text.parse().ok()).expect("a time step");
        assert!((advised / 6.7e-4 - 1.0).abs() < 0.01, "{message}");
        assert_eq!(faulty_chain(&cycle([3e6, 1e6], advised)), None);
        assert!(faulty_chain(&cycle([3e6, 1e6], 1.02 * advised)).is_some());
        assert!(cycle([3e6, 1e6], 1e-3).check().is_err() && cycle([3e6, 1e6], advised).check().is_ok());
        assert!(faulty_chain(&cycle([1e300, 1e300], 1e20)).is_some());
    }

    #[test]
    fn fast_decay_without_a_fast_reverse_is_accepted() {
        assert_eq!(faulty_chain(&cycle([1e12, 1.0], 1e-3)), None);
        assert_eq!(faulty_chain(&cycle([1e12, 0.0], 1e-3)), None);
        let mut dissociating = cycle([3e6, 1e6], 1e-3);
        dissociating.decays[1].products[1] = Some(0);
        assert_eq!(faulty_chain(&dissociating), None);
    }
}
