use lazygrid::gpu::{GpuDevice, SoftwareAdapter};
use lazygrid::{Backend, Config};
use lazygrid_ranks::Communicator;
use lazygrid_sim::gpu::{GpuOptions, GpuSimulation};
use lazygrid_sim::model::receiver::WallFace;
use lazygrid_sim::ranks::{GatherFields, RankSimulation};
use lazygrid_sim::{
    Axis, Contact, Decay, Flow, Membrane, MembraneSurface, Model, Receiver, ReceiverKind, ReceptorType,
    RunView, Shape, Species, Transmitter,
};

use crate::models::{ModelFeatures, everything, model};
use crate::steps::{Seen, alone, seen};
use crate::{on_cpu, threads};

pub(crate) fn device() -> Option<GpuDevice> {
    crate::adapter::or_skip(GpuDevice::shared(SoftwareAdapter::Allow))
}

pub(crate) fn on_gpu() -> Config {
    Config::default().backend(Backend::Gpu)
}

fn independent() -> Model {
    let features = ModelFeatures {
        contact: Contact::Ignore,
        reactions: Vec::new(),
        splits: false,
        receivers: [1, 0, 6],
        speed: false,
        ..everything()
    };
    let mut model = model(&features);
    let [x, y, z] = model.receivers.last().unwrap().center;
    model.transmitters[2].center = [x + 0.85, y, z];
    model
}

fn walls() -> Model {
    let mut model = independent();
    model.boundary.axes = [Axis::Reflecting { low: 0.0, high: 10.0 }; 3];
    model.species[0].drift = [-2.0, 0.0, -1.0];
    let wall = Receiver {
        name: "wall".into(),
        kind: ReceiverKind::Wall(WallFace::Low(0)),
        sees: vec![true, false, false, true],
        ..Receiver::default()
    };
    model.receivers.push(wall);
    model.decays.push(Decay { products: [Some(1), None], rate: 5.0, ..Decay::default() });
    model
}

fn membrane() -> Model {
    let mut model = independent();
    model.receivers.truncate(1);
    let sees: Vec<_> = model.species.iter().map(|species| !species.has_velocity()).collect();
    let surface = MembraneSurface::Sphere { center: [5.0; 3], radius: 2.0 };
    model.membranes = vec![Membrane { name: "skin".into(), surface, permeability: 20.0, sees: sees.clone() }];
    let nucleus = Receiver {
        name: "nucleus".into(),
        center: [5.0; 3],
        radius: 0.8,
        kind: ReceiverKind::Absorbing,
        sees,
        velocity: [1.0, 0.0, 0.0],
        ..Receiver::default()
    };
    model.receivers.push(nucleus);
    model
}

fn alone_on_gpu(device: &GpuDevice, model: &Model, seed: u64, batches: &[u32]) -> Vec<Seen> {
    let mut run = GpuSimulation::new(model.clone(), seed, device.clone(), GpuOptions::default()).unwrap();
    let look = |run: &GpuSimulation| seen(run.state().unwrap(), run.received(), run.arrivals());
    let mut all = vec![look(&run)];
    for &steps in batches {
        run.run(steps).unwrap();
        all.push(look(&run));
    }
    all
}

fn over_gpus(ranks: u32, model: &Model, seed: u64, batches: &[u32]) -> Vec<Seen> {
    let mut of_ranks = threads::on(ranks, |thread| {
        let mut run = RankSimulation::new(thread, model.clone(), seed, on_gpu()).unwrap();
        assert_eq!(run.backend(), Backend::Gpu);
        let look = |run: &mut RankSimulation<_>| {
            let standing = run.gather(GatherFields { received: true, particles: true }).unwrap();
            seen(standing.state().unwrap().into_owned(), standing.received(), standing.arrivals())
        };
        let mut all = vec![look(&mut run)];
        for &steps in batches {
            // Arrivals are those of the last call, which does one step if particles dissociate.
            let (end, mut arrivals) = (run.step_count() + steps, Vec::new());
            while run.step_count() < end {
                run.advance(end - run.step_count()).unwrap();
                let mut seen = look(&mut run);
                arrivals.append(&mut seen.arrivals);
                if run.step_count() == end {
                    all.push(Seen { arrivals: std::mem::take(&mut arrivals), ..seen });
                }
            }
        }
        all
    });
    of_ranks.swap_remove(0)
}

