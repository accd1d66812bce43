use super::below;
use crate::model::boundary::{Axis, Boundary};
use crate::model::receiver::ReceiverKind;
use crate::model::{Contact, Model, Species};

/// Largest mean number of collisions per particle and step. With more, separated particles diffuse more slowly, and
/// receivers see the chord of a bent path.
const MANY_COLLISIONS: f64 = 1.0;
/// Largest mean number if the result is right with more, but takes long.
const COSTLY_COLLISIONS: f64 = 100.0;

/// Assumes the density after `steps`, in bounded space.
pub(in crate::scenario) fn many_collisions(model: &Model, steps: u32) -> Option<String> {
    let sees_paths =
        !model.reactions.is_empty() || model.receivers.iter().any(|r| r.kind != ReceiverKind::Transparent);
    let limit = match model.contact {
        Contact::Separate => MANY_COLLISIONS,
        Contact::Elastic if sees_paths => MANY_COLLISIONS,
        Contact::Elastic => COSTLY_COLLISIONS,
        _ => return None,
    };
    // The detector refuses more species.
    if model.species.len() > lazygrid::Interactions::MAX_SPECIES as usize {
        return None;
    }
    let volume = volume(&model.boundary)?;
    let mut counts = vec![0.0; model.species.len()];
    for transmitter in &model.transmitters {
        for (species, count) in transmitter.mean_between([0, steps], model.time_step) {
            counts[species as usize] += count;
        }
    }
    let sphere = |species: &Species| std::f64::consts::PI / 6.0 * (2.0 * f64::from(species.radius)).powi(3);
    let filled = model.species.iter().zip(&counts).map(|(s, n)| n * sphere(s)).sum::<f64>() / volume;
    // The contact value of Carnahan and Starling, up to random close packing.
    let filled = filled.min(0.64);
    let contact_value = (1.0 - filled / 2.0) / (1.0 - filled).powi(3);
    // Collisions of a particle with all others: by diffusion per √s, and by speed per s.
    let rates = model.species.iter().filter(|a| a.radius > 0.0 || counts.len() > 1).map(|a| {
        let with = |(b, &count): (&Species, &f64)| {
            let cross_section = std::f64::consts::PI * touch(a, b).powi(2);
            let [diffusion, speed] = relative(a, b);
            let mean = (8.0 / std::f64::consts::PI).sqrt();
            [diffusion.sqrt() * mean, speed * mean]
                .map(|s| s * count / volume * cross_section * contact_value)
        };
        let all = model.species.iter().zip(&counts).map(with);
        all.fold([0.0; 2], |sum, rate| [sum[0] + rate[0], sum[1] + rate[1]])
    });
    let collisions = |[diffusive, ballistic]: [f64; 2], time: f64| diffusive * time.sqrt() + ballistic * time;
    let worst = rates
        .zip(&model.species)
        .max_by(|a, b| collisions(a.0, model.time_step).total_cmp(&collisions(b.0, model.time_step)));
    let (rate, species) = worst?;
    let expected = collisions(rate, model.time_step);
    (expected > limit).then(|| {
        // The root of ballistic·s² + diffusive·s − limit, s = √t, without cancellation.
        let root = 2.0 * limit / (rate[0] + (rate[0].powi(2) + 4.0 * rate[1] * limit).sqrt());
        let effect = match model.contact {
            Contact::Separate => {
                "positions stay those of hard spheres, but they diffuse more slowly than in short steps"
            }
            _ if sees_paths => "receivers and reactions see only the ends of such a path",
            _ => "the result is right, but takes long",
        };
        format!(
            "{} collides about {expected:.1} times in a step: {effect}; time-step = {} has {limit} or fewer",
            species.name,
            below(root * root)
        )
    })
}

fn volume(boundary: &Boundary) -> Option<f64> {
    let length = |axis: Axis| match axis {
        Axis::Reflecting { low, high } | Axis::Periodic { low, high } => Some(f64::from(high - low)),
        // The estimate needs three dimensions and a volume.
        Axis::Open | Axis::Frozen => None,
    };
    match &boundary.vessel {
        Some(vessel) => {
            let (pi, radius) = (std::f64::consts::PI, f64::from(vessel.radius));
            match vessel.along {
                Some(along) => Some(length(boundary.axes[along])? * pi * radius.powi(2)),
                None => Some(4.0 / 3.0 * pi * radius.powi(3)),
            }
        }
        None => boundary.axes.into_iter().map(length).product(),
    }
}

fn touch(a: &Species, b: &Species) -> f64 {
    f64::from(a.radius) + f64::from(b.radius)
}

/// Returns twice the sum of the diffusion coefficients, in µm²/s, and the standard deviation of the relative velocity
/// along an axis, in µm/s.
fn relative(a: &Species, b: &Species) -> [f64; 2] {
    let drift: f64 = a.drift.iter().zip(b.drift).map(|(u, v)| (u - v).powi(2)).sum();
    let thermal = a.thermal_speed.powi(2) + b.thermal_speed.powi(2);
    let swimming = (a.speed.powi(2) + b.speed.powi(2)) / 3.0;
    [2.0 * (a.diffusion + b.diffusion), (drift / 3.0 + thermal + swimming).sqrt()]
}
