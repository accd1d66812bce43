use std::sync::Arc;

use lazygrid::Algorithm;
use lazygrid_sim::{
    Adsorption, Attractant, AttractantProfile, Axis, Boundary, Chemotaxis, Contact, CountDistribution, Decay,
    Flow, FlowField, Ligand, Membrane, MembraneSurface, Model, Particles, Reaction, ReactionRate, Receiver,
    ReceiverKind, ReceptorType, Schedule, Shape, Simulation, Species, State, Transmitter, Unbinding,
};

use crate::Row;
use crate::setup::{burst, species};

fn model() -> Model {
    let reaction = |name: &str, products, unbinding_radius| Reaction {
        name: name.to_owned(),
        reactants: [0, 1],
        products,
        binding_radius: 0.3,
        unbinding_radius,
        chance: ReactionRate::PerStep(0.4),
    };
    let decay = |name: &str, reactant, products| Decay {
        name: name.to_owned(),
        reactant,
        products,
        unbinding: Unbinding::Within(0.3),
        rate: 0.5,
    };
    let steady = Transmitter {
        schedule: Schedule::Steady { from: 0.0, until: 0.5, rates: vec![(0, 300.0)] },
        numbers: CountDistribution::Poisson,
        ..burst(Shape::Gaussian(0.5), &[])
    };
    let mut late = burst(Shape::Gaussian(0.7), &[(0, 150), (1, 100)]);
    late.schedule = Schedule::Times(vec![0.1, 0.35, 0.7]);
    let receiver = |kind, x| Receiver {
        name: "rx".to_owned(),
        center: [x, 0.0, 0.0],
        radius: 0.5,
        kind,
        sees: vec![true, true, false],
        ..Receiver::default()
    };
    let ligand = |species, binding_rate| Ligand { species, binding_rate, unbinding_rate: 9.0 };
    let receptors = vec![
        ReceptorType::new(5, 9.0, 9.0, [0, 1]),
        ReceptorType { count: 7, ligands: vec![ligand(1, 20.0), ligand(0, 5.0)] },
    ];
    Model {
        time_step: 1e-3,
        species: vec![species("A", 0.1, 1.0), species("B", 0.15, 0.5), species("C", 0.2, 0.3)],
        reactions: vec![
            reaction("A + B -> C + A", [Some(2), Some(0)], 0.4),
            Reaction { reactants: [2, 2], ..reaction("C + C -> A", [Some(0), None], 0.0) },
            Reaction { reactants: [1, 2], ..reaction("B + C -> B", [Some(1), None], 0.0) },
        ],
        decays: vec![
            decay("C -> B", 2, [Some(1), None]),
            decay("C -> A + B", 2, [Some(0), Some(1)]),
            decay("A -> C", 0, [Some(2), None]),
        ],
        transmitters: vec![burst(Shape::Point, &[(0, 100), (1, 100)]), late, steady],
        receivers: vec![
            receiver(ReceiverKind::Absorbing, 2.5),
            receiver(ReceiverKind::Endpoint, -2.5),
            Receiver { velocity: [0.0, 3.0, 0.0], ..receiver(ReceiverKind::Reflecting, 1.5) },
            Receiver { diffusion: 1.0, ..receiver(ReceiverKind::Partial(Adsorption::Reactivity(3.0)), 0.0) },
            Receiver { surface_diffusion: 0.5, ..receiver(ReceiverKind::Receptors(receptors), -1.5) },
        ],
        boundary: Boundary {
            axes: [
                Axis::Reflecting { low: -3.0, high: 3.0 },
                Axis::Periodic { low: -3.0, high: 2.0 },
                Axis::Periodic { low: -3.0, high: 2.5 },
            ],
            vessel: None,
        },
        contact: Contact::Separate,
        flow: Some(Flow::Field(Arc::new(field()))),
        ..Model::default()
    }
}

fn field() -> FlowField {
    let corners = (0..8_u8).map(|k| [k >> 2, k >> 1 & 1, k & 1].map(|upper| 2.0 * f32::from(upper) - 1.0));
    let velocities = corners.flat_map(|[_, y, z]| [0.0, -z, y]);
    FlowField::new([[-3.0; 3], [6.0; 3]], [2; 3], velocities.collect()).expect("a field")
}

