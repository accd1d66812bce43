mod absorption;
mod close_pairs;
mod collisions;
mod decays;
mod gaps;
mod passage;
mod resolution;
mod rounding;
mod shapes;
mod transport;

pub(super) use self::absorption::long_step_to_absorber;
pub(super) use self::collisions::many_collisions;
pub(super) use self::decays::fast_decays;
pub(super) use self::gaps::{long_step_across_gap, long_step_between_walls, overlapping_absorbers};
pub(super) use self::passage::{long_step_between_membranes, long_step_through};
pub(super) use self::resolution::{rounded_receiver_steps, rounded_steps};
pub(super) use self::rounding::{rounded_decays, rounded_reactions, rounded_tumbles, rounded_unbinding};
pub(super) use self::shapes::misplaced_shape;
pub(super) use self::transport::{
    drift_at_curved_wall, drift_at_plane_wall, drift_without_diffusion, frequent_tumbles,
    long_receiver_step_through, long_step_across_flow, swept_by_motion, unresolved_flow,
};
use crate::model::boundary::{Axis, Boundary};
use crate::model::receiver::{Adsorption, Receiver, ReceiverKind, signed_distance};
use crate::model::transmitter::{Shape, Transmitter};
use crate::model::vessel::dot;
use crate::model::{Flow, Model, Species};
use crate::reaction::rate;

/// Returns `true` if walls separate a whole sphere from the inside.
pub(super) fn is_walled_off(boundary: &Boundary, center: [f32; 3], radius: f32) -> bool {
    let beyond = |(axis, x): (Axis, f32)| match axis {
        Axis::Reflecting { low, high } => (low - x).max(x - high).max(0.0),
        _ => 0.0,
    };
    let squares = boundary.axes.into_iter().zip(center).map(|pair| beyond(pair).powi(2));
    let across = boundary.vessel.map_or(0.0, |v| (v.distance(center) as f32 - v.radius).max(0.0));
    squares.sum::<f32>() + across * across > radius * radius
}

/// Warns of a position outside a periodic box.
pub(super) fn image(boundary: &Boundary, center: [f32; 3]) -> Option<String> {
    let images = boundary.axes.map(|axis| match axis {
        Axis::Periodic { .. } => axis,
        _ => Axis::Open,
    });
    let image = Boundary { axes: images, vessel: None }.confine(center);
    (image != center).then(|| {
        format!(
            "{center:?} is outside the periodic box and is wrapped to {image:?}; write {image:?}, or another position"
        )
    })
}

pub(super) fn walls(boundary: &Boundary) -> String {
    let ends = boundary.axes.map(|axis| match axis {
        Axis::Reflecting { low, high } | Axis::Periodic { low, high } => [low, high],
        Axis::Frozen => [0.0; 2],
        Axis::Open => [f32::NEG_INFINITY, f32::INFINITY],
    });
    match &boundary.vessel {
        None => {
            let [low, high] = [0, 1].map(|end| ends.map(|axis| axis[end]));
            format!("the walls of the box from {low:?} to {high:?}")
        }
        Some(v) => {
            let Some(along) = v.along else {
                return format!("the sphere of radius {} around {:?}", v.radius, v.center);
            };
            let name = ["x", "y", "z"].get(along).unwrap_or(&"x");
            format!(
                "the cylinder of radius {} along {name} through {:?}, or beyond its ends",
                v.radius, v.center
            )
        }
    }
}

/// Returns a number rounded down to three digits.
pub(super) fn below(value: f64) -> String {
    // For smaller ones, the unit would underflow.
    if value < 1e-300 {
        return format!("{value:.2e}");
    }
    let unit = 10_f64.powi(value.log10().floor() as i32 - 2);
    format!("{:.2e}", ((value / unit) * (1.0 - 1e-6)).floor() * unit)
}

pub(super) fn long_step(
    equation: &str,
    radius: f64,
    diffusion: f64,
    rate: Option<f64>,
    time_step: f64,
) -> Option<String> {
    if time_step <= rate::longest_step(radius, diffusion) {
        return None;
    }
    let longest = match rate {
        Some(rate) => rate::longest_step_for(rate, diffusion),
        None => rate::longest_step(radius, diffusion),
    };
    let step = (2.0 * diffusion * time_step).sqrt();
    Some(format!(
        "'{equation}': a step of {step:.3} µm of one reactant towards the other is long compared with the binding radius of \
         {radius:.3} µm, so that reactants jump over each other; the rate is right only if they are well mixed; \
         time-step = {} is short enough",
        below(longest)
    ))
}

