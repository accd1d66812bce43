//! Ranks whose particles move on GPUs, against one process on a GPU, which they equal bit for bit, and the CPU.

use std::ops::ControlFlow;

use lazygrid::gpu::{GpuDevice, SoftwareAdapter};
use lazygrid::{Backend, Config};
use lazygrid_ranks::Communicator;
use lazygrid_sim::gpu::{GpuOptions, GpuSimulation};
use lazygrid_sim::model::receiver::WallFace;
use lazygrid_sim::ranks::{GatherFields, RankSimulation};
use lazygrid_sim::run::RunEnd;
use lazygrid_sim::run::checkpoint::Checkpoint;
use lazygrid_sim::{
    Axis, Contact, Decay, Flow, Membrane, MembraneSurface, Model, Receiver, ReceiverKind, RunView, Species,
    Transmitter,
};

use crate::files::{files, go, go_on, run_of, state};
use crate::models::{Parts, everything, model};
use crate::steps::{Seen, alone, seen};
use crate::{on_cpu, threads};

fn device() -> Option<GpuDevice> {
    crate::adapter::or_skip(GpuDevice::shared(SoftwareAdapter::Allow))
}

fn on_gpu() -> Config {
    Config::default().backend(Backend::Gpu)
}

/// Returns a model in which ranks are independent of each other within a step.
fn independent() -> Model {
    let parts = Parts {
        contact: Contact::Ignore,
        reactions: Vec::new(),
        splits: false,
        receivers: [1, 0, 6],
        speed: false,
        ..everything()
    };
    let mut model = model(&parts);
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

/// Returns the runs of one process at the ends of batches.
fn alone_on_gpu(own: &GpuDevice, model: &Model, seed: u64, batches: &[u32]) -> Vec<Seen> {
    let mut run = GpuSimulation::new(model.clone(), seed, own.clone(), GpuOptions::default()).unwrap();
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
            run.advance(steps).unwrap();
            all.push(look(&mut run));
        }
        all
    });
    of_ranks.swap_remove(0)
}

/// Compares runs over 1, 2 and 3 ranks with one process on the GPU, and their counts with those of the CPU.
fn compare(own: &GpuDevice, model: &Model, seed: u64) -> Seen {
    let batches = [1, 4, 15, 10];
    let expected = alone_on_gpu(own, model, seed, &batches);
    for ranks in [1, 2, 3] {
        let found = over_gpus(ranks, model, seed, &batches);
        for (batch, (found, expected)) in found.iter().zip(&expected).enumerate() {
            assert_eq!(found.state.totals, expected.state.totals, "{ranks} ranks after batch {batch}");
            assert!(found == expected, "{ranks} ranks differ after batch {batch}");
        }
        assert_eq!(found.len(), expected.len());
    }
    let last = expected.into_iter().next_back().unwrap();
    let on_cpu = alone(model, seed, 30).pop().unwrap();
    assert_eq!((&last.state.totals, last.state.next_id), (&on_cpu.state.totals, on_cpu.state.next_id));
    last
}

#[test]
fn ranks_on_gpus_equal_one_gpu() {
    let Some(own) = device() else { return };
    let last = compare(&own, &independent(), 3);
    let totals = &last.state.totals;
    assert!(totals.decayed.iter().all(|&count| count > 10), "{totals:?}");
    assert!(totals.arrived[1..].iter().flatten().sum::<u64>() > 100, "{totals:?}");
    let since_release =
        |arrival: &&lazygrid_sim::Arrival| arrival.origin.is_some_and(|origin| origin.step == arrival.step);
    assert!(last.arrivals.iter().filter(since_release).count() > 5);
}

#[test]
fn walls_flow_and_membranes_on_the_gpus_of_ranks_equal_one_gpu() {
    let Some(own) = device() else { return };
    let totals = compare(&own, &walls(), 4).state.totals;
    assert!(totals.arrived.last().unwrap()[0] > 0, "{totals:?}");
    let totals = compare(&own, &membrane(), 5).state.totals;
    assert!(totals.arrived.last().unwrap().iter().sum::<u64>() > 0, "{totals:?}");
    let flow = Some(Flow::Plug([0.5, 0.0, 0.0]));
    compare(&own, &Model { flow, logs_arrivals: false, ..independent() }, 6);
}

#[test]
fn velocities_on_the_gpus_of_ranks_equal_one_gpu() {
    let Some(own) = device() else { return };
    let mut model = independent();
    model.receivers.truncate(1);
    model.species[3].thermal_speed = 2.0;
    let particles = compare(&own, &model, 8).state.particles;
    assert!(particles.velocity[0].iter().any(|&v| v != 0.0));
}

#[test]
fn ranks_without_particles_on_gpus_equal_one_gpu() {
    let Some(own) = device() else { return };
    let few = Transmitter { release: vec![(0, 2)], ..Transmitter::default() };
    compare(&own, &Model { transmitters: vec![few], ..independent() }, 7);
}

#[test]
fn particles_move_on_the_cpu_if_ranks_depend_on_each_other_or_lack_a_gpu() {
    let Some(_) = device() else { return };
    let reactions = Model { reactions: model(&everything()).reactions, ..independent() };
    let splits = Model { decays: model(&everything()).decays, ..independent() };
    let contacts = Model { contact: Contact::Count, ..independent() };
    let receptors = Model { receivers: model(&everything()).receivers, ..independent() };
    let mut drifting = independent();
    drifting.receivers.last_mut().unwrap().velocity = [900.0, 0.0, 0.0];
    for (name, model) in [
        ("reactions", reactions),
        ("splits", splits),
        ("contacts", contacts),
        ("receptors", receptors),
        ("drift", drifting),
    ] {
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
        let own = detector(thread.rank());
        let mut run = RankSimulation::new(thread, model.clone(), 1, own).unwrap();
        run.step().unwrap();
        run.backend()
    })
}

