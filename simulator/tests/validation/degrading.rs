use lazygrid_sim::model::receiver::WallFace;
use lazygrid_sim::{
    Axis, Boundary, Decay, Model, Reaction, ReactionRate, Receiver, ReceiverKind, Schedule, Shape,
    Transmitter,
};

use crate::Row;
use crate::setup::{BackendRun, burst, receiver, run_for, species};

const D: f64 = 100.0;
const R: f64 = 5.0;
const RATE: f64 = 5.0;
/// From the release to the surface, in µm.
const HEIGHT: f64 = 5.0;
const TIME: f64 = 0.5;
const N: u32 = 40_000;

/// Fraction that diffuses from a height to a plane before it decays. A sphere has R/(R + height) of it.
fn reached(rate: f64, time: f64) -> f64 {
    let (decay, length) = (HEIGHT * (rate / D).sqrt(), HEIGHT / (4.0 * D * time).sqrt());
    let term = |sign: f64| (sign * decay).exp() * libm::erfc(length + sign * (rate * time).sqrt());
    0.5 * (term(-1.0) + term(1.0))
}

fn decay(products: [Option<u32>; 2], reactant: u32) -> Decay {
    Decay { reactant, products, rate: RATE, ..Decay::default() }
}

fn model(time_step: f64, kind: ReceiverKind) -> Model {
    let center = [(R + HEIGHT) as f32, 0.0, 0.0];
    Model {
        time_step,
        species: vec![species("A", 0.0, D), species("B", 0.0, D)],
        decays: vec![decay([None; 2], 0)],
        transmitters: vec![Transmitter { center, ..burst(Shape::Point, &[(0, N)]) }],
        receivers: vec![Receiver { sees: vec![true, false], ..receiver(R, kind) }],
        ..Model::default()
    }
}

fn wall(time_step: f64) -> Model {
    let mut model = model(time_step, ReceiverKind::Wall(WallFace::Low(0)));
    model.receivers[0].radius = 0.0;
    model.transmitters[0].center[0] = HEIGHT as f32;
    let axes = [Axis::Reflecting { low: 0.0, high: 1e4 }, Axis::Open, Axis::Open];
    Model { boundary: Boundary { axes, vessel: None }, ..model }
}

fn after(model: &Model, time: f64, seed: u64) -> BackendRun {
    run_for(model, seed, (time / model.time_step).round() as u32)
}

fn fraction(what: impl Into<String>, expected: f64, count: u64) -> Row {
    Row::fraction(what, expected, count as f64 / f64::from(N), N)
}

fn arrived(simulation: &BackendRun) -> u64 {
    simulation.received()[0].iter().sum()
}

fn dissociating(time_step: f64, seed: u64) -> Vec<Row> {
    let with_products = |model: Model| Model { decays: vec![decay([Some(1); 2], 0)], ..model };
    let sphere = after(&with_products(model(time_step, ReceiverKind::Absorbing)), TIME, seed);
    let plane = after(&with_products(wall(time_step)), TIME, seed);
    let named = |what: &str| format!("dissociation, {what}, steps of {time_step} s");
    let all = 2 * arrived(&sphere)
        + sphere.state().totals.present.iter().zip([2, 1]).map(|(n, k)| n * k).sum::<u64>();
    vec![
        fraction(named("sphere"), R / (R + HEIGHT) * reached(RATE, TIME), arrived(&sphere)),
        fraction(named("plane"), reached(RATE, TIME), arrived(&plane)),
        Row::exact(named("all"), 2 * u64::from(N), all),
    ]
}

/// E consumes each A within its binding radius at the end of the step, so none arrives or dissociates.
fn consumed(time_step: f64, seed: u64) -> Row {
    let mut model = model(time_step, ReceiverKind::Absorbing);
    model.species.push(species("E", 0.0, 0.0));
    model.receivers[0].sees.push(false);
    model.transmitters[0].release.push((2, 1));
    model.decays = vec![decay([Some(1); 2], 0)];
    model.reactions = vec![Reaction {
        reactants: [0, 2],
        products: [None, Some(2)],
        binding_radius: 1e3,
        chance: ReactionRate::PerStep(1.0),
        ..Reaction::default()
    }];
    let reacted = after(&model, time_step, seed).state().totals.reacted[0];
    let remains = 1.0 - R / (R + HEIGHT) * reached(0.0, time_step);
    fraction("dissociation and reaction", (-RATE * time_step).exp() * remains, reacted)
}

pub(crate) fn degrading() -> Vec<Row> {
    let sphere = |time_step| model(time_step, ReceiverKind::Absorbing);
    let mut rows = Vec::new();
    for (seed, time_step) in (1..).zip([0.1, 0.02, 0.005]) {
        let onto = |what: &str| format!("{what}, steps of {time_step} s");
        let at_sphere = arrived(&after(&sphere(time_step), TIME, seed));
        rows.push(fraction(onto("sphere"), R / (R + HEIGHT) * reached(RATE, TIME), at_sphere));
        let at_wall = arrived(&after(&wall(time_step), TIME, 10 + seed));
        rows.push(fraction(onto("plane"), reached(RATE, TIME), at_wall));
    }
    let mut everywhere = model(0.1, ReceiverKind::Endpoint);
    everywhere.receivers[0].radius = 1e4;
    rows.push(fraction("endpoint", (-RATE * 0.1).exp(), arrived(&after(&everywhere, 0.1, 20))));
    rows.extend(products(&sphere(0.1)));
    rows.extend(dissociating(0.1, 24));
    rows.extend(dissociating(0.02, 25));
    rows.push(consumed(0.1, 26));
    rows.push(since_the_release(&sphere(0.1)));
    rows
}

fn products(sphere: &Model) -> Vec<Row> {
    let mut chain = sphere.clone();
    chain.decays = vec![decay([Some(1), None], 0), decay([None; 2], 1)];
    let unseen = after(&chain, TIME, 21);
    let totals = &unseen.state().totals;
    let all = arrived(&unseen) + totals.present.iter().sum::<u64>() + totals.decayed[1];
    chain.decays.truncate(1);
    chain.receivers[0].sees = vec![true; 2];
    let seen = after(&chain, TIME, 22);
    let reached_fraction = R / (R + HEIGHT);
    vec![
        fraction("unseen product, reactant", reached_fraction * reached(RATE, TIME), arrived(&unseen)),
        Row::exact("unseen product, arrivals", 0, unseen.received()[0][1]),
        Row::exact("unseen product, all", N.into(), all),
        fraction("seen product, reactant", reached_fraction * reached(RATE, TIME), seen.received()[0][0]),
        fraction("seen product, both", reached_fraction * reached(0.0, TIME), arrived(&seen)),
    ]
}

/// Arrivals are the mean over ages since the release.
fn since_the_release(sphere: &Model) -> Row {
    let time = sphere.time_step;
    let rates = vec![(0, f64::from(N) / time)];
    let mut model = sphere.clone();
    model.transmitters[0].release.clear();
    model.transmitters[0].schedule = Schedule::Steady { from: 0.0, until: time, rates };
    let intervals = 1000;
    let ages = (0..intervals).map(|k| (f64::from(k) + 0.5) / f64::from(intervals) * time);
    let mean = ages.map(|age| reached(RATE, age)).sum::<f64>() / f64::from(intervals);
    fraction("continuous release", R / (R + HEIGHT) * mean, arrived(&after(&model, time, 23)))
}