fn cells() -> Model {
    let profile = AttractantProfile::Source { peak: 1.0, radius: 0.5 };
    let taxis = Chemotaxis { attractant: 0, sensitivity: 2.0, half_saturation: Some(0.5) };
    let swimmer =
        Species { speed: 3.0, tumble_rate: 5.0, chemotaxis: Some(taxis), ..species("swimmer", 0.0, 0.1) };
    let membrane = |name: &str, surface, permeability| Membrane {
        name: name.to_owned(),
        surface,
        permeability,
        sees: vec![false, true],
    };
    Model {
        time_step: 0.02,
        species: vec![swimmer, species("molecule", 0.0, 1.0)],
        attractants: vec![Attractant { name: "food".to_owned(), center: [1.0, 0.0, 0.0], profile }],
        transmitters: vec![burst(Shape::Gaussian(1.0), &[(0, 5000), (1, 10_000)])],
        membranes: vec![
            membrane("cell", MembraneSurface::Sphere { center: [0.0; 3], radius: 1.0 }, 2.0),
            membrane("wall", MembraneSurface::Plane { axis: 0, position: 1.5 }, 1.0),
        ],
        boundary: Boundary::periodic([-2.0; 3], [2.0; 3]),
        ..Model::default()
    }
}

fn run(model: Model, algorithm: Algorithm, threads: usize) -> State {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
    pool.install(|| {
        let count = if model.receivers.is_empty() { 50 } else { 1000 };
        let mut simulation = Simulation::new(model, 9, algorithm).expect("a valid model");
        (0..count).for_each(|_| simulation.step().expect("a step"));
        simulation.state().clone()
    })
}

pub(crate) fn same_bytes() -> Vec<Row> {
    let reference = run(model(), Algorithm::Auto, 1);
    let mut rows = Vec::new();
    for (algorithm, threads) in [(Algorithm::Auto, 2), (Algorithm::Auto, 7)]
        .into_iter()
        .chain(Algorithm::CPU.iter().map(|&algorithm| (algorithm, 2)))
    {
        let different = u64::from(run(model(), algorithm, threads) != reference);
        rows.push(Row::exact(format!("states that differ, {algorithm}, {threads} threads"), 0, different));
    }
    let alone = run(cells(), Algorithm::Auto, 1);
    let different = u64::from(run(cells(), Algorithm::Auto, 7) != alone);
    rows.push(Row::exact("states that differ, membranes, 7 threads", 0, different));
    let totals = &reference.totals;
    let reacted = totals.reacted.iter().chain(&totals.decayed).copied().min().unwrap_or(0);
    rows.push(Row { must_differ: true, ..Row::exact("fewest reactions and decays of a kind", 0, reacted) });
    rows.push(Row::exact("particles that differ after a permutation", 0, permuted()));
    rows
}

fn permuted() -> u64 {
    let mut model = model();
    model.transmitters.truncate(1);
    model.transmitters[0].shape = Shape::Gaussian(0.7);
    let mut first = Simulation::new(model.clone(), 4, Algorithm::Auto).expect("a valid model");
    first.step().expect("a step");
    let after_one = first.state().particles.clone();
    model.transmitters.clear();
    let run = |particles: &Particles| {
        let mut simulation = Simulation::new(model.clone(), 4, Algorithm::Auto).expect("a valid model");
        simulation.insert(particles).expect("known species");
        (0..1000).for_each(|_| simulation.step().expect("a step"));
        let particles = &simulation.state().particles;
        particles.permuted(&particles.by_id())
    };
    let mut order = after_one.by_id();
    let sorted = run(&after_one.permuted(&order));
    order.reverse();
    order.rotate_left(37);
    let other = run(&after_one.permuted(&order));
    let n = sorted.len().max(other.len());
    if sorted.len() != other.len() {
        return n as u64;
    }
    (0..n).filter(|&at| sorted.get(at) != other.get(at)).count() as u64
}