/// Largest step, in mean times to an event that is tested at the ends of steps.
const FAST_REACTION: f64 = 0.2;

pub(super) fn fast_reaction(equation: &str, rate: f64, time_step: f64) -> Option<String> {
    (rate * time_step > FAST_REACTION).then(|| {
        format!(
            "'{equation}': reactants within the binding radius react after {:.3e} s on average, but a step has {time_step:.3e} s, \
             and pairs that meet and part within a step are missed; time-step = {} is short enough",
            1.0 / rate,
            below(FAST_REACTION / rate)
        )
    })
}

/// Largest √(2DΔt), in radii, near a reflecting surface.
const LONG_AT_SURFACE: f64 = 0.5;
/// Largest drift near a surface that takes particles at a rate, in √(2DΔt).
const DRIFT_AT_SURFACE: f64 = 0.2;

pub(super) fn long_step_before(receiver: &Receiver, model: &Model) -> Option<String> {
    if !receiver.kind.reflects() {
        return None;
    }
    let seen = model.species.iter().enumerate().filter(|&(k, _)| receiver.sees[k]);
    let longest = |(k, species): (usize, &Species)| {
        // Other species are only reflected.
        let by_rate = match receiver.kind {
            ReceiverKind::Partial(Adsorption::Reactivity(_)) => true,
            _ => receiver.binds(k),
        };
        let diffusion = species.diffusion + receiver.diffusion;
        let limit = (LONG_AT_SURFACE * f64::from(receiver.radius)).powi(2) / (2.0 * diffusion);
        let speed = speed_past(receiver, species, model);
        let carried = 2.0 * diffusion * (DRIFT_AT_SURFACE / speed).powi(2);
        if by_rate { limit.min(carried) } else { limit }
    };
    let (longest, species) =
        seen.map(|(k, species)| (longest((k, species)), species)).min_by(|a, b| a.0.total_cmp(&b.0))?;
    (model.time_step > longest).then(|| {
        format!(
            "a step takes {} {:.3} µm by diffusion and {:.3} µm by drift to or past {}, of radius {} µm: reflected particles are \
             in the wrong places, and the number of adsorbed or bound particles is wrong; time-step = {} is short enough",
            species.name,
            (2.0 * (species.diffusion + receiver.diffusion) * model.time_step).sqrt(),
            speed_past(receiver, species, model) * model.time_step,
            receiver.name,
            receiver.radius,
            below(longest)
        )
    })
}

/// Bounds the speed relative to a receiver apart from diffusion, in µm/s.
fn speed_past(receiver: &Receiver, species: &Species, model: &Model) -> f64 {
    let mut velocity = species.drift;
    let mut more = species.thermal_speed + species.speed;
    match &model.flow {
        Some(Flow::Plug(flow)) => velocity.iter_mut().zip(flow).for_each(|(v, u)| *v += u),
        Some(Flow::Poiseuille { mean }) => more += 2.0 * mean.abs(),
        Some(Flow::Field(field)) => more += dot(field.fastest(), field.fastest()).sqrt(),
        None => {}
    }
    let relative: f64 = velocity.iter().zip(receiver.velocity).map(|(v, u)| (v - u).powi(2)).sum();
    relative.sqrt() + more
}

pub(super) fn fast_unbinding(receiver: &Receiver, model: &Model) -> Option<String> {
    let ligands = receiver.receptor_types().iter().flat_map(|kind| &kind.ligands);
    let unbinding_rate = ligands.map(|ligand| ligand.unbinding_rate).fold(0.0, f64::max);
    (unbinding_rate * model.time_step > FAST_REACTION).then(|| {
        format!(
            "receptors of {} hold a particle for {:.3e} s on average, and a step has {:.3e} s: many would bind and unbind within \
             a step; time-step = {} is short enough",
            receiver.name,
            1.0 / unbinding_rate,
            model.time_step,
            below(FAST_REACTION / unbinding_rate)
        )
    })
}

/// Largest fraction of pairs that bind again at once without a warning.
const MAX_REBOUND_FRACTION: f64 = 0.02;

pub(super) fn slow_relaxation(
    equation: &str,
    [rate, radius, unbinding]: [f64; 3],
    diffusion: f64,
    time_step: f64,
) -> Option<String> {
    let again = 1.0 - rate::rate_constant(radius, diffusion, time_step) / rate;
    (again > MAX_REBOUND_FRACTION).then(|| {
        format!(
            "'{equation}': {:.1} % of the pairs that dissociate to {} µm bind again at once; the equilibrium is that of \
             the rates, but it is approached {:.1} % more slowly; a larger unbinding-radius reduces this",
            100.0 * again,
            // Without the digits of a double.
            unbinding as f32,
            100.0 * again
        )
    })
}

