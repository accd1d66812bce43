use lazygrid::Algorithm;
use lazygrid_sim::ranks::{RankSimulation, Wanted};
use lazygrid_sim::{Arrival, Model, Simulation, Standing, State};
use proptest::prelude::*;

use crate::models::{everything, model, parts};
use crate::threads;

/// What can be seen of a run after a step.
#[derive(Clone, Debug, PartialEq)]
struct Seen {
    /// In the order of ids, as places are no part of a result.
    state: State,
    received: Vec<Vec<u64>>,
    arrivals: Vec<Arrival>,
}

fn seen(mut state: State, received: Vec<Vec<u64>>, arrivals: &[Arrival]) -> Seen {
    state.particles = state.particles.permuted(&state.particles.by_id());
    state.bound.sort_unstable_by_key(|bound| bound.id);
    Seen { state, received, arrivals: arrivals.to_vec() }
}

fn alone(model: &Model, seed: u64, steps: u32) -> Vec<Seen> {
    let mut run = Simulation::new(model.clone(), seed, Algorithm::Auto).unwrap();
    let look = |run: &Simulation| seen(run.state().clone(), run.received(), run.arrivals());
    let mut all = vec![look(&run)];
    for _ in 0..steps {
        run.step().unwrap();
        all.push(look(&run));
    }
    all
}

fn over(ranks: u32, model: &Model, seed: u64, steps: u32) -> Vec<Seen> {
    over_by(Algorithm::Auto, ranks, model, seed, steps)
}

fn over_by(algorithm: Algorithm, ranks: u32, model: &Model, seed: u64, steps: u32) -> Vec<Seen> {
    let wanted = Wanted { received: true, particles: true };
    let mut of_ranks = threads::on(ranks, |thread| {
        let mut run = RankSimulation::new(thread, model.clone(), seed, algorithm).unwrap();
        let mut all = Vec::new();
        for step in 0..=steps {
            let standing = run.look(wanted).unwrap();
            let state = standing.state().unwrap().into_owned();
            all.push(seen(state, standing.received(), standing.arrivals()));
            if step < steps {
                run.step().unwrap();
            }
        }
        all
    });
    of_ranks.swap_remove(0)
}

fn compare(model: &Model, seed: u64, steps: u32, numbers: &[u32]) {
    let expected = alone(model, seed, steps);
    for &ranks in numbers {
        let found = over(ranks, model, seed, steps);
        for (step, (found, expected)) in found.iter().zip(&expected).enumerate() {
            assert_eq!(found.state.totals, expected.state.totals, "{ranks} ranks after {step} steps");
            assert!(found == expected, "{ranks} ranks differ after {step} steps");
        }
        assert_eq!(found.len(), expected.len());
    }
}

/// Everything that ranks have to settle among each other happens, and happens often.
#[test]
fn everything_at_once_is_as_in_one_process() {
    let model = model(&everything());
    let expected = alone(&model, 3, 40);
    let totals = &expected.last().unwrap().state.totals;
    assert!(totals.reacted.iter().all(|&reacted| reacted > 10), "{totals:?}");
    assert!(totals.decayed.iter().all(|&decayed| decayed > 5), "{totals:?}");
    assert!(totals.arrived.iter().skip(1).any(|of| of.iter().sum::<u64>() > 0), "{totals:?}");
    compare(&model, 3, 40, &[1, 2, 3, 8]);
}

/// Also where pairs are found by a grid that has one set of spheres only.
#[test]
fn the_algorithm_is_no_part_of_a_result() {
    let model = model(&everything());
    let expected = alone(&model, 5, 10);
    for algorithm in [Algorithm::ArrayGrid, Algorithm::Naive] {
        assert!(over_by(algorithm, 3, &model, 5, 10) == expected, "{algorithm}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn every_model_is_as_in_one_process(parts in parts(), seed in 0..1000_u64, ranks in 1..6_u32) {
        compare(&model(&parts), seed, 12, &[ranks]);
    }
}
