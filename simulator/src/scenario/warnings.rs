//! Warnings about scenarios that may not be meant so, with remedies. Pure functions.

use crate::model::boundary::{Axis, Boundary};
use crate::model::receiver::{Adsorption, Receiver, ReceiverKind, Receptors};
use crate::model::{Contact, Decay, Flow, Model, Reaction, Species, Unbinding};
use crate::reaction::probability::undoes;
use crate::reaction::rate;

/// Returns `true` if walls keep everything away from a sphere.
pub(super) fn is_walled_off(boundary: &Boundary, center: [f32; 3], radius: f32) -> bool {
    let beyond = |(axis, x): (Axis, f32)| match axis {
        Axis::Reflecting { low, high } => (low - x).max(x - high).max(0.0),
        _ => 0.0,
    };
    let squares = boundary.axes.into_iter().zip(center).map(|pair| beyond(pair).powi(2));
    let across = boundary.vessel.map_or(0.0, |v| (v.distance(center) as f32 - v.radius).max(0.0));
    squares.sum::<f32>() + across * across > radius * radius
}

/// The position to write instead of one outside a periodic box.
pub(super) fn image(boundary: &Boundary, center: [f32; 3]) -> Option<String> {
    let images = boundary.axes.map(|axis| match axis {
        Axis::Periodic { .. } => axis,
        _ => Axis::Open,
    });
    let image = Boundary { axes: images, vessel: None }.confine(center);
    (image != center).then(|| {
        format!(
            "{center:?} is outside the periodic box and means its image {image:?}; write that, if it is meant"
        )
    })
}

/// Walls, by their corners.
pub(super) fn walls(boundary: &Boundary) -> String {
    let corner = |upper: bool| {
        boundary.axes.map(|axis| match axis {
            Axis::Reflecting { low, high } | Axis::Periodic { low, high } => {
                if upper {
                    high
                } else {
                    low
                }
            }
            Axis::Open => {
                if upper {
                    f32::INFINITY
                } else {
                    f32::NEG_INFINITY
                }
            }
        })
    };
    match &boundary.vessel {
        None => format!("the walls of the box from {:?} to {:?}", corner(false), corner(true)),
        Some(v) => {
            let name = ["x", "y", "z"].get(v.along).unwrap_or(&"x");
            format!(
                "the cylinder of radius {} along {name} through {:?}, or beyond its ends",
                v.radius, v.center
            )
        }
    }
}

/// A number of three digits that is no larger.
pub(super) fn below(value: f64) -> String {
    let unit = 10_f64.powi(value.log10().floor() as i32 - 2);
    // Less than rounding can bring back.
    format!("{:.2e}", ((value / unit) * (1.0 - 1e-6)).floor() * unit)
}

/// Warns of a reaction whose partners jump over each other, with the longest time step without that.
pub(super) fn long_step(
    equation: &str,
    (radius, diffusion, rate): (f64, f64, Option<f64>),
    time_step: f64,
) -> Option<String> {
    if time_step <= rate::longest_step(radius, diffusion) {
        return None;
    }
    let longest = match rate {
        // The radius depends on the time step in turn.
        Some(rate) => rate::longest_step_for(rate, diffusion),
        None => rate::longest_step(radius, diffusion),
    };
    let step = (2.0 * diffusion * time_step).sqrt();
    Some(format!(
        "'{equation}': a step of {step:.3} µm of one reactant towards the other is long beside the binding radius of \
         {radius:.3} µm, so that reactants jump over each other; the rate is right only where they are well mixed; \
         time-step = {} is short enough",
        below(longest)
    ))
}

/// The part of a lifetime that a step may take where what comes of it is noticed only in the next one.
const FAST_DECAY: f64 = 0.02;
/// The part of the mean time to a reaction that a step may take: it is looked for at the ends of steps only.
const FAST_REACTION: f64 = 0.2;

/// Warns of a reaction that is fast compared with the time step.
pub(super) fn fast_reaction(equation: &str, rate: f64, time_step: f64) -> Option<String> {
    (rate * time_step > FAST_REACTION).then(|| {
        format!(
            "'{equation}': those within reach of each other react in {:.3e} s on average, and a step has {time_step:.3e} s; \
             many come and go unseen; time-step = {} is short enough",
            1.0 / rate,
            below(FAST_REACTION / rate)
        )
    })
}

