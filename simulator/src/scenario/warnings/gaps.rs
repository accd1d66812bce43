use super::below;
use crate::model::boundary::Axis;
use crate::model::receiver::{Receiver, ReceiverKind, WallFace, signed_distance};
use crate::model::{Flow, Model, Species};

/// Largest √(2DΔt) between two surfaces that face each other, in gaps L. From a point at 0.9 L, 1 % too many are left in
/// front of a wall that absorbs and opposite to one that reflects after a time of 0.5 L²/D, 9 % at 0.58 and 22 % at 0.71
/// (Monte Carlo, 6·10⁴ particles).
const LONG_IN_GAP: f64 = 0.4;
/// Smaller gaps, in radii of the smaller sphere, are contacts: few particles reach them.
const CONTACT: f64 = 0.03;
/// Receivers that are tested against each other, in the order of the file.
const MAX_TESTED: usize = 1000;
/// Least drift across the gap of two walls, in D/L: weaker ones change a density by less than 2 %.
const LEAST_DRIFT: f64 = 0.02;

struct Gap {
    /// In µm.
    length: f64,
    /// In µm²/s.
    diffusion: f64,
    surfaces: String,
}

/// A path between two surfaces is right if it reaches one of them.
pub(in crate::scenario) fn long_step_across_gap(model: &Model, species: usize) -> Option<String> {
    let one = &model.species[species];
    let seen: Vec<&Receiver> = model.receivers.iter().filter(|receiver| receiver.sees[species]).collect();
    let mut gaps = Vec::new();
    for (k, receiver) in seen.iter().enumerate().filter(|(_, receiver)| is_surface(receiver)) {
        gaps.extend(gaps_to_walls(model, receiver, species));
        gaps.extend(gap_to_image(model, receiver, species));
        let tested = if k < MAX_TESTED { &seen[..k] } else { &[] };
        let others = tested.iter().filter(|other| is_surface(other));
        gaps.extend(others.filter_map(|other| gap_between(model, [other, receiver], species)));
    }
    let longest = |gap: &Gap| (LONG_IN_GAP * gap.length).powi(2) / (2.0 * gap.diffusion);
    let worst = gaps.iter().min_by(|a, b| longest(a).total_cmp(&longest(b)))?;
    (model.time_step > longest(worst)).then(|| {
        format!(
            "a step takes {} {:.3} µm by diffusion, which is long for the gap of {:.3} µm between {}: steps that reach both \
             surfaces are taken at a wrong rate; time-step = {} is short enough",
            one.name,
            (2.0 * worst.diffusion * model.time_step).sqrt(),
            worst.length,
            worst.surfaces,
            below(longest(worst))
        )
    })
}

/// Receivers of the kind `endpoint` act on the ends of steps.
fn is_surface(receiver: &Receiver) -> bool {
    receiver.radius > 0.0 && (receiver.kind == ReceiverKind::Absorbing || receiver.kind.reflects())
}

fn takes(receiver: &Receiver, species: usize) -> bool {
    receiver.sees[species] && (receiver.kind.absorbs() || receiver.binds(species))
}

fn gap_between(model: &Model, [a, b]: [&Receiver; 2], species: usize) -> Option<Gap> {
    let meet = !a.moves() && !b.moves() && (takes(a, species) || takes(b, species));
    let length = f64::from(signed_distance(a.radius + b.radius, a.center, &model.boundary, b.center));
    let least = CONTACT * f64::from(a.radius.min(b.radius));
    (meet && length > least).then(|| Gap {
        length,
        diffusion: model.species[species].diffusion,
        surfaces: format!("{} and {}", a.name, b.name),
    })
}

fn gap_to_image(model: &Model, receiver: &Receiver, species: usize) -> Option<Gap> {
    let periods = model.boundary.axes.map(|axis| f64::from(axis.period()));
    let shortest = periods.into_iter().filter(|&period| period > 0.0).min_by(f64::total_cmp)?;
    let length = shortest - 2.0 * f64::from(receiver.radius);
    (takes(receiver, species) && length > CONTACT * f64::from(receiver.radius)).then(|| Gap {
        length,
        diffusion: model.species[species].diffusion + receiver.diffusion,
        surfaces: format!("{} and its image in the periodic box", receiver.name),
    })
}

