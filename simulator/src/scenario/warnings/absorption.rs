use super::below;
use super::gaps::{Wall, absorbing_walls, absorbs_species};
use crate::model::boundary::Axis;
use crate::model::receiver::{Receiver, ReceiverKind, WallFace};
use crate::model::{Model, Species};

/// Largest √(2DΔt) near an absorbing disk, in radii: a disk in a square of 8 radii then absorbs 1 % too few (Monte
/// Carlo, 4·10⁵ particles).
const LONG_BY_DISK: f64 = 1.0;
/// Largest √(2DΔt) in a cylinder whose side absorbs, in radii: 1.2 % too few are left after a time of 0.25 R²/D, and
/// 5 % too many at 0.7 (same method).
const LONG_IN_CYLINDER: f64 = 0.5;
/// Largest √(2DΔt) between two walls of which one absorbs (see `gaps.rs`) or both, in distances L. If both do, 3 % too
/// many are left at 0.45 after a time of 0.2 L²/D, and 18 % at 0.63 (same method).
const LONG_BETWEEN_WALLS: f64 = 0.4;
/// Largest √(2DΔt) at a sphere that an absorbing wall cuts, in radii. A hemisphere absorbs 1.4 % too few at 0.47, and
/// 6 % at 0.94 (Monte Carlo, 10⁵ particles).
const LONG_AT_WALL: f64 = 0.4;

pub(in crate::scenario) fn long_step_to_absorber(model: &Model, species: usize) -> Option<String> {
    let one = &model.species[species];
    let seen = model.receivers.iter().filter(|receiver| receiver.sees[species]);
    let walls = absorbing_walls(model, species);
    let longest = |receiver: &Receiver| {
        let (length, surface) =
            longest_step(model, receiver, (species, one)).or_else(|| at_wall(receiver, &walls, species))?;
        Some((length * length / (2.0 * (one.diffusion + receiver.diffusion)), surface))
    };
    let all = seen.filter_map(|receiver| Some((longest(receiver)?, receiver)));
    let ((longest, surface), receiver) = all.min_by(|a, b| a.0.0.total_cmp(&b.0.0))?;
    (model.time_step > longest).then(|| {
        format!(
            "a step takes {} {:.3} µm by diffusion, which is long for {}, {surface}, which then absorbs at a wrong rate; time-step = \
             {} is short enough",
            one.name,
            (2.0 * (one.diffusion + receiver.diffusion) * model.time_step).sqrt(),
            receiver.name,
            below(longest)
        )
    })
}

/// Returns the longest √(2DΔt) in µm at a sphere that an absorbing wall cuts.
fn at_wall(receiver: &Receiver, walls: &[Wall], species: usize) -> Option<(f64, String)> {
    let is_cut = absorbs_species(receiver, species) && walls.iter().any(|wall| wall.cuts(receiver));
    let radius = f64::from(receiver.radius);
    is_cut.then(|| {
        (LONG_AT_WALL * radius, format!("a sphere of radius {radius} µm that an absorbing wall cuts"))
    })
}

/// Returns the longest √(2DΔt) in µm, and the surface; `None` if any step is right.
fn longest_step(
    model: &Model,
    receiver: &Receiver,
    (species, one): (usize, &Species),
) -> Option<(f64, String)> {
    match receiver.kind {
        ReceiverKind::Absorbing if model.boundary.dimensions() == 2 => {
            let radius = f64::from(receiver.radius);
            Some((LONG_BY_DISK * radius, format!("a disk of radius {} µm", receiver.radius)))
        }
        ReceiverKind::Wall(WallFace::Side) => {
            let vessel = model.boundary.vessel.filter(|vessel| vessel.along.is_some())?;
            let radius = f64::from(vessel.radius - one.radius);
            Some((
                LONG_IN_CYLINDER * radius,
                format!("the side of a cylinder of radius {} µm", vessel.radius),
            ))
        }
        ReceiverKind::Wall(face) => {
            let (axis, opposite) = match face {
                WallFace::Low(axis) => (axis, WallFace::High(axis)),
                WallFace::High(axis) => (axis, WallFace::Low(axis)),
                WallFace::Side => return None,
            };
            let is_opposite =
                |other: &Receiver| other.kind == ReceiverKind::Wall(opposite) && other.sees[species];
            let Axis::Reflecting { low, high } = model.boundary.axes[axis] else { return None };
            let distance = f64::from(high - low - 2.0 * one.radius);
            let also = model.receivers.iter().any(is_opposite);
            let pair = if also { "one of two walls that absorb" } else { "opposite to a wall that reflects" };
            Some((LONG_BETWEEN_WALLS * distance, format!("{pair}, {} µm apart", high - low)))
        }
        _ => None,
    }
}
