use super::below;
use crate::model::boundary::Axis;
use crate::model::membrane::{Membrane, MembraneSurface};
use crate::model::receiver::{Receiver, ReceiverKind, WallFace};
use crate::model::vessel::dot;
use crate::model::{Flow, Model};
use crate::motion::tumble::tumble_probability;

/// Largest relative change of the distance of two particles by the flow in a step. Above it, an error of second order
/// is too large.
const STEEP_FLOW: f64 = 0.3;

pub(in crate::scenario) fn unresolved_flow(model: &Model) -> Vec<String> {
    let Some(field) = model.flow_field() else { return Vec::new() };
    let mut messages = Vec::new();
    if field.steepest() * model.time_step > STEEP_FLOW {
        messages.push(format!(
            "the flow changes by {:.3} µm/s per µm, so that a step changes the distance of two particles by {:.0} %; \
             time-step = {} is short enough",
            field.steepest(),
            100.0 * field.steepest() * model.time_step,
            below(STEEP_FLOW / field.steepest())
        ));
    }
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        let (Axis::Reflecting { low, high } | Axis::Periodic { low, high }) = model.boundary.axes[axis]
        else {
            continue;
        };
        let [low, high] = [low, high].map(f64::from);
        let beyond = |&[first, last, spacing]: &[f64; 3]| low < first - spacing || high > last + spacing;
        if let Some([first, last, _]) = field.extent(axis).filter(beyond) {
            messages.push(format!(
                "the flow field is from {first} to {last} µm along {name} and the boundary from {low} to {high} µm; outside, \
                 the flow is that of the nearest point; check origin, spacing and shape"
            ));
        }
    }
    messages
}

/// τ·D/R² of the slowest mode that is equal around the axis of a cylinder: 1/3.8317².
const SLOWEST_MODE: f64 = 1.0 / 14.682;
/// Largest fraction by which a step changes the spread along a Poiseuille flow, (x/2)·coth(x/2) − 1 < x²/12 with x =
/// Δt/τ.
const SPREAD_IN_FLOW: f64 = 0.02;
/// Largest √(2DΔt) across a flow field, relative to the length on which the flow changes. In Poiseuille flow this
/// length is R/2, and the spread is 1.7 % too large.
const LONG_ACROSS_FIELD: f64 = 0.5;

/// Diffusion in a step takes the mean of the flow at both ends.
pub(in crate::scenario) fn long_step_across_flow(model: &Model, species: usize) -> Option<String> {
    let one = &model.species[species];
    let (longest, effect) = match &model.flow {
        Some(Flow::Poiseuille { mean }) => {
            let radius = f64::from(model.boundary.vessel?.radius - one.radius);
            // The spread by the flow relative to diffusion's (Taylor and Aris).
            let spread = (mean * radius / one.diffusion).powi(2) / 48.0;
            let fraction = spread / (1.0 + spread);
            let x = model.time_step * one.diffusion / (SLOWEST_MODE * radius * radius);
            let off = fraction * (0.5 * x / (0.5 * x).tanh() - 1.0);
            let longest =
                (12.0 * SPREAD_IN_FLOW / fraction).sqrt() * SLOWEST_MODE * radius * radius / one.diffusion;
            (longest, format!("the spread along the vessel is {:.1} % too large", 100.0 * off))
        }
        Some(Flow::Field(field)) => {
            let fastest = dot(field.fastest(), field.fastest()).sqrt();
            let steepest = fastest / field.steepest();
            // The spread by the flow relative to diffusion's, about as in a vessel of this radius.
            if (fastest * steepest / one.diffusion).powi(2) / 48.0 < SPREAD_IN_FLOW {
                return None;
            }
            let length = LONG_ACROSS_FIELD * steepest;
            (length * length / (2.0 * one.diffusion), "the spread along the flow is too large".to_owned())
        }
        _ => return None,
    };
    (model.time_step > longest).then(|| {
        format!(
            "a step takes {} {:.3} µm by diffusion, which is long across the flow, whose mean over a step is that of both ends: \
             {effect}; time-step = {} is short enough",
            one.name,
            (2.0 * one.diffusion * model.time_step).sqrt(),
            below(longest)
        )
    })
}