fn gaps_to_walls(model: &Model, receiver: &Receiver, species: usize) -> Vec<Gap> {
    let Species { diffusion, radius, .. } = model.species[species];
    let absorbs = |face: WallFace| {
        let is_there = |one: &Receiver| one.kind == ReceiverKind::Wall(face) && one.sees[species];
        model.receivers.iter().any(is_there)
    };
    let domain = model.boundary.inset(radius);
    let mut walls = Vec::new();
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        if let Axis::Reflecting { low, high } = domain.axes[axis] {
            let center = receiver.center[axis];
            walls.push((WallFace::Low(axis), center - low, format!("the wall low-{name}")));
            walls.push((WallFace::High(axis), high - center, format!("the wall high-{name}")));
        }
    }
    if let Some(vessel) = &domain.vessel {
        let height = vessel.radius - vessel.distance(receiver.center) as f32;
        walls.push((WallFace::Side, height, "the side of the vessel".to_owned()));
    }
    let radius = f64::from(receiver.radius);
    let is_gap = |(face, height, _): &(WallFace, f32, String)| {
        let meet = !receiver.moves() && (takes(receiver, species) || absorbs(*face));
        meet && f64::from(*height) - radius > CONTACT * radius
    };
    let gap = |(_, height, name): (WallFace, f32, String)| Gap {
        length: f64::from(height) - radius,
        diffusion,
        surfaces: format!("{} and {name}", receiver.name),
    };
    walls.into_iter().filter(is_gap).map(gap).collect()
}

/// Returns the first receiver that overlaps an earlier one and takes the same species, and a message.
pub(in crate::scenario) fn overlapping_absorbers(model: &Model) -> Option<(usize, String)> {
    let absorbs = |one: &Receiver| {
        matches!(one.kind, ReceiverKind::Absorbing | ReceiverKind::Partial(_)) && !one.moves()
    };
    let all: Vec<_> =
        model.receivers.iter().enumerate().filter(|(_, one)| absorbs(one)).take(MAX_TESTED).collect();
    let pair = |&(k, one): &(usize, &Receiver)| {
        let shares = |other: &Receiver| other.sees.iter().zip(&one.sees).any(|(a, b)| *a && *b);
        let overlaps = |&&(at, other): &&(usize, &Receiver)| {
            let least = -(CONTACT as f32) * one.radius.min(other.radius);
            let radii = one.radius + other.radius;
            at < k
                && shares(other)
                && signed_distance(radii, one.center, &model.boundary, other.center) < least
        };
        let (_, other) = all.iter().find(overlaps)?;
        Some((
            k,
            format!(
                "{} overlaps {}, and both absorb the same particles: each takes its part of a step, so that steps that are long \
             compared with the overlap are taken at a wrong rate; move them apart, or let them see different species",
                one.name, other.name
            ),
        ))
    };
    all.iter().find_map(pair)
}

/// A step with drift that reaches both of two walls is mirrored; see [`wall`](crate::motion::wall).
pub(in crate::scenario) fn long_step_between_walls(model: &Model, species: usize) -> Option<String> {
    let one = &model.species[species];
    let length = |axis: usize| {
        let Axis::Reflecting { low, high } = model.boundary.axes[axis] else { return None };
        let absorbs = |receiver: &Receiver| receiver.is_across(axis) && receiver.sees[species];
        let length = f64::from(high - low - 2.0 * one.radius);
        let speed = (one.drift[axis] + plug(model)[axis]).abs();
        let matters = speed * length > LEAST_DRIFT * one.diffusion;
        (matters && !model.receivers.iter().any(absorbs)).then_some((length, speed))
    };
    let (length, speed) = (0..3).filter_map(length).min_by(|a, b| a.0.total_cmp(&b.0))?;
    let longest = (LONG_IN_GAP * length).powi(2) / (2.0 * one.diffusion);
    (model.time_step > longest).then(|| {
        format!(
            "a step takes {} {:.3} µm by diffusion, which is long for two walls {length:.3} µm apart: steps that reach both are \
             mirrored, so that the density that the drift of {speed:.3} µm/s makes is wrong; time-step = {} is short enough",
            one.name,
            (2.0 * one.diffusion * model.time_step).sqrt(),
            below(longest)
        )
    })
}

fn plug(model: &Model) -> [f64; 3] {
    match model.flow {
        Some(Flow::Plug(velocity)) => velocity,
        _ => [0.0; 3],
    }
}
