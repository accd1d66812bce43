use std::sync::Arc;

use lazygrid::{Algorithm, Config};
use lazygrid_sim::model::receiver::WallFace;
use lazygrid_sim::ranks::{GatherFields, RankSimulation};
use lazygrid_sim::{
    Arrival, Attractant, AttractantProfile, Boundary, Chemotaxis, Contact, Decay, Flow, FlowField, Membrane,
    MembraneSurface, Model, Origin, Receiver, ReceiverKind, ReceptorType, RunView, Schedule, Simulation,
    Species, State, Transmitter,
};
use proptest::prelude::*;

use crate::models::{ModelFeatures, everything, model, model_features};
use crate::{on_cpu, threads};

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Seen {
    pub(crate) state: State,
    pub(crate) received: Vec<Vec<u64>>,
    pub(crate) arrivals: Vec<Arrival>,
}

pub(crate) fn seen(mut state: State, received: Vec<Vec<u64>>, arrivals: &[Arrival]) -> Seen {
    state.particles = state.particles.permuted(&state.particles.by_id());
    state.bound.sort_unstable_by_key(|bound| bound.id);
    Seen { state, received, arrivals: arrivals.to_vec() }
}

pub(crate) fn alone(model: &Model, seed: u64, steps: u32) -> Vec<Seen> {
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
    over_by(&on_cpu(), ranks, model, seed, steps)
}