/// Warns of a decay that is fast compared with the time step, of particles that appear at the ends of steps. (Decays of what is
/// released or comes of other decays are right for steps of any length.)
pub(super) fn fast_decay(model: &Model, decay: &Decay) -> Option<String> {
    let part = decay.rate * model.time_step;
    let species = decay.reactant;
    // What goes to and fro between two states does so in the right proportion.
    let exchanged = |reaction: &Reaction| {
        let back =
            |decay: &&Decay| undoes(decay, reaction) && matches!(decay.unbinding, Unbinding::Within(_));
        model.decays.iter().any(|decay| back(&decay) && decay.reactant == species)
    };
    let from_pairs = model
        .reactions
        .iter()
        .any(|reaction| reaction.products.contains(&Some(species)) && !exchanged(reaction));
    let from_splits =
        model.decays.iter().any(|decay| decay.splits() && decay.products.contains(&Some(species)));
    let late = decay.splits() && model.decays.iter().any(|other| other.products.contains(&Some(species)));
    (part > FAST_DECAY && (from_pairs || from_splits || late)).then(|| {
        let name = &model.species[species as usize].name;
        format!(
            "'{}': {:.1} % of {name} decay in a step, and what comes of others does so from the next step on: on average it \
             lives half a step too long; time-step = {} is short enough",
            decay.name,
            100.0 * part,
            below(FAST_DECAY / decay.rate)
        )
    })
}

/// The part of the radius of a surface that a step of diffusion may have where not all that reaches it stays.
const LONG_BESIDE_SURFACE: f64 = 0.5;
/// The part of a step of diffusion that a drift may have there.
const DRIFT_BESIDE_DIFFUSION: f64 = 0.2;

/// Warns of steps near a surface that reflects some of the particles that reach it, with the longest time step without
/// that.
pub(super) fn long_step_before(receiver: &Receiver, model: &Model) -> Option<String> {
    let by_rate = matches!(
        receiver.kind,
        ReceiverKind::Partial(Adsorption::Reactivity(_)) | ReceiverKind::Receptors(_)
    );
    if !receiver.kind.reflects() {
        return None;
    }
    let seen =
        model.species.iter().enumerate().filter(|&(k, _)| receiver.sees[k]).map(|(_, species)| species);
    let longest = |species: &Species| {
        let diffusion = species.diffusion + receiver.diffusion;
        let limit = (LONG_BESIDE_SURFACE * f64::from(receiver.radius)).powi(2) / (2.0 * diffusion);
        let speed = speed_past(receiver, species, model);
        let carried = 2.0 * diffusion * (DRIFT_BESIDE_DIFFUSION / speed).powi(2);
        if by_rate { limit.min(carried) } else { limit }
    };
    let (longest, species) =
        seen.map(|species| (longest(species), species)).min_by(|a, b| a.0.total_cmp(&b.0))?;
    (model.time_step > longest).then(|| {
        format!(
            "a step takes {} {:.3} µm by diffusion and {:.3} µm by drift to or past {}, of radius {} µm: what it turns back is \
             in the wrong places, and what stays is off; time-step = {} is short enough",
            species.name,
            (2.0 * (species.diffusion + receiver.diffusion) * model.time_step).sqrt(),
            speed_past(receiver, species, model) * model.time_step,
            receiver.name,
            receiver.radius,
            below(longest)
        )
    })
}

/// The largest speed, apart from diffusion, of a particle past a receiver, in µm/s.
fn speed_past(receiver: &Receiver, species: &Species, model: &Model) -> f64 {
    let mut velocity = species.drift;
    let mut more = species.thermal_speed + species.speed;
    match model.flow {
        Some(Flow::Plug(flow)) => velocity.iter_mut().zip(flow).for_each(|(v, u)| *v += u),
        Some(Flow::Poiseuille { mean }) => more += 2.0 * mean.abs(),
        None => {}
    }
    let relative: f64 = velocity.iter().zip(receiver.velocity).map(|(v, u)| (v - u).powi(2)).sum();
    relative.sqrt() + more
}

/// Warns of receptors that unbind fast compared with the time step.
pub(super) fn fast_unbinding(receiver: &Receiver, model: &Model) -> Option<String> {
    let ReceiverKind::Receptors(Receptors { unbinding_rate, .. }) = receiver.kind else { return None };
    (unbinding_rate * model.time_step > FAST_REACTION).then(|| {
        format!(
            "receptors of {} hold a particle for {:.3e} s on average, and a step has {:.3e} s: many would come and go within \
             a step; time-step = {} is short enough",
            receiver.name,
            1.0 / unbinding_rate,
            model.time_step,
            below(FAST_REACTION / unbinding_rate)
        )
    })
}

/// Warns of contact that particles jump over, with the longest time step without that.
pub(super) fn missed_contact(model: &Model) -> Option<String> {
    if !matches!(model.contact, Contact::Separate | Contact::Elastic) {
        return None;
    }
    // No pair may need shorter steps than these.
    let worst = model.species.iter().enumerate().flat_map(|(k, a)| {
        model.species[k..].iter().filter_map(move |b| Some((longest_contact_step(a, b)?, a, b)))
    });
    let (longest, a, b) = worst.min_by(|a, b| a.0.total_cmp(&b.0))?;
    (model.time_step > longest).then(|| {
        let name = if a.name == b.name { format!("two {}", a.name) } else { format!("{} and {}", a.name, b.name) };
        format!(
            "a step takes {name} {:.3e} µm towards each other, and they touch at {:.3e} µm: most pass through each other \
             unseen, so that contact does little; time-step = {} resolves it, contact = \"count\" only looks",
            (relative(a, b)[0] * model.time_step).sqrt() + relative(a, b)[1] * model.time_step,
            touch(a, b),
            below(longest)
        )
    })
}

