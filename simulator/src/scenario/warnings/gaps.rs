use super::below;
use super::close_pairs::close_pairs;
use super::transport::drift;
use crate::model::boundary::{Axis, Boundary};
use crate::model::receiver::{Receiver, ReceiverKind, WallFace, signed_distance};
use crate::model::{Model, Species, share_species};

/// Largest √(2DΔt) between two surfaces that face each other, in gaps L. From a point at 0.9 L, 1 % too many are left
/// in front of a wall that absorbs and opposite to one that reflects after a time of 0.5 L²/D, 9 % at 0.58 and 22 % at
/// 0.71 (Monte Carlo, 6·10⁴ particles).
const LONG_IN_GAP: f64 = 0.4;
/// Smaller gaps, in radii of the smaller sphere, are contacts: few particles reach them.
const CONTACT_GAP: f64 = 0.03;
/// Least drift across the gap of two walls, in D/L: weaker ones change a density by less than 2 %.
const LEAST_DRIFT: f64 = 0.02;

struct Gap {
    /// In µm.
    length: f64,
    /// In µm²/s.
    diffusion: f64,
    between: [Surface; 2],
}

/// Without names, because there may be hundreds of thousands of gaps.
#[derive(Clone, Copy)]
enum Surface {
    /// Index among the receivers that see the species.
    Receiver(usize),
    Image,
    Wall(WallFace),
}

impl Surface {
    fn name(self, seen: &[&Receiver]) -> String {
        match self {
            Self::Receiver(k) => seen[k].name.clone(),
            Self::Image => "its image in the periodic box".to_owned(),
            Self::Wall(WallFace::Low(axis)) => format!("the wall low-{}", ["x", "y", "z"][axis]),
            Self::Wall(WallFace::High(axis)) => format!("the wall high-{}", ["x", "y", "z"][axis]),
            Self::Wall(WallFace::Side) => "the side of the vessel".to_owned(),
        }
    }
}

/// A path is right if it reaches one of two surfaces.
pub(in crate::scenario) fn long_step_across_gap(model: &Model, species: usize) -> Option<String> {
    let one = &model.species[species];
    let seen: Vec<&Receiver> = model.receivers.iter().filter(|receiver| receiver.sees[species]).collect();
    let (walls, mut gaps) = (walls(model, &seen, species), Vec::new());
    for (k, receiver) in seen.iter().enumerate().filter(|(_, receiver)| is_surface(receiver)) {
        gaps.extend(walls.iter().filter_map(|wall| gap_to_wall(wall, (k, receiver), (species, one))));
        gaps.extend(gap_to_image(model, (k, receiver), species));
    }
    // Wider gaps are not too narrow for a step.
    let widest = (2.0 * one.diffusion * model.time_step).sqrt() / LONG_IN_GAP;
    let spheres: Vec<usize> = (0..seen.len()).filter(|&k| is_surface(seen[k])).collect();
    let receivers: Vec<&Receiver> = spheres.iter().map(|&k| seen[k]).collect();
    let pairs = close_pairs(&model.boundary, &receivers, widest).into_iter();
    let of_pair =
        |[k, l]: [usize; 2]| gap_between(model, [k, l].map(|at| (spheres[at], receivers[at])), species);
    gaps.extend(pairs.filter_map(of_pair));
    let longest = |gap: &Gap| (LONG_IN_GAP * gap.length).powi(2) / (2.0 * gap.diffusion);
    let worst = gaps.iter().min_by(|a, b| longest(a).total_cmp(&longest(b)))?;
    (model.time_step > longest(worst)).then(|| {
        let [a, b] = worst.between.map(|surface| surface.name(&seen));
        format!(
            "a step takes {} {:.3} µm by diffusion, which is long for the gap of {:.3} µm between {a} and {b}: steps that reach both \
             surfaces are taken at a wrong rate; time-step = {} is short enough",
            one.name,
            (2.0 * worst.diffusion * model.time_step).sqrt(),
            worst.length,
            below(longest(worst))
        )
    })
}

/// Receivers of the kind `endpoint` act on the ends of steps.
fn is_surface(receiver: &Receiver) -> bool {
    receiver.radius > 0.0 && (receiver.kind == ReceiverKind::Absorbing || receiver.kind.reflects())
}

pub(super) fn absorbs_species(receiver: &Receiver, species: usize) -> bool {
    receiver.sees[species] && (receiver.kind.absorbs() || receiver.binds(species))
}

fn gap_between(model: &Model, [(k, a), (l, b)]: [(usize, &Receiver); 2], species: usize) -> Option<Gap> {
    let meet = !a.moves() && !b.moves() && (absorbs_species(a, species) || absorbs_species(b, species));
    let length = f64::from(signed_distance(a.radius + b.radius, a.center, &model.boundary, b.center));
    let contact_gap = CONTACT_GAP * f64::from(a.radius.min(b.radius));
    (meet && length > contact_gap).then(|| Gap {
        length,
        diffusion: model.species[species].diffusion,
        between: [Surface::Receiver(k), Surface::Receiver(l)],
    })
}