pub(in crate::scenario) fn frequent_tumbles(model: &Model, species: usize) -> Option<String> {
    let one = &model.species[species];
    let rate_factor = model.largest_rate_factor(species);
    let tumbles = one.tumble_rate * model.time_step;
    if one.speed == 0.0 || tumble_probability(tumbles) * rate_factor <= 1.0 {
        return None;
    }
    if rate_factor == 1.0 {
        return Some(format!(
            "{} tumbles {tumbles:.3} times in a step by its tumble-rate, and at most once in the simulation, so that it \
             diffuses {:.3} times as fast; time-step = {} is short enough",
            one.name,
            0.5 * tumbles,
            below(2.0 / one.tumble_rate)
        ));
    }
    if rate_factor.is_infinite() {
        return Some(format!(
            "{} has an infinite tumble rate where it swims down the steepest gradient, but tumbles at most once in a step, so that \
             its drift is too low there; give it a lower sensitivity or speed",
            one.name
        ));
    }
    Some(format!(
        "{} tumbles at up to {:.3e} times its tumble-rate where it swims down the steepest gradient, but at most once in a \
         step, so that its drift is too low there; time-step = {} is short enough",
        one.name,
        rate_factor,
        below(2.0 / (2.0 * rate_factor - 1.0) / one.tumble_rate)
    ))
}

/// Largest volume per time that reactants sweep by drift and velocities, relative to their rate.
const MAX_SWEPT_RATIO: f64 = 0.05;

pub(in crate::scenario) fn swept_by_motion(
    equation: &str,
    rate: f64,
    radius: f64,
    speed: f64,
) -> Option<String> {
    let swept = std::f64::consts::PI * radius.powi(2) * speed;
    (swept > MAX_SWEPT_RATIO * rate).then(|| {
        format!(
            "'{equation}': the rate of {rate} µm³/s is that of diffusion alone, and reactants that move at {speed:.3} µm/s \
             relative to each other sweep up to {swept:.3} µm³/s with the binding radius of {radius:.3} µm, so that more react; \
             give binding-radius and rate-inside in place of the rate"
        )
    })
}

/// A membrane acts only on the ends of receivers' steps.
pub(in crate::scenario) fn long_receiver_step_through(membrane: &Membrane, model: &Model) -> Option<String> {
    let MembraneSurface::Sphere { radius, .. } = membrane.surface else { return None };
    let is_held_back = |one: &&Receiver| one.moves() && model.fastest_shared(one, membrane).is_some();
    let longest = |one: &Receiver| one.time_of_gap(radius.into(), 0.0);
    let moving = model.receivers.iter().filter(is_held_back).map(|one| (longest(one), one));
    let (longest, receiver) = moving.min_by(|a, b| a.0.total_cmp(&b.0))?;
    (model.time_step > longest).then(|| {
        let Receiver { velocity, diffusion, ref name, .. } = *receiver;
        format!(
            "a step takes {name} {:.3} µm by diffusion and {:.3} µm by its velocity, which is long compared with the radius of \
             {radius} µm of {}: it may jump across; time-step = {} is short enough",
            (2.0 * diffusion * model.time_step).sqrt(),
            dot(velocity, velocity).sqrt() * model.time_step,
            membrane.name,
            below(longest)
        )
    })
}

/// Largest drift in √(2DΔt) towards a wall that mirrors paths. At this length, the mean distance from a plane is 1.0 %
/// too large, and 16 % at four times it (numerical stationary state, D/v without the error); from the curved wall of a
/// cylinder 0.7 % and 10 % (measured with R = 5D/v).
const DRIFT_AT_MIRROR: f64 = 0.1;

pub(in crate::scenario) fn drift_at_curved_wall(model: &Model, species: usize) -> Option<String> {
    let one = &model.species[species];
    let vessel = model.boundary.vessel?;
    let across = vessel.across(drift(model, species));
    let speed = dot(across, across).sqrt();
    let side = ReceiverKind::Wall(WallFace::Side);
    let absorbs = model.receivers.iter().any(|receiver| receiver.kind == side && receiver.sees[species]);
    let longest = longest_at_mirror(one.diffusion, speed);
    (longest > 0.0 && model.time_step > longest && !absorbs).then(|| {
        format!(
            "a step takes {} {:.3} µm by diffusion and {:.3} µm by drift across the vessel, whose curved wall mirrors paths: \
             the layer at the wall that the drift feeds is too thick; time-step = {} is short enough",
            one.name,
            (2.0 * one.diffusion * model.time_step).sqrt(),
            speed * model.time_step,
            below(longest)
        )
    })
}

/// Plane walls mirror some paths; see [`StepDrift`](crate::motion::vessel_flow::StepDrift).
pub(in crate::scenario) fn drift_at_plane_wall(model: &Model, species: usize) -> Option<String> {
    let one = &model.species[species];
    let towards = |axis: usize| speed_to_mirror(model, species, axis);
    let (speed, reason) = (0..3).filter_map(towards).max_by(|a, b| a.0.total_cmp(&b.0))?;
    let longest = longest_at_mirror(one.diffusion, speed);
    (longest > 0.0 && model.time_step > longest).then(|| {
        format!(
            "a step takes {} {:.3} µm by diffusion and up to {:.3} µm by drift towards a plane wall, which mirrors paths because \
             {reason}: the layer at the wall that the drift feeds is too thick; time-step = {} is short enough",
            one.name,
            (2.0 * one.diffusion * model.time_step).sqrt(),
            speed * model.time_step,
            below(longest)
        )
    })
}

