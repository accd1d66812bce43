use lazygrid::Algorithm;
use lazygrid::gpu::GpuDevice;
use lazygrid_sim::gpu::{GpuOptions, GpuSimulation};
use lazygrid_sim::model::message::{Message, Modulation, Symbols};
use lazygrid_sim::{
    Axis, Boundary, CountDistribution, Decay, Model, Particle, Reaction, ReactionRate, Receiver,
    ReceiverKind, Schedule, Shape, Simulation, Species, State, Transmitter,
};

pub(crate) fn species(name: &str, diffusion: f64, drift: [f64; 3]) -> Species {
    Species { name: name.into(), diffusion, drift, mass: 1.0, ..Species::default() }
}

pub(crate) fn reaction(
    reactants: [u32; 2],
    products: [Option<u32>; 2],
    binding_radius: f32,
    probability: f64,
) -> Reaction {
    Reaction {
        name: format!("{reactants:?}"),
        reactants,
        products,
        binding_radius,
        chance: ReactionRate::PerStep(probability),
        ..Reaction::default()
    }
}

pub(crate) fn decay(reactant: u32, product: Option<u32>, rate: f64) -> Decay {
    Decay { reactant, products: [product, None], rate, ..Decay::default() }
}

pub(crate) fn receiver(name: &str, center: [f32; 3], radius: f32, kind: ReceiverKind) -> Receiver {
    Receiver { name: name.into(), center, radius, kind, sees: vec![true; 2], ..Receiver::default() }
}

pub(crate) fn burst(shape: Shape, release: &[(u32, u32)]) -> Transmitter {
    Transmitter { name: "burst".into(), shape, release: release.to_vec(), ..Transmitter::default() }
}

pub(crate) fn lattice(center: [f32; 3], times: &[f64], species: u32, sites: u32) -> Transmitter {
    Transmitter {
        name: format!("lattice of {species}"),
        center,
        shape: Shape::Lattice([8.0; 3], [sites; 3]),
        schedule: Schedule::Times(times.to_vec()),
        release: vec![(species, sites.pow(3))],
        ..Transmitter::default()
    }
}

/// Exact: all coordinates are small multiples of a power of two.
pub(crate) fn dyadic() -> Model {
    let receiver =
        |name, center, kind| Receiver { sees: vec![true; 4], ..receiver(name, center, 1.03, kind) };
    let sized = |radius, name, drift| Species { radius, ..species(name, 0.0, drift) };
    Model {
        time_step: 1.0,
        species: vec![
            sized(0.25, "A", [0.125, 0.0, 0.25]),
            sized(0.125, "B", [-0.125, 0.0625, 0.0]),
            sized(0.0625, "C", [0.0, -0.125, 0.0]),
            sized(0.5, "E", [0.0; 3]),
        ],
        reactions: vec![
            reaction([0, 1], [Some(2), None], 0.5, 0.5),
            reaction([0, 3], [Some(1), Some(3)], 0.75, 0.25),
            reaction([2, 2], [Some(1), Some(0)], 1.0, 0.75),
            reaction([1, 3], [None, None], 0.25, 0.125),
        ],
        decays: vec![decay(2, Some(3), 0.125), decay(2, None, 0.0625), decay(1, None, 0.01)],
        transmitters: vec![
            lattice([0.0; 3], &[0.0, 7.0], 0, 8),
            lattice([0.125, 0.25, 0.0], &[0.0], 1, 16),
            lattice([0.25, 0.25, 0.25], &[0.0, 3.0, 4.0], 3, 4),
            Transmitter {
                schedule: Schedule::Steady { from: 0.5, until: 6.5, rates: vec![(2, 8.0), (0, 2.5)] },
                numbers: CountDistribution::Poisson,
                ..lattice([0.5, 0.0, 0.125], &[], 0, 1)
            },
            Transmitter {
                schedule: Schedule::Message(Message {
                    start: 1.0,
                    symbol_time: 2.0,
                    symbols: Symbols::Random { count: 8, alphabet: 2 },
                    modulation: Modulation::OnOff,
                }),
                ..lattice([-0.25, 0.0, 0.0], &[], 1, 4)
            },
        ],
        receivers: vec![
            receiver("absorbing", [2.0, 2.0, 0.0], ReceiverKind::Absorbing),
            receiver("transparent", [-2.0, 0.0, 0.5], ReceiverKind::Transparent),
            receiver("endpoint", [0.0, -2.0, 0.5], ReceiverKind::Endpoint),
        ],
        boundary: Boundary {
            axes: [
                Axis::Reflecting { low: -4.5, high: 4.5 },
                Axis::Open,
                Axis::Reflecting { low: -5.0, high: 6.0 },
            ],
            vessel: None,
        },
        ..Model::default()
    }
}

