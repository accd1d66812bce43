use lazygrid_sim::{
    Contact, Error, Model, Receiver, ReceiverKind, ReceptorType, Schedule, Shape, Species, Transmitter,
};

use super::device;
use super::features::dissociating;
use super::models::{brownian, burst, decay, gpu, receiver, species};

/// A particle may meet 16 of these mirrors in a step.
fn mirrors(center: [f32; 3], count: u32) -> impl Iterator<Item = Receiver> {
    (0..count).map(move |k| {
        let center = [center[0], center[1], center[2] + 1e-3 * k as f32];
        receiver("mirror", center, 0.25, ReceiverKind::Reflecting)
    })
}

#[test]
fn halts_do_not_depend_on_the_order_of_threads() {
    let Some(device) = device() else { return };
    let mut model = brownian(false);
    model.time_step = 0.01;
    model.receivers = mirrors([1.0, 0.0, 0.0], 21).chain(mirrors([-1.0, 0.0, 0.0], 17)).collect();
    for seed in 0..4 {
        let mut run = gpu(&device, &model, seed);
        let error = run.run(1).expect_err("too many surfaces");
        let Error::Step { source: lazygrid::Error::LimitExceeded { needed, limit, .. }, .. } = error else {
            panic!("{error}");
        };
        assert_eq!((needed, limit), (21, 16), "seed {seed}");
    }
}

/// The fourth species, released after six steps, meets too many mirrors.
fn halting() -> Model {
    let mut model = dissociating();
    model.species[0].speed = 10.0;
    model.species.push(species("D", 2.0, [0.0; 3]));
    let receptors = vec![ReceptorType::new(400, 40.0, 60.0, [0, 1])];
    model.receivers.push(receiver("cell", [0.0, -1.25, 0.0], 0.5, ReceiverKind::Receptors(receptors)));
    for receiver in &mut model.receivers {
        receiver.sees.resize(4, false);
    }
    let only_last = |mirror| Receiver { sees: vec![false, false, false, true], ..mirror };
    model.receivers.extend(mirrors([0.0, 1.25, 0.0], 17).map(only_last));
    model.transmitters.push(Transmitter {
        center: [0.0, 1.53, 0.0],
        schedule: Schedule::Times(vec![0.006]),
        ..burst(Shape::Point, &[(3, 50)])
    });
    model
}

#[test]
fn failed_run_has_the_state_before_the_failed_step() {
    let Some(device) = device() else { return };
    let dissociating = halting();
    let batches = Model { decays: vec![decay(2, Some(0), 200.0)], ..halting() };
    let still = |species: &Species| Species { speed: 0.0, radius: 0.05, ..species.clone() };
    let mut collisions = Model { contact: Contact::Separate, ..batches.clone() };
    collisions.species = collisions.species.iter().map(still).collect();
    for (k, model) in [dissociating, batches, collisions].into_iter().enumerate() {
        let [mut failed, mut stopped] = [gpu(&device, &model, 33), gpu(&device, &model, 33)];
        let error = failed.run(9).expect_err("too many surfaces");
        let Error::Step { step: 6, source: lazygrid::Error::LimitExceeded { limit: 16, .. } } = error else {
            panic!("model {k}: {error}");
        };
        stopped.run(6).expect("steps");
        let [state, expected] = [&failed, &stopped].map(|run| run.state().expect("a state"));
        assert_eq!(state.step, 6, "model {k}");
        assert_eq!(state.totals, expected.totals, "model {k}");
        assert!(state == expected, "model {k}: another state");
        assert_eq!(failed.received(), stopped.received(), "model {k}");
        assert_eq!(failed.arrivals(), stopped.arrivals(), "model {k}");
        assert!(!state.bound.is_empty() && !failed.arrivals().is_empty(), "model {k}");
        assert_eq!(state.totals.contacts > 0, k == 2, "model {k}");
    }
}