fn compare(device: &GpuDevice, model: &Model, seed: u64) -> Seen {
    let last = compare_gpus(device, model, seed, &[1, 4, 15, 10]);
    let on_cpu = alone(model, seed, 30).pop().unwrap();
    assert_eq!((&last.state.totals, last.state.next_id), (&on_cpu.state.totals, on_cpu.state.next_id));
    last
}

fn compare_gpus(device: &GpuDevice, model: &Model, seed: u64, batches: &[u32]) -> Seen {
    let expected = alone_on_gpu(device, model, seed, batches);
    for ranks in [1, 2, 3] {
        let found = over_gpus(ranks, model, seed, batches);
        for (batch, (found, expected)) in found.iter().zip(&expected).enumerate() {
            assert_eq!(found.state.totals, expected.state.totals, "{ranks} ranks after batch {batch}");
            assert!(found == expected, "{ranks} ranks differ after batch {batch}");
        }
        assert_eq!(found.len(), expected.len());
    }
    expected.into_iter().next_back().unwrap()
}

#[test]
fn ranks_on_gpus_equal_one_gpu() {
    let Some(device) = device() else { return };
    let last = compare(&device, &independent(), 3);
    let totals = &last.state.totals;
    assert!(totals.decayed.iter().all(|&count| count > 10), "{totals:?}");
    assert!(totals.arrived[1..].iter().flatten().sum::<u64>() > 100, "{totals:?}");
    let since_release =
        |arrival: &&lazygrid_sim::Arrival| arrival.origin.is_some_and(|origin| origin.step == arrival.step);
    assert!(last.arrivals.iter().filter(since_release).count() > 5);
}

#[test]
fn walls_flow_and_membranes_on_the_gpus_of_ranks_equal_one_gpu() {
    let Some(device) = device() else { return };
    let totals = compare(&device, &walls(), 4).state.totals;
    assert!(totals.arrived.last().unwrap()[0] > 0, "{totals:?}");
    let totals = compare(&device, &membrane(), 5).state.totals;
    assert!(totals.arrived.last().unwrap().iter().sum::<u64>() > 0, "{totals:?}");
    let flow = Some(Flow::Plug([0.5, 0.0, 0.0]));
    compare(&device, &Model { flow, logs_arrivals: false, ..independent() }, 6);
}

#[test]
fn dissociations_on_the_gpus_of_ranks_equal_one_gpu() {
    let Some(device) = device() else { return };
    let mut model = Model { decays: model(&everything()).decays, ..independent() };
    model.decays[3].rate = 4.0;
    let half = Decay { reactant: 0, products: [Some(1), Some(1)], rate: 1.0, ..Decay::default() };
    model.decays.push(half);
    for logs_arrivals in [true, false] {
        let model = Model { logs_arrivals, ..model.clone() };
        let last = compare(&device, &model, 9);
        let totals = &last.state.totals;
        assert!(totals.decayed[2..].iter().all(|&count| count > 20), "{totals:?}");
        assert!(u64::from(last.state.next_id) > totals.released.iter().sum::<u64>() + 40, "{totals:?}");
    }
}

/// Most requests are refused: the types have 3 and 2 receptors.
#[test]
fn receptors_on_the_gpus_of_ranks_equal_one_gpu() {
    let Some(device) = device() else { return };
    let receivers = model(&ModelFeatures { receivers: [1, 2, 2], ..everything() }).receivers;
    let mut model = Model { receivers, ..independent() };
    let centers = [[5.0, 5.0, 7.9], [2.2, 1.0, 1.0]];
    for (receiver, center) in model.receivers[1..].iter_mut().zip(centers) {
        receiver.center = center;
    }
    let last = compare(&device, &model, 10);
    let totals = &last.state.totals;
    assert!(totals.occupied.iter().sum::<u64>() > 3 && last.state.bound.len() > 3, "{totals:?}");
    for receiver in &mut model.receivers {
        if let ReceiverKind::Receptors(kinds) = &mut receiver.kind {
            kinds.iter_mut().for_each(|kind| kind.count *= 1000);
        }
    }
    assert!(compare(&device, &model, 11).state.bound.len() > 20);
}