pub(crate) fn cpu(model: &Model, seed: u64) -> Simulation {
    Simulation::new(model.clone(), seed, Algorithm::Auto).expect("a model")
}

pub(crate) fn gpu(device: &GpuDevice, model: &Model, seed: u64) -> GpuSimulation {
    gpu_with(device, model, seed, GpuOptions::default())
}

pub(crate) fn gpu_with(device: &GpuDevice, model: &Model, seed: u64, options: GpuOptions) -> GpuSimulation {
    GpuSimulation::new(model.clone(), seed, device.clone(), options).expect("a model")
}

pub(crate) fn steps(run: &mut Simulation, count: u32) {
    (0..count).for_each(|_| run.step().expect("a step"));
}

pub(crate) struct Runs {
    pub(crate) gpu: GpuSimulation,
    pub(crate) cpu: Simulation,
}

impl Runs {
    pub(crate) fn new(device: &GpuDevice, model: &Model, seed: u64) -> Self {
        Self { gpu: gpu(device, model, seed), cpu: cpu(model, seed) }
    }

    pub(crate) fn steps(&mut self, count: u32) {
        self.gpu.run(count).expect("steps");
        steps(&mut self.cpu, count);
    }

    #[track_caller]
    pub(crate) fn assert_same(&self) {
        assert_same(&self.gpu.state().expect("a state"), self.cpu.state());
        assert_eq!(self.gpu.received(), self.cpu.received());
    }

    #[track_caller]
    pub(crate) fn assert_close(&self, tolerance: f32) {
        assert_close(&self.gpu.state().expect("a state"), self.cpu.state(), tolerance);
        assert_eq!(self.gpu.received(), self.cpu.received());
    }
}

pub(crate) fn by_id(state: &State) -> Vec<Particle> {
    state.particles.by_id().into_iter().map(|at| state.particles.get(at as usize)).collect()
}

#[track_caller]
pub(crate) fn assert_same(a: &State, b: &State) {
    assert_eq!((a.step, a.next_id), (b.step, b.next_id));
    assert_eq!(a.totals, b.totals);
    assert_eq!(by_id(a), by_id(b));
}

#[track_caller]
pub(crate) fn assert_close(a: &State, b: &State, tolerance: f32) {
    assert_eq!((a.step, a.next_id), (b.step, b.next_id));
    assert_eq!(a.totals, b.totals);
    let near = |a: [f32; 3], b: [f32; 3]| a.into_iter().zip(b).all(|(a, b)| (a - b).abs() <= tolerance);
    let (ours, theirs) = (by_id(a), by_id(b));
    assert_eq!(ours.len(), theirs.len());
    for (a, b) in ours.into_iter().zip(theirs) {
        assert_eq!((a.id, a.species, a.radius), (b.id, b.species, b.radius));
        assert!(near(a.position, b.position), "{a:?} {b:?}");
        let speed = b.velocity.map(f32::abs).into_iter().fold(1.0, f32::max);
        assert!(near(a.velocity.map(|v| v / speed), b.velocity.map(|v| v / speed)), "{a:?} {b:?}");
    }
    let [held, expected] = [a, b].map(|state| {
        let mut bound = state.bound.clone();
        bound.sort_unstable_by_key(|held| held.id);
        bound
    });
    assert_eq!(held.len(), expected.len());
    for (a, b) in held.into_iter().zip(expected) {
        assert_eq!((a.id, a.species, a.receiver, a.receptor), (b.id, b.species, b.receiver, b.receptor));
        assert!(near(a.direction, b.direction), "{a:?} {b:?}");
    }
    assert_eq!(a.centers, b.centers);
}

pub(crate) fn brownian(reacts: bool) -> Model {
    Model {
        time_step: 0.001,
        species: vec![species("A", 2.0, [0.0; 3]), species("B", 1.0, [0.5, 0.0, 0.0])],
        reactions: if reacts { vec![reaction([0, 1], [None, None], 0.125, 0.5)] } else { Vec::new() },
        transmitters: [0, 1].map(|species| burst(Shape::Box([4.0; 3]), &[(species, 1000)])).into(),
        boundary: Boundary::reflecting([-2.0; 3], [2.0; 3]),
        ..Model::default()
    }
}
