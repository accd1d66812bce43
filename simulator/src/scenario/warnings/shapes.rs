use lazygrid_io::excerpt;

use crate::model::boundary::{Axis, Boundary};
use crate::model::transmitter::{Shape, Transmitter};
use crate::random::philox::{Key, Purpose};

/// Points that estimate the fraction of a shape outside the walls.
const SAMPLED_POINTS: u32 = 1000;
/// Larger fractions outside a vessel exclude a few particles in a thousand from all draws of `drawn_within_vessel`.
const MOST_OUTSIDE: f64 = 0.9;
/// Fraction of a coordinate or extent that rounding may add.
const ROUNDING: f32 = 1e-5;

/// Warns of points that walls mirror or exclude, and of a shape that overlaps its own images.
pub(in crate::scenario) fn misplaced_shape(transmitter: &Transmitter, boundary: &Boundary) -> Option<String> {
    if let Some(message) = longer_than_period(transmitter, boundary) {
        return Some(message);
    }
    let (beyond, outside) = fractions_outside(transmitter, boundary);
    // A mirrored Gaussian is that of diffusion in front of walls.
    let is_mirrored = beyond > 0.0 && !matches!(transmitter.shape, Shape::Gaussian(_));
    let name = excerpt(transmitter.name.as_bytes());
    let reason = match (is_source(transmitter), is_mirrored, outside) {
        (true, ..) if beyond + outside > 0.0 => format!(
            "{:.1} % of the shape of '{name}' is outside the walls, so that more particles appear in the rest of it",
            100.0 * (beyond + outside)
        ),
        (false, true, _) => format!(
            "{:.1} % of the points of transmitter {name} are beyond the walls, which mirror them",
            100.0 * beyond
        ),
        (false, false, outside) if outside > MOST_OUTSIDE => format!(
            "{:.1} % of the points of transmitter {name} are outside the vessel, so that some particles appear anywhere in it",
            100.0 * outside
        ),
        _ => return None,
    };
    Some(reason + "; make the shape smaller, or move it")
}

fn is_source(transmitter: &Transmitter) -> bool {
    // Names of transmitters contain no arrow.
    transmitter.name.contains("->")
}

fn longer_than_period(transmitter: &Transmitter, boundary: &Boundary) -> Option<String> {
    if matches!(transmitter.shape, Shape::Gaussian(_)) {
        return None;
    }
    let half_extent = transmitter.shape.half_extent();
    let of_axis = |k: usize| {
        let period = boundary.axes[k].period();
        let length = 2.0 * half_extent[k] as f32;
        (period > 0.0 && length > period * (1.0 + ROUNDING)).then_some((k, length, period))
    };
    let (axis, length, period) = (0..3).find_map(of_axis)?;
    let (name, axis) = (excerpt(transmitter.name.as_bytes()), ["x", "y", "z"][axis]);
    let owner = if is_source(transmitter) { format!("'{name}'") } else { format!("transmitter {name}") };
    Some(format!(
        "the shape of {owner} is {length} µm long along {axis}, more than the period of {period} µm, so that it overlaps its own \
         images; make it smaller"
    ))
}

/// Returns the fractions of points beyond plane walls, and of the others outside a vessel.
fn fractions_outside(transmitter: &Transmitter, boundary: &Boundary) -> (f64, f64) {
    let Transmitter { center, shape, .. } = *transmitter;
    if shape == Shape::Point {
        return (0.0, 0.0);
    }
    let slack = |at: f32, extent: f64| ROUNDING * (at.abs() + extent as f32);
    let half_extent = shape.half_extent();
    let is_beyond = |point: [f32; 3]| {
        (0..3).any(|k| match boundary.axes[k] {
            Axis::Reflecting { low, high } => {
                let slack = slack(point[k], half_extent[k]);
                point[k] < low - slack || point[k] > high + slack
            }
            _ => false,
        })
    };
    let is_outside = |point: [f32; 3]| {
        boundary
            .vessel
            .is_some_and(|vessel| vessel.distance(point) > f64::from(vessel.radius * (1.0 + ROUNDING)))
    };
    let (mut beyond, mut outside) = (0, 0);
    for k in 0..SAMPLED_POINTS {
        let words = Key::new(0).draw(k, 0, 0, Purpose::Release);
        let offset = shape.offset(words, shape.random_site(words[0]), boundary);
        let point = std::array::from_fn(|axis| center[axis] + offset[axis]);
        beyond += u32::from(is_beyond(point));
        outside += u32::from(!is_beyond(point) && is_outside(point));
    }
    (f64::from(beyond) / f64::from(SAMPLED_POINTS), f64::from(outside) / f64::from(SAMPLED_POINTS))
}