/// On 1 and 2 ranks, the second products of a step exceed the initial capacity of 4096.
#[test]
fn steps_repeated_with_more_capacity_equal_one_gpu() {
    let Some(device) = device() else { return };
    let mut model = independent();
    let receptors = vec![ReceptorType::new(20, 500.0, 3.0, [0, 1])];
    model.receivers = vec![Receiver {
        name: "cell".into(),
        center: [5.0; 3],
        radius: 0.5,
        kind: ReceiverKind::Receptors(receptors),
        sees: vec![true; 4],
        ..Receiver::default()
    }];
    model.decays.push(Decay { reactant: 2, products: [Some(0), Some(1)], rate: 60.0, ..Decay::default() });
    let shell = Transmitter { release: vec![(2, 20_000)], ..model.transmitters[0].clone() };
    model.transmitters = vec![Transmitter { shape: Shape::Shell(0.6, 2.0), ..shell }];
    let state = compare_gpus(&device, &model, 12, &[1, 4]).state;
    assert!(state.totals.decayed[2] > 10_000 && state.bound.len() == 20, "{:?}", state.totals);
}

#[test]
fn velocities_on_the_gpus_of_ranks_equal_one_gpu() {
    let Some(device) = device() else { return };
    let mut model = independent();
    model.receivers.truncate(1);
    model.species[3].thermal_speed = 2.0;
    let particles = compare(&device, &model, 8).state.particles;
    assert!(particles.velocity[0].iter().any(|&v| v != 0.0));
}

#[test]
fn ranks_without_particles_on_gpus_equal_one_gpu() {
    let Some(device) = device() else { return };
    let few = Transmitter { release: vec![(0, 2)], ..Transmitter::default() };
    compare(&device, &Model { transmitters: vec![few], ..independent() }, 7);
}

#[test]
fn particles_that_react_touch_or_lack_a_gpu_move_on_the_cpu() {
    let Some(_) = device() else { return };
    let reactions = Model { reactions: model(&everything()).reactions, ..independent() };
    let contacts = Model { contact: Contact::Count, ..independent() };
    let mut drifting = independent();
    let moving = Receiver { velocity: [900.0, 0.0, 0.0], ..drifting.receivers.pop().unwrap() };
    drifting.receivers = vec![moving; 200];
    for (name, model) in [("reactions", reactions), ("contacts", contacts), ("drift", drifting)] {
        assert!(backends(&model, |_| on_gpu()) == [Backend::Cpu; 2], "{name}");
    }
    assert_eq!(
        backends(&independent(), |rank| if rank == 0 { on_gpu() } else { on_cpu() }),
        [Backend::Cpu; 2]
    );
    assert_eq!(backends(&independent(), |_| Config::default()), [Backend::Cpu; 2]);
    assert_eq!(backends(&independent(), |_| Config::default().adapter(0)), [Backend::Gpu; 2]);
}

fn backends(model: &Model, detector: impl Fn(u32) -> Config + Sync) -> Vec<Backend> {
    threads::on(2, |thread| {
        let config = detector(thread.rank());
        let mut run = RankSimulation::new(thread, model.clone(), 1, config).unwrap();
        run.step().unwrap();
        run.backend()
    })
}

#[test]
fn failure_on_the_gpu_of_one_rank_is_returned_on_all() {
    if device().is_none() {
        return;
    }
    let mirror = |k: u32| Receiver {
        name: "mirror".into(),
        center: [k % 5, k / 5, 0].map(|c| 0.25 * c as f32 - 0.5),
        radius: 0.0625,
        kind: ReceiverKind::Reflecting,
        sees: vec![true],
        ..Receiver::default()
    };
    let one = Transmitter { center: [0.1; 3], release: vec![(0, 1)], ..Transmitter::default() };
    let model = Model {
        time_step: 1.0,
        species: vec![Species { name: "a".into(), diffusion: 2.0, mass: 1.0, ..Species::default() }],
        transmitters: vec![one],
        receivers: (0..25).map(mirror).collect(),
        ..Model::default()
    };
    let messages = threads::on(3, |thread| -> Result<_, String> {
        let mut run = RankSimulation::new(thread, model.clone(), 1, on_gpu())?;
        let again = [run.advance(5).unwrap_err(), run.advance(5).unwrap_err()];
        assert!(run.gather(GatherFields::default()).is_err());
        Ok(again)
    });
    let messages: Vec<_> = messages.into_iter().map(Result::unwrap).collect();
    assert!(
        messages[0][0].starts_with("rank 0: ") && messages[0][0].contains("surfaces within reach"),
        "{messages:?}"
    );
    assert!(messages[0][1].contains("an earlier step failed"), "{messages:?}");
    assert_eq!(messages, vec![messages[0].clone(); 3]);
    let mut broken = independent();
    broken.species[0].diffusion = -1.0;
    let messages =
        threads::on(2, |thread| RankSimulation::new(thread, broken.clone(), 1, on_gpu()).map(|_| ()));
    assert!(messages[0].is_err() && messages[0] == messages[1], "{messages:?}");
}
