use lazygrid_sim::model::receiver::WallFace;
use lazygrid_sim::{Decay, Model, ReceiverKind, Shape, Unbinding};

use super::device;
use super::models::{Runs, brownian, burst, decay, reaction, receiver, species};
use super::surfaces::surfaces;

fn degrading() -> Model {
    let mut model = surfaces();
    model.time_step = 0.02;
    model.decays = vec![decay(0, Some(1), 40.0), decay(1, Some(0), 30.0), decay(1, None, 10.0)];
    for (name, face) in [("low", WallFace::Low(0)), ("high", WallFace::High(1)), ("end", WallFace::High(2))] {
        model.receivers.push(receiver(name, [0.0; 3], 0.0, ReceiverKind::Wall(face)));
    }
    for (name, sees) in [("rate", [true, false]), ("absorber", [false, true]), ("low", [true, false])] {
        let receiver = model.receivers.iter_mut().find(|receiver| receiver.name == name);
        receiver.expect("a receiver").sees = sees.to_vec();
    }
    model.logs_arrivals = true;
    model
}

#[test]
fn dissociations_before_hits_match_the_cpu() {
    let mut model = degrading();
    model.decays.truncate(1);
    model.decays[0].rate = 10.0;
    model.decays.push(Decay {
        reactant: 1,
        products: [Some(0); 2],
        rate: 20.0,
        unbinding: Unbinding::Apart(0.05),
        ..Decay::default()
    });
    let Some(device) = device() else { return };
    for seed in [73, 74] {
        let mut runs = Runs::new(&device, &model, seed);
        let logged = compare_arrivals(&mut runs, 4);
        let totals = &runs.cpu.state().totals;
        assert!(totals.decayed[1] > 300, "{totals:?}");
        assert!(logged.concat().iter().sum::<u64>() > 100, "{logged:?}");
        assert_logged(&runs, logged);
    }
}

#[test]
fn particles_that_dissociate_react_as_on_the_cpu() {
    let Some(device) = device() else { return };
    let mut model = brownian(false);
    model.time_step = 0.02;
    model.reactions = vec![
        reaction([0, 1], [None, Some(1)], 0.25, 0.5),
        reaction([0, 1], [Some(0), None], 0.375, 0.5),
        reaction([1, 1], [Some(0), None], 0.25, 0.75),
    ];
    let dissociation = |reactant, product, rate| Decay {
        reactant,
        products: [Some(product); 2],
        rate,
        unbinding: Unbinding::Apart(0.05),
        ..Decay::default()
    };
    model.decays = vec![dissociation(0, 1, 10.0), dissociation(1, 0, 30.0)];
    model.decays.extend([decay(2, Some(0), 20.0), decay(2, Some(1), 30.0)]);
    model.species.push(species("C", 1.0, [0.0; 3]));
    model.transmitters.push(burst(Shape::Box([4.0; 3]), &[(2, 2000)]));
    let mut runs = Runs::new(&device, &model, 75);
    for _ in 0..4 {
        runs.steps(1);
        runs.assert_close(2e-4);
    }
    let totals = &runs.cpu.state().totals;
    assert!(totals.reacted.iter().chain(&totals.decayed).all(|&count| count > 50), "{totals:?}");
}

fn compare_arrivals(runs: &mut Runs, steps: u32) -> Vec<[u64; 2]> {
    let mut logged = vec![[0; 2]; runs.cpu.model().receivers.len()];
    for _ in 0..steps {
        runs.steps(1);
        assert_eq!(runs.gpu.arrivals(), runs.cpu.arrivals());
        for arrival in runs.cpu.arrivals() {
            logged[arrival.receiver as usize][arrival.species as usize] += 1;
        }
        runs.assert_close(2e-4);
    }
    logged
}

#[track_caller]
fn assert_logged(runs: &Runs, logged: Vec<[u64; 2]>) {
    for ((receiver, row), logged) in runs.cpu.model().receivers.iter().zip(runs.cpu.received()).zip(logged) {
        let is_logged = receiver.kind.absorbs();
        assert!(!is_logged || row == logged, "{}: {row:?} and {logged:?}", receiver.name);
    }
}

#[test]
fn decays_before_hits_match_the_cpu() {
    let Some(device) = device() else { return };
    let reflecting = degrading();
    let mut passing = reflecting.clone();
    passing.receivers.retain(|receiver| !receiver.kind.reflects());
    for (seed, model) in [(71, reflecting), (72, passing)] {
        let mut runs = Runs::new(&device, &model, seed);
        let logged = compare_arrivals(&mut runs, 5);
        let totals = &runs.cpu.state().totals;
        assert!(totals.decayed.iter().all(|&count| count > 300), "{totals:?}");
        assert_logged(&runs, logged);
        for (receiver, row) in model.receivers.iter().zip(runs.cpu.received()) {
            let may_arrive = receiver.kind != ReceiverKind::Reflecting;
            let expected = [0, 1].map(|species| may_arrive && receiver.sees[species]);
            assert_eq!(expected, [row[0] > 0, row[1] > 0], "{}: {row:?}", receiver.name);
        }
    }
}