/// Only the last of three ranks has the particle that leaves the range of numbers.
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
    let said = threads::on(3, |thread| {
        let mut run = RankSimulation::new(thread, model.clone(), 1, on_gpu())?;
        run.advance(5)
    });
    let said: Vec<_> = said.into_iter().map(Result::unwrap_err).collect();
    assert!(said[0].starts_with("rank 2: ") && said[0].contains("surfaces within reach"), "{said:?}");
    assert_eq!(said, vec![said[0].clone(); 3]);
    let mut broken = independent();
    broken.species[0].diffusion = -1.0;
    let said = threads::on(2, |thread| RankSimulation::new(thread, broken.clone(), 1, on_gpu()).map(|_| ()));
    assert!(said[0].is_err() && said[0] == said[1], "{said:?}");
}

const SCENARIO: &str = r#"
time-step = 0.01
steps = 90
seed = 7

[boundary]
kind = "periodic"
low = [0, 0, 0]
high = [8, 8, 8]

[[species]]
name = "a"
radius = 0.1
diffusion = 4

[[species]]
name = "b"
radius = 0.2
diffusion = 2

[[decay]]
equation = "a -> b"
rate = 2

[[decay]]
equation = "b ->"
rate = 1

[[transmitter]]
name = "source"
center = [4, 4, 4]
times = [0, 0.2, 0.75]
shape = { kind = "ball", radius = 2 }
release = [{ species = "a", count = 200 }, { species = "b", count = 101 }]

[[transmitter]]
name = "spring"
center = [3, 4, 5]
release = [{ species = "a", rate = 300 }]

[[receiver]]
name = "sink"
center = [6, 4, 4]
radius = 1
kind = "absorbing"
species = ["a"]

[[receiver]]
name = "window"
center = [2, 4, 4]
radius = 1.5
kind = "transparent"

[output]
every = 15
frames-every = 30
frames = ["xyz", "npy"]
arrivals = true
"#;

#[test]
fn files_of_ranks_on_gpus_equal_one_gpu() {
    if device().is_none() {
        return;
    }
    let run = |directory: &tempfile::TempDir, steps, resume| {
        let run = run_of(SCENARIO, directory.path(), steps, resume);
        lazygrid_sim::run::Run { backend: Backend::Gpu, ..run }
    };
    let alone = tempfile::tempdir().unwrap();
    go(&run(&alone, 90, false), 0);
    let expected = files(alone.path());
    assert!(expected["arrivals.csv"].len() > 1000, "{:?}", expected.keys());
    // Numbers of ranks up to steps 37, 64 and 90; 0 is one process.
    for numbers in [[1, 1, 1], [2, 3, 0], [0, 3, 2]] {
        let over = tempfile::tempdir().unwrap();
        for (k, (ranks, steps)) in numbers.into_iter().zip([37, 64, 90]).enumerate() {
            go_on(&on_gpu(), &run(&over, steps, k > 0), ranks);
            let checkpoint = Checkpoint::read(&over.path().join("checkpoint")).unwrap();
            assert_eq!((checkpoint.backend.as_str(), checkpoint.state.step), (Backend::Gpu.name(), steps));
        }
        let found = files(over.path());
        assert!(expected.keys().eq(found.keys()), "{:?}", found.keys());
        for (name, expected) in &expected {
            assert!(found[name] == *expected, "{name} on {numbers:?} ranks");
        }
        assert_eq!(state(over.path()), state(alone.path()));
    }
}

/// GPUs, then the CPU, then GPUs again.
#[test]
fn a_run_changes_between_gpus_and_cpus_of_ranks() {
    if device().is_none() {
        return;
    }
    let mut runs = [0, 3].map(|ranks| {
        let directory = tempfile::tempdir().unwrap();
        let parts = [(30, Backend::Gpu), (60, Backend::Cpu), (90, Backend::Gpu)];
        for (k, (steps, backend)) in parts.into_iter().enumerate() {
            let run = run_of(SCENARIO, directory.path(), steps, k > 0);
            let run = lazygrid_sim::run::Run { backend, ..run };
            go_on(&Config::default().backend(backend), &run, ranks.min(2 + k as u32));
        }
        (files(directory.path()), state(directory.path()))
    });
    let [alone, over] = &mut runs;
    assert!(alone == over);
    assert!(alone.1.totals.arrived[0][0] > 100, "{:?}", alone.1.totals);
}

#[test]
fn one_rank_stops_all_gpus_and_the_run_can_continue() {
    if device().is_none() {
        return;
    }
    let directory = tempfile::tempdir().unwrap();
    let first = run_of(SCENARIO, directory.path(), 90, false);
    let ends = threads::on(3, |thread| {
        let rank = thread.rank();
        let ask =
            |step| if rank == 1 && step >= 17 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
        first.run_distributed(thread, on_gpu(), ask).map(|(end, simulation)| (end, simulation.step_count()))
    });
    // Batches end at outputs, which are multiples of 5 here.
    assert_eq!(ends, vec![Ok((RunEnd::Stopped, 20)); 3]);
    assert_eq!(state(directory.path()).step, 20);
    go_on(&on_gpu(), &run_of(SCENARIO, directory.path(), 90, true), 2);
    assert_eq!(state(directory.path()).step, 90);
}
