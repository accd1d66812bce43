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

pub(crate) fn lattice(center: [f32; 3], times: &[f64], species: u32, places: u32) -> Transmitter {
    Transmitter {
        name: format!("lattice of {species}"),
        center,
        shape: Shape::Lattice([8.0; 3], [places; 3]),
        schedule: Schedule::Times(times.to_vec()),
        release: vec![(species, places.pow(3))],
        ..Transmitter::default()
    }
}

/// Exact: all coordinates are small multiples of a power of two.
pub(crate) fn dyadic() -> Model {
    let receiver = |name: &str, center, kind| Receiver {
        name: name.into(),
        center,
        radius: 1.03,
        kind,
        sees: vec![true; 4],
        ..Receiver::default()
    };
    let decay = |reactant, product, rate| Decay {
        name: format!("decay of {reactant}"),
        reactant,
        products: [product, None],
        rate,
        ..Decay::default()
    };
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

pub(crate) fn gpu(own: &GpuDevice, model: &Model, seed: u64, options: GpuOptions) -> GpuSimulation {
    GpuSimulation::new(model.clone(), seed, own.clone(), options).expect("a model")
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

pub(crate) fn brownian(reacts: bool) -> Model {
    let burst = |species: u32| Transmitter {
        name: format!("{species}"),
        center: [0.0; 3],
        shape: Shape::Box([4.0; 3]),
        release: vec![(species, 1000)],
        ..Transmitter::default()
    };
    Model {
        time_step: 0.001,
        species: vec![species("A", 2.0, [0.0; 3]), species("B", 1.0, [0.5, 0.0, 0.0])],
        reactions: if reacts { vec![reaction([0, 1], [None, None], 0.125, 0.5)] } else { Vec::new() },
        transmitters: vec![burst(0), burst(1)],
        boundary: Boundary::reflecting([-2.0; 3], [2.0; 3]),
        ..Model::default()
    }
}