pub(super) fn released_inside(
    transmitter: &Transmitter,
    receivers: &[Receiver],
    boundary: &Boundary,
) -> Option<String> {
    let half = |sides: [f32; 3]| 0.5 * sides.iter().map(|side| side * side).sum::<f32>().sqrt();
    let extent = match transmitter.shape {
        Shape::Point => 0.0,
        Shape::Gaussian(width) => 3.0 * width,
        Shape::Shell(_, radius) => radius,
        Shape::Box(sides) | Shape::Lattice(sides, _) => half(sides),
        Shape::Cylinder(_, radius, length) => radius.hypot(0.5 * length),
    };
    let takes = |receiver: &&Receiver| {
        matches!(receiver.kind, ReceiverKind::Absorbing | ReceiverKind::Endpoint)
            && transmitter.species().any(|species| receiver.sees[species as usize])
            && signed_distance(receiver.radius, receiver.center, boundary, transmitter.center) + extent < 0.0
    };
    receivers.iter().find(takes).map(|receiver| {
        format!(
            "transmitter {} is inside receiver {}, which absorbs all released particles in their first step; move one of them, \
             unless this is intended",
            transmitter.name, receiver.name
        )
    })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::model::Contact;

    fn species(radius: f32, diffusion: f64, thermal_speed: f64) -> Species {
        Species { name: "A".into(), radius, diffusion, thermal_speed, ..Species::default() }
    }

    fn suggested(text: &str) -> f64 {
        let rest = text.split("time-step = ").nth(1).expect("a warning");
        rest.split(' ').next().expect("a number").parse().expect("a number")
    }

    proptest! {
        #[test]
        fn time_step_of_a_rate_warning_is_right_when_followed(
            rate in -6.0..6.0_f64, diffusion in -4.0..4.0_f64, time_step in -12.0..2.0_f64
        ) {
            let [rate, diffusion, time_step] = [rate, diffusion, time_step].map(|x| 10_f64.powf(x));
            let says = |time_step: f64| {
                let radius = rate::binding_radius(rate, diffusion, time_step).unwrap();
                long_step("A + B -> C", radius, diffusion, Some(rate), time_step)
            };
            if let Some(text) = says(time_step) {
                let better = suggested(&text);
                prop_assert!(better < time_step, "{text}");
                prop_assert_eq!(says(better), None);
                prop_assert!(says(1.02 * better).is_some(), "{} is too cautious", better);
            }
        }

        #[test]
        fn time_step_of_a_collision_warning_is_right_when_followed(
            radius in -3.0..1.0_f64, diffusion in -4.0..4.0_f64, speed in -3.0..3.0_f64, still in 0..3
        ) {
            let [radius, mut diffusion, mut speed] = [radius, diffusion, speed].map(|x| 10_f64.powf(x));
            if still == 0 { diffusion = 0.0 }
            if still == 1 { speed = 0.0 }
            let side = (20.0 * radius) as f32;
            let says = |time_step: f64| many_collisions(&Model {
                time_step,
                species: vec![species(radius as f32, diffusion, speed), species(0.0, diffusion, 0.0)],
                contact: Contact::Separate,
                boundary: Boundary::periodic([0.0; 3], [side; 3]),
                transmitters: vec![Transmitter { release: vec![(0, 500), (1, 20)], ..Transmitter::default() }],
                ..Model::default()
            }, 1);
            let better = suggested(&says(1e12).expect("a warning"));
            prop_assert_eq!(says(better), None);
            prop_assert!(says(1.02 * better).is_some(), "{} is too cautious", better);
        }
    }

    #[test]
    fn spheres_outside_walls_are_walled_off() {
        let walls = Boundary::reflecting([-1.0; 3], [1.0; 3]);
        assert!(!is_walled_off(&walls, [1.5, 0.0, 0.0], 0.6) && is_walled_off(&walls, [1.5, 1.5, 0.0], 0.6));
        assert!(!is_walled_off(&walls, [1.0; 3], 0.0) && is_walled_off(&walls, [1.1, 0.0, 0.0], 0.0));
        let periodic = Boundary::periodic([-1.0; 3], [1.0; 3]);
        assert!(!is_walled_off(&periodic, [9.0; 3], 0.0));
        assert_eq!(image(&periodic, [0.5; 3]), None);
        assert!(image(&periodic, [1.5, 0.0, 0.0]).is_some_and(|text| text.contains("[-0.5, 0.0, 0.0]")));
    }
}
