use super::transport::drift;
use crate::model::boundary::Axis;
use crate::model::receiver::Receiver;
use crate::model::{Model, Species};

/// Least √(2DΔt), in distances of neighboring numbers u: rounding adds u²/12 to the mean square, 1 % at 3 u.
const LEAST_STEP: f64 = 3.0;
/// Least displacement by drift or speed without diffusion, in the same distances, to multiples of which steps are
/// rounded.
const LEAST_DRIFT: f64 = 50.0;

struct Motion<'a> {
    name: &'a str,
    diffusion: f64,
    velocity: [f64; 3],
}

/// Short steps far from the origin are rounded, because positions are `f32`.
pub(in crate::scenario) fn rounded_steps(model: &Model, species: usize) -> Option<String> {
    let Species { ref name, diffusion, speed, thermal_speed, .. } = model.species[species];
    let own_speed = speed.max(thermal_speed);
    // Own velocities vary in direction, so that drifts are rounded to either side.
    let velocity = if own_speed > 0.0 { [own_speed; 3] } else { drift(model, species) };
    rounded(model, &largest_coordinates(model), &Motion { name, diffusion, velocity })
}

/// Returns the first receiver whose steps are rounded, and a message.
pub(in crate::scenario) fn rounded_receiver_steps(model: &Model) -> Option<(usize, String)> {
    let largest = largest_coordinates(model);
    model.receivers.iter().enumerate().find_map(|(k, receiver)| {
        let Receiver { ref name, diffusion, velocity, .. } = *receiver;
        Some((k, rounded(model, &largest, &Motion { name, diffusion, velocity })?))
    })
}

fn rounded(model: &Model, largest: &[f32; 3], motion: &Motion<'_>) -> Option<String> {
    let dimensions = model.boundary.dimensions();
    let spread = (2.0 * motion.diffusion * model.time_step).sqrt();
    (0..dimensions).find_map(|axis| {
        let largest = largest[axis];
        let unit = f64::from(largest.next_up()) - f64::from(largest);
        let carried = motion.velocity[axis].abs() * model.time_step;
        let (cause, length, min_length) = if spread > 0.0 && spread < LEAST_STEP * unit {
            ("diffusion", spread, LEAST_STEP * unit)
        } else if spread == 0.0 && carried > 0.0 && carried < LEAST_DRIFT * unit {
            ("its velocity", carried, LEAST_DRIFT * unit)
        } else {
            return None;
        };
        let longer = match spread > 0.0 {
            true => min_length * min_length / (2.0 * motion.diffusion),
            false => min_length / motion.velocity[axis].abs(),
        };
        Some(format!(
            "a step takes {} {length:.3e} µm by {cause}, but coordinates up to {largest:e} µm are multiples of {unit:.1e} µm in \
             single precision, which rounds its steps; time-step = {:.2e} is long enough, or move the scene to the origin",
            motion.name,
            1.006 * longer
        ))
    })
}

fn largest_coordinates(model: &Model) -> [f32; 3] {
    std::array::from_fn(|axis| largest_coordinate(model, axis))
}

fn largest_coordinate(model: &Model, axis: usize) -> f32 {
    if let Axis::Reflecting { low, high } | Axis::Periodic { low, high } = model.boundary.axes[axis] {
        return low.abs().max(high.abs());
    }
    if let Some(vessel) = model.boundary.vessel.filter(|vessel| vessel.along != Some(axis)) {
        return vessel.center[axis].abs() + vessel.radius;
    }
    let centers = model.transmitters.iter().map(|one| one.center);
    let all = centers.chain(model.receivers.iter().map(|one| one.center));
    all.map(|center| center[axis].abs()).fold(0.0, f32::max)
}