/// Largest displacement in a step by drift without diffusion, in distances of walls: particles end up to that far from
/// the wall to which they drift.
const DRIFT_TO_WALL: f64 = 0.02;

/// Without diffusion, mirrored paths make particles jump off the wall at which they should stay.
pub(in crate::scenario) fn drift_without_diffusion(model: &Model, species: usize) -> Option<String> {
    let one = &model.species[species];
    if one.diffusion > 0.0 || one.has_velocity() {
        return None;
    }
    let velocity = drift(model, species);
    let absorbs = |face: WallFace| {
        model
            .receivers
            .iter()
            .any(|receiver| receiver.kind == ReceiverKind::Wall(face) && receiver.sees[species])
    };
    let across_box = |axis: usize| {
        let Axis::Reflecting { low, high } = model.boundary.axes[axis] else { return None };
        let face = if velocity[axis] > 0.0 { WallFace::High(axis) } else { WallFace::Low(axis) };
        let length = f64::from(high - low - 2.0 * one.radius);
        (velocity[axis] != 0.0 && !absorbs(face)).then(|| (velocity[axis].abs(), length))
    };
    let across_vessel = model.boundary.vessel.filter(|_| !absorbs(WallFace::Side)).map(|vessel| {
        let across = vessel.across(velocity);
        (dot(across, across).sqrt(), 2.0 * f64::from(vessel.radius - one.radius))
    });
    let walls = (0..3).filter_map(across_box).chain(across_vessel).filter(|&(speed, _)| speed > 0.0);
    let (speed, length) = walls.min_by(|a, b| (a.1 / a.0).total_cmp(&(b.1 / b.0)))?;
    let longest = DRIFT_TO_WALL * length / speed;
    (model.time_step > longest).then(|| {
        format!(
            "a step takes {} {:.3} µm by drift towards a wall, {length:.3} µm from the opposite one: without diffusion, walls \
             mirror paths, so that particles jump off the wall by up to a step; time-step = {} is short enough",
            one.name,
            speed * model.time_step,
            below(longest)
        )
    })
}

/// Returns the largest speed towards a mirroring wall across an axis, and the reason why it mirrors.
fn speed_to_mirror(model: &Model, species: usize, axis: usize) -> Option<(f64, &'static str)> {
    let Axis::Reflecting { .. } = model.boundary.axes[axis] else { return None };
    let absorbs = |face: WallFace| {
        model.receivers.iter().any(|one| one.kind == ReceiverKind::Wall(face) && one.sees[species])
    };
    let absorbing = [WallFace::Low(axis), WallFace::High(axis)].map(absorbs);
    let reason = match absorbing {
        _ if model.contact.collides() => "particles collide",
        _ if model.species[species].has_velocity() => "the species has a speed or thermal-speed",
        [false, false] => return None,
        _ => "the opposite wall absorbs",
    };
    let [slowest, fastest] = flow_along(model, axis).map(|flow| drift(model, species)[axis] + flow);
    let speeds = absorbing.into_iter().zip([-slowest, fastest]).filter(|(absorbs, _)| !absorbs);
    Some((speeds.map(|(_, speed)| speed).fold(0.0, f64::max), reason))
}

fn longest_at_mirror(diffusion: f64, speed: f64) -> f64 {
    2.0 * diffusion * (DRIFT_AT_MIRROR / speed).powi(2)
}

/// Returns the velocity by drift and plug flow, in µm/s.
pub(super) fn drift(model: &Model, species: usize) -> [f64; 3] {
    let plug = match model.flow {
        Some(Flow::Plug(velocity)) => velocity,
        _ => [0.0; 3],
    };
    std::array::from_fn(|k| model.species[species].drift[k] + plug[k])
}

/// Returns the least and the largest velocity along an axis, in µm/s, without plug flow.
fn flow_along(model: &Model, axis: usize) -> [f64; 2] {
    match &model.flow {
        Some(Flow::Poiseuille { mean }) if model.boundary.along() == Some(axis) => {
            [2.0 * mean.min(0.0), 2.0 * mean.max(0.0)]
        }
        Some(Flow::Field(field)) => [-field.fastest()[axis], field.fastest()[axis]],
        _ => [0.0; 2],
    }
}