fn over_by(detector: &Config, ranks: u32, model: &Model, seed: u64, steps: u32) -> Vec<Seen> {
    let fields = GatherFields { received: true, particles: true };
    let mut of_ranks = threads::on(ranks, |thread| {
        let mut run = RankSimulation::new(thread, model.clone(), seed, detector.clone()).unwrap();
        let mut all = Vec::new();
        for step in 0..=steps {
            let standing = run.gather(fields).unwrap();
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

pub(crate) fn compare(model: &Model, seed: u64, steps: u32, numbers: &[u32]) {
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

#[test]
fn combined_model_equals_one_process() {
    let model = model(&everything());
    let expected = alone(&model, 3, 40);
    let totals = &expected.last().unwrap().state.totals;
    assert!(totals.reacted.iter().all(|&reacted| reacted > 10), "{totals:?}");
    assert!(totals.decayed.iter().all(|&decayed| decayed > 2), "{totals:?}");
    assert!(totals.arrived.iter().skip(1).any(|of| of.iter().sum::<u64>() > 0), "{totals:?}");
    compare(&model, 3, 40, &[1, 2, 3, 8]);
}

#[test]
fn distances_of_several_magnitudes_over_ranks_equal_one_process() {
    let mut model = model(&ModelFeatures { contact: Contact::Ignore, ..everything() });
    for (reaction, radius) in model.reactions.iter_mut().zip([0.5, 4.0, 0.45, 1.0]) {
        reaction.binding_radius = radius;
    }
    let totals = &alone(&model, 3, 20).pop().unwrap().state.totals;
    assert!(totals.reacted.iter().all(|&reacted| reacted > 5), "{totals:?}");
    compare(&model, 3, 20, &[2, 3, 8]);
}

#[test]
fn arrivals_since_the_release_over_ranks_equal_one_process() {
    let mut model = model(&everything());
    let [x, y, z] = model.receivers.last().unwrap().center;
    model.transmitters[2].center = [x + 0.85, y, z];
    let expected = alone(&model, 3, 20);
    let has_begun = |arrival: &Arrival| arrival.origin.is_some_and(|origin| origin.step == arrival.step);
    let arrivals = expected.iter().flat_map(|seen| &seen.arrivals).filter(|arrival| has_begun(arrival));
    assert!(arrivals.count() > 10);
    compare(&model, 3, 20, &[1, 3]);
}

#[test]
fn decays_before_hits_over_ranks_equal_one_process() {
    let mut model = model(&ModelFeatures { periodic: false, ..everything() });
    model.decays.retain(|decay| decay.products[1].is_none());
    let decay = |reactant, product| Decay { reactant, products: [Some(product), None], ..Decay::default() };
    model.decays.extend([decay(0, 1), decay(1, 0)]);
    model.decays.iter_mut().for_each(|decay| decay.rate = 40.0);
    let wall = |face| Receiver {
        name: format!("{face:?}"),
        kind: ReceiverKind::Wall(face),
        sees: vec![true, false, false, true],
        ..Receiver::default()
    };
    let first = model.receivers.len();
    model.receivers.extend([WallFace::High(0), WallFace::High(2)].map(wall));
    let expected = alone(&model, 5, 20);
    let totals = &expected.last().unwrap().state.totals;
    assert!(totals.decayed.iter().all(|&decayed| decayed > 10), "{totals:?}");
    assert!(totals.arrived[first..].iter().all(|row| row[0] > 0 && row[1] == 0), "{totals:?}");
    compare(&model, 5, 20, &[1, 3]);
}

#[test]
fn dissociations_before_hits_over_ranks_equal_one_process() {
    let mut model = model(&ModelFeatures { periodic: false, ..everything() });
    let dissociation = |reactant, products| Decay {
        reactant,
        products: [Some(products); 2],
        rate: 20.0,
        ..Decay::default()
    };
    model.decays = vec![dissociation(1, 0), dissociation(2, 3)];
    model.transmitters[1].center[0] = 0.4;
    let absorber = |name: &str, center, radius, kind| Receiver {
        name: name.into(),
        center,
        radius,
        kind,
        sees: vec![true, true, true, false],
        ..Receiver::default()
    };
    let first = model.receivers.len();
    model.receivers.extend([
        absorber("sphere", [5.0, 5.0, 6.2], 0.7, ReceiverKind::Absorbing),
        absorber("wall", [0.0; 3], 0.0, ReceiverKind::Wall(WallFace::Low(0))),
    ]);
    let expected = alone(&model, 5, 20);
    let totals = &expected.last().unwrap().state.totals;
    assert!(totals.decayed.iter().chain(&totals.reacted).all(|&count| count > 10), "{totals:?}");
    assert!(totals.arrived[first].iter().take(3).all(|&arrived| arrived > 0), "{totals:?}");
    assert!(totals.arrived[first + 1][1] > 0, "{totals:?}");
    compare(&model, 5, 20, &[1, 3]);
}

#[test]
fn membranes_over_ranks_equal_one_process() {
    let mut model = model(&everything());
    model.receivers.retain(|receiver| receiver.kind == ReceiverKind::Transparent);
    model.boundary = Boundary::periodic([0.0; 3], [10.0; 3]);
    let sees: Vec<_> = model.species.iter().map(|species| !species.has_velocity()).collect();
    model.species.iter_mut().for_each(|species| species.drift = [0.0; 3]);
    model.flow = None;
    let surface = MembraneSurface::Plane { axis: 0, position: 5.0 };
    let ball = MembraneSurface::Sphere { center: [7.0, 5.0, 5.0], radius: 1.5 };
    let membrane = |surface| Membrane { name: "skin".into(), surface, permeability: 2.0, sees: sees.clone() };
    model.membranes = vec![membrane(surface), membrane(ball)];
    // Surfaces that reflect are far from membranes compared with a step.
    model.time_step = 0.005;
    let receiver = |name: &str, center, kind| Receiver {
        name: name.into(),
        center,
        radius: 0.5,
        kind,
        sees: sees.clone(),
        ..Receiver::default()
    };
    let receptors = ReceiverKind::Receptors(vec![ReceptorType::new(20, 40.0, 60.0, [0])]);
    model.receivers.push(receiver("nucleus", [7.0, 5.0, 5.0], ReceiverKind::Reflecting));
    model.receivers.push(receiver("receptors", [2.0, 5.0, 5.0], receptors));
    let open = Model { membranes: Vec::new(), ..model.clone() };
    assert!(alone(&model, 4, 10).last() != alone(&open, 4, 10).last());
    compare(&model, 4, 10, &[3]);
    let absorber = receiver("absorber", [4.4, 5.0, 5.0], ReceiverKind::Absorbing);
    model.receivers.push(Receiver { velocity: [20.0, 0.0, 0.0], ..absorber });
    let moving = model.receivers.iter_mut().filter(|receiver| receiver.kind != ReceiverKind::Transparent);
    moving.for_each(|receiver| receiver.diffusion = 0.2);
    let open = Model { membranes: Vec::new(), ..model.clone() };
    let [held, free] = [&model, &open].map(|model| alone(model, 4, 10).pop().unwrap().state);
    assert!(held.centers.last().unwrap()[0] < 4.5 && free.centers.last().unwrap()[0] > 4.5);
    compare(&model, 4, 10, &[1, 3]);
}

#[test]
fn flow_field_over_ranks_equals_one_process() {
    let mut model = model(&everything());
    let velocities: Vec<f32> = (0..24_u8).map(|k| f32::from(k % 7) - 3.0).collect();
    let field = FlowField::new([[0.0; 3], [10.0; 3]], [2; 3], velocities).unwrap();
    model.flow = Some(Flow::Field(Arc::new(field)));
    let still = Model { flow: None, ..model.clone() };
    assert!(alone(&model, 4, 10).last() != alone(&still, 4, 10).last());
    compare(&model, 4, 10, &[3]);
}

#[test]
fn chemotaxis_over_ranks_equals_one_process() {
    let mut model = model(&everything());
    let profile = AttractantProfile::Source { peak: 2.0, radius: 0.5 };
    model.attractants = vec![Attractant { name: "food".into(), center: [5.0; 3], profile }];
    for species in model.species.iter_mut().filter(|species| species.thermal_speed == 0.0) {
        (species.speed, species.tumble_rate) = (5.0, 10.0);
    }
    let aimless = model.clone();
    let taxis = Chemotaxis { attractant: 0, sensitivity: 1.0, half_saturation: Some(0.5) };
    let swimmers = model.species.iter_mut().filter(|species| species.speed > 0.0);
    swimmers.for_each(|species| species.chemotaxis = Some(taxis));
    assert!(alone(&model, 4, 10).last() != alone(&aimless, 4, 10).last());
    compare(&model, 4, 10, &[3]);
}

#[test]
fn result_does_not_depend_on_the_algorithm() {
    let model = model(&everything());
    let expected = alone(&model, 5, 10);
    for algorithm in [Algorithm::ArrayGrid, Algorithm::Naive] {
        assert!(over_by(&on_cpu().algorithm(algorithm), 3, &model, 5, 10) == expected, "{algorithm}");
    }
}

#[test]
#[cfg(feature = "gpu")]
fn pairs_found_on_a_gpu_give_the_run_of_one_process() {
    use lazygrid::Backend;
    use lazygrid::gpu::{GpuDevice, SoftwareAdapter};

    if crate::adapter::or_skip(GpuDevice::shared(SoftwareAdapter::Allow)).is_none() {
        return;
    }
    for contact in [Contact::Count, Contact::Separate] {
        let model = model(&ModelFeatures { contact, ..everything() });
        let expected = alone(&model, 6, 10);
        assert!(expected[1..].iter().all(|seen| seen.state.totals.pairs > 0));
        assert!(
            over_by(&Config::default().backend(Backend::Gpu), 3, &model, 6, 10) == expected,
            "{contact:?}"
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn every_model_equals_one_process(features in model_features(), seed in 0..1000_u64, ranks in 1..6_u32) {
        compare(&model(&features), seed, 12, &[ranks]);
    }
}

#[test]
fn migrated_products_dissociate_like_those_of_one_process() {
    // Without reactions, contacts migrate products that do not dissociate within the step.
    let features =
        ModelFeatures { contact: Contact::Count, reactions: vec![], receivers: [0; 3], ..everything() };
    compare(&model(&ModelFeatures { speed: false, arrivals: false, ..features }), 9, 12, &[2, 3]);
}

#[test]
fn dissociation_products_start_at_the_parent() {
    let species = |name: &str| Species { name: name.into(), diffusion: 1.0, mass: 1.0, ..Species::default() };
    let burst = |name: &str, species, time| Transmitter {
        name: name.into(),
        schedule: Schedule::Times(vec![time]),
        release: vec![(species, 300)],
        ..Transmitter::default()
    };
    let model = Model {
        time_step: 0.1,
        species: vec![species("whole"), species("half"), species("other")],
        decays: vec![Decay { rate: 0.5, products: [Some(1), Some(1)], ..Decay::default() }],
        transmitters: vec![burst("early", 0, 0.0), burst("late", 2, 0.5)],
        receivers: vec![Receiver {
            radius: 1.0,
            kind: ReceiverKind::Absorbing,
            sees: vec![false, true, false],
            ..Receiver::default()
        }],
        logs_arrivals: true,
        ..Model::default()
    };
    let runs = [alone(&model, 9, 30), over(3, &model, 9, 30)];
    for run in &runs {
        let arrivals: Vec<_> = run.iter().flat_map(|seen| &seen.arrivals).collect();
        assert!(arrivals.iter().filter(|arrival| arrival.id > 600).count() > 50);
        let early = Some(Origin { transmitter: 0, step: 0 });
        assert!(arrivals.iter().all(|arrival| arrival.origin == early));
    }
    assert!(runs[0] == runs[1]);
}
