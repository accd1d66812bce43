use lazygrid_sim::{
    Adsorption, Axis, Boundary, Contact, Decay, Model, Reaction, ReactionRate, Receiver, ReceiverKind,
    ReceptorType, Schedule, Shape, Species, Transmitter, Unbinding,
};
use proptest::prelude::*;

#[derive(Clone, Debug)]
pub(crate) struct ModelFeatures {
    pub(crate) periodic: bool,
    pub(crate) contact: Contact,
    pub(crate) reactions: Vec<usize>,
    pub(crate) decays: bool,
    pub(crate) splits: bool,
    pub(crate) receivers: [usize; 3],
    pub(crate) speed: bool,
    pub(crate) arrivals: bool,
}

pub(crate) fn model_features() -> impl Strategy<Value = ModelFeatures> {
    let reactions = prop::sample::subsequence(vec![0, 1, 2, 3], 0..=4);
    let receivers = [0..3_usize, 0..3, 0..8];
    let contacts = vec![Contact::Ignore, Contact::Count, Contact::Separate, Contact::Elastic];
    let flags = [any::<bool>(), any::<bool>(), any::<bool>(), any::<bool>(), any::<bool>()];
    let all = (reactions, receivers, prop::sample::select(contacts), flags);
    all.prop_map(|(reactions, receivers, contact, flags)| {
        let [periodic, decays, splits, speed, arrivals] = flags;
        // Elastic particles need a velocity.
        let speed = speed || contact == Contact::Elastic;
        ModelFeatures { periodic, contact, reactions, decays, splits, receivers, speed, arrivals }
    })
}

pub(crate) fn everything() -> ModelFeatures {
    ModelFeatures {
        periodic: true,
        contact: Contact::Count,
        reactions: vec![0, 1, 2, 3],
        decays: true,
        splits: true,
        receivers: [1, 2, 6],
        speed: true,
        arrivals: true,
    }
}

pub(crate) fn model(features: &ModelFeatures) -> Model {
    let species = |name: &str, radius: f32, diffusion: f64| Species {
        name: name.into(),
        radius,
        diffusion,
        mass: 1.0 + f64::from(radius),
        thermal_speed: if features.speed && name == "d" { 2.0 } else { 0.0 },
        ..Species::default()
    };
    let reaction = |name: &str, reactants, products, radius, probability| Reaction {
        name: name.into(),
        reactants,
        products,
        binding_radius: radius,
        unbinding_radius: 0.4,
        chance: ReactionRate::PerStep(probability),
    };
    let reactions = [
        reaction("a + b -> c", [0, 1], [Some(2), None], 1.5, 0.3),
        reaction("c + a -> c + b", [2, 0], [Some(2), Some(1)], 1.2, 0.5),
        reaction("b + b -> a + d", [1, 1], [Some(0), Some(3)], 0.9, 0.4),
        reaction("d + a -> 0", [3, 0], [None, None], 2.0, 0.1),
    ];
    let decay = |name: &str, reactant, products, rate| Decay {
        name: name.into(),
        reactant,
        products,
        unbinding: Unbinding::Apart(0.5),
        rate,
    };
    let mut decays = Vec::new();
    if features.decays {
        decays.extend([decay("d -> a", 3, [Some(0), None], 2.0), decay("b -> 0", 1, [None, None], 0.5)]);
    }
    if features.splits {
        decays.push(decay("c -> a + b", 2, [Some(0), Some(1)], 4.0));
    }
    if features.decays && features.splits {
        decays.push(decay("d -> c", 3, [Some(2), None], 1.5));
    }
    let transmitter = |name: &str, center, shape, schedule, release| Transmitter {
        name: name.into(),
        center,
        shape,
        schedule,
        release,
        ..Transmitter::default()
    };
    let walls = Axis::Reflecting { low: 0.0, high: 10.0 };
    let axes = [if features.periodic { Axis::Periodic { low: 0.0, high: 10.0 } } else { walls }; 3];
    Model {
        time_step: 0.02,
        species: vec![
            species("a", 0.1, 3.0),
            species("b", 0.3, 1.0),
            species("c", 0.4, 0.7),
            species("d", 0.05, 5.0),
        ],
        boundary: Boundary { axes, vessel: None },
        contact: features.contact,
        reactions: features.reactions.iter().map(|&k| reactions[k].clone()).collect(),
        decays,
        transmitters: vec![
            transmitter(
                "crowd",
                [5.0; 3],
                Shape::Shell(0.0, 2.0),
                Schedule::Times(vec![0.0, 0.1]),
                vec![(0, 60), (1, 60), (2, 15)],
            ),
            transmitter("point", [1.0; 3], Shape::Point, Schedule::Times(vec![0.05]), vec![(0, 20), (1, 20)]),
            transmitter(
                "spring",
                [9.0; 3],
                Shape::Point,
                Schedule::Steady { from: 0.0, until: 1.0, rates: vec![(3, 200.0)] },
                Vec::new(),
            ),
        ],
        receivers: receivers(features),
        logs_arrivals: features.arrivals,
        ..Model::default()
    }
}

fn receivers(features: &ModelFeatures) -> Vec<Receiver> {
    let kinds = [
        ReceiverKind::Transparent,
        ReceiverKind::Receptors(vec![
            ReceptorType::new(3, 200.0, 3.0, [0, 1, 3]),
            ReceptorType::new(2, 100.0, 30.0, [3, 1]),
        ]),
        ReceiverKind::Absorbing,
    ];
    let one = |kind: ReceiverKind, k: usize| Receiver {
        name: format!("receiver {k}"),
        center: [2.0 + k as f32, 7.0 - k as f32 * 0.5, 4.0],
        radius: 0.8,
        surface_diffusion: if kind == kinds[1] { 0.5 } else { 0.0 },
        kind,
        sees: vec![true, true, false, true],
        diffusion: if k == 1 { 0.5 } else { 0.0 },
        ..Receiver::default()
    };
    let of_kind = |at: usize| {
        let kind = &kinds[at];
        (0..features.receivers[at]).map(move |k| one(kind.clone(), 3 * k + at))
    };
    let mut all: Vec<_> = (0..3).flat_map(of_kind).collect();
    if let Some(partial) = all.last_mut().filter(|receiver| receiver.kind == ReceiverKind::Absorbing) {
        partial.kind = ReceiverKind::Partial(Adsorption::Reactivity(20.0));
    }
    all
}