fn touch(a: &Species, b: &Species) -> f64 {
    f64::from(a.radius) + f64::from(b.radius)
}

/// Of the way of two particles towards each other: twice the sum of their diffusion coefficients, and their speed.
fn relative(a: &Species, b: &Species) -> [f64; 2] {
    let drift: f64 = a.drift.iter().zip(b.drift).map(|(u, v)| (u - v).powi(2)).sum();
    let squares = [a.thermal_speed, b.thermal_speed, a.speed, b.speed].map(|speed| speed * speed);
    let thermal: f64 = squares.into_iter().sum();
    [2.0 * (a.diffusion + b.diffusion), drift.sqrt() + thermal.sqrt()]
}

/// The time step, in s, in which two particles move towards each other as far as they touch: √(Dt) + vt = r for the
/// numbers of [`relative`]. Nothing for points, which never touch, and for what does not move.
fn longest_contact_step(a: &Species, b: &Species) -> Option<f64> {
    let ([diffusion, speed], reach) = (relative(a, b), touch(a, b));
    if reach == 0.0 || diffusion + speed == 0.0 {
        return None;
    }
    // The root of v·s² + √D·s − r for s = √t, written so that nothing cancels.
    let root = 2.0 * reach / (diffusion.sqrt() + (diffusion + 4.0 * speed * reach).sqrt());
    Some(root * root)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn species(radius: f32, diffusion: f64, thermal_speed: f64) -> Species {
        Species { name: "A".into(), radius, diffusion, mass: 1.0, thermal_speed, ..Species::default() }
    }

    /// The number that an warnings says.
    fn advised(text: &str) -> f64 {
        let rest = text.split("time-step = ").nth(1).expect("an warnings");
        rest.split(' ').next().expect("a number").parse().expect("a number")
    }

    proptest! {
        #[test]
        fn advice_about_a_rate_is_right_when_followed(
            rate in -6.0..6.0_f64, diffusion in -4.0..4.0_f64, time_step in -12.0..2.0_f64
        ) {
            let [rate, diffusion, time_step] = [rate, diffusion, time_step].map(|x| 10_f64.powf(x));
            let says = |time_step: f64| {
                let radius = rate::binding_radius(rate, diffusion, time_step).unwrap();
                long_step("A + B -> C", (radius, diffusion, Some(rate)), time_step)
            };
            if let Some(text) = says(time_step) {
                let better = advised(&text);
                prop_assert!(better < time_step, "{text}");
                prop_assert_eq!(says(better), None);
                // And not needlessly short.
                prop_assert!(says(1.02 * better).is_some(), "{} is too cautious", better);
            }
        }

        #[test]
        fn advice_about_contact_is_right_when_followed(
            radius in -3.0..1.0_f64, diffusion in -4.0..4.0_f64, speed in -3.0..3.0_f64, still in 0..3
        ) {
            let [radius, mut diffusion, mut speed] = [radius, diffusion, speed].map(|x| 10_f64.powf(x));
            if still == 0 { diffusion = 0.0 }
            if still == 1 { speed = 0.0 }
            let says = |time_step: f64| missed_contact(&Model {
                time_step,
                species: vec![species(radius as f32, diffusion, speed), species(0.0, diffusion, 0.0)],
                contact: Contact::Separate,
                ..Model::default()
            });
            let better = advised(&says(1e12).expect("an warnings"));
            prop_assert_eq!(says(better), None);
            prop_assert!(says(1.02 * better).is_some(), "{} is too cautious", better);
        }
    }

    #[test]
    fn walls_keep_things_away() {
        let walls = Boundary::reflecting([-1.0; 3], [1.0; 3]);
        assert!(!is_walled_off(&walls, [1.5, 0.0, 0.0], 0.6) && is_walled_off(&walls, [1.5, 1.5, 0.0], 0.6));
        assert!(!is_walled_off(&walls, [1.0; 3], 0.0) && is_walled_off(&walls, [1.1, 0.0, 0.0], 0.0));
        let periodic = Boundary::periodic([-1.0; 3], [1.0; 3]);
        assert!(!is_walled_off(&periodic, [9.0; 3], 0.0));
        assert_eq!(image(&periodic, [0.5; 3]), None);
        assert!(image(&periodic, [1.5, 0.0, 0.0]).is_some_and(|text| text.contains("[-0.5, 0.0, 0.0]")));
    }
}