fn gap_to_image(model: &Model, (k, receiver): (usize, &Receiver), species: usize) -> Option<Gap> {
    let length = f64::from(model.boundary.shortest_period()?) - 2.0 * f64::from(receiver.radius);
    (absorbs_species(receiver, species) && length > CONTACT_GAP * f64::from(receiver.radius)).then(|| Gap {
        length,
        diffusion: model.species[species].diffusion + receiver.diffusion,
        between: [Surface::Receiver(k), Surface::Image],
    })
}

pub(super) struct Wall {
    face: WallFace,
    absorbs: bool,
    domain: Boundary,
}

fn walls(model: &Model, seen: &[&Receiver], species: usize) -> Vec<Wall> {
    let domain = model.boundary.inset(model.species[species].radius);
    let reflecting = (0..3).filter(|&axis| matches!(domain.axes[axis], Axis::Reflecting { .. }));
    let plane = reflecting.flat_map(|axis| [WallFace::Low(axis), WallFace::High(axis)]);
    let faces = plane.chain(domain.vessel.map(|_| WallFace::Side));
    let absorbs = |face: WallFace| seen.iter().any(|one| one.kind == ReceiverKind::Wall(face));
    faces.map(|face| Wall { face, absorbs: absorbs(face), domain }).collect()
}

pub(super) fn absorbing_walls(model: &Model, species: usize) -> Vec<Wall> {
    let is_wall =
        |receiver: &&Receiver| matches!(receiver.kind, ReceiverKind::Wall(_)) && receiver.sees[species];
    let seen: Vec<&Receiver> = model.receivers.iter().filter(is_wall).collect();
    let mut walls = walls(model, &seen, species);
    walls.retain(|wall| wall.absorbs);
    walls
}

impl Wall {
    /// Returns `true` if a sphere that does not move reaches the wall.
    pub(super) fn cuts(&self, receiver: &Receiver) -> bool {
        let max_height = (1.0 + CONTACT_GAP as f32) * receiver.radius;
        !receiver.moves()
            && receiver.radius > 0.0
            && self.height(receiver.center).is_some_and(|height| height <= max_height)
    }

    /// Returns the distance of a point inside, in µm.
    fn height(&self, center: [f32; 3]) -> Option<f32> {
        match (self.face, self.domain.vessel) {
            (WallFace::Side, Some(vessel)) => Some(vessel.radius - vessel.distance(center) as f32),
            (WallFace::Side, None) => None,
            (WallFace::Low(axis) | WallFace::High(axis), _) => {
                let Axis::Reflecting { low, high } = self.domain.axes[axis] else { return None };
                let is_low = self.face == WallFace::Low(axis);
                Some(if is_low { center[axis] - low } else { high - center[axis] })
            }
        }
    }
}

fn gap_to_wall(
    wall: &Wall,
    (k, receiver): (usize, &Receiver),
    (species, one): (usize, &Species),
) -> Option<Gap> {
    let radius = f64::from(receiver.radius);
    let length = f64::from(wall.height(receiver.center)?) - radius;
    let meet = !receiver.moves() && (absorbs_species(receiver, species) || wall.absorbs);
    (meet && length > CONTACT_GAP * radius).then_some(Gap {
        length,
        diffusion: one.diffusion,
        between: [Surface::Receiver(k), Surface::Wall(wall.face)],
    })
}

/// Returns the first receiver that overlaps an earlier one and takes the same species, and a message.
pub(in crate::scenario) fn overlapping_absorbers(model: &Model) -> Option<(usize, String)> {
    let absorbs = |one: &Receiver| {
        matches!(one.kind, ReceiverKind::Absorbing | ReceiverKind::Partial(_)) && !one.moves()
    };
    let indices: Vec<usize> = (0..model.receivers.len()).filter(|&k| absorbs(&model.receivers[k])).collect();
    let all: Vec<&Receiver> = indices.iter().map(|&k| &model.receivers[k]).collect();
    let overlaps = |[other, one]: [&Receiver; 2]| {
        let contact_gap = -(CONTACT_GAP as f32) * one.radius.min(other.radius);
        let radii = one.radius + other.radius;
        share_species(&other.sees, &one.sees)
            && signed_distance(radii, one.center, &model.boundary, other.center) < contact_gap
    };
    let pairs = close_pairs(&model.boundary, &all, 0.0).into_iter();
    let overlapping = pairs.filter(|pair| overlaps(pair.map(|k| all[k])));
    let [other, one] = overlapping.min_by_key(|&[other, one]| [one, other])?;
    let message = format!(
        "{} overlaps {}, and both absorb the same particles: each takes its part of a step, so that steps that are long \
         compared with the overlap are taken at a wrong rate; move them apart, or let them see different species",
        all[one].name, all[other].name
    );
    Some((indices[one], message))
}

/// A step with drift that reaches both of two walls is mirrored; see [`wall`](crate::motion::wall).
pub(in crate::scenario) fn long_step_between_walls(model: &Model, species: usize) -> Option<String> {
    let one = &model.species[species];
    let length = |axis: usize| {
        let Axis::Reflecting { low, high } = model.boundary.axes[axis] else { return None };
        let absorbs = |receiver: &Receiver| receiver.is_across(axis) && receiver.sees[species];
        let length = f64::from(high - low - 2.0 * one.radius);
        let speed = drift(model, species)[axis].abs();
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
