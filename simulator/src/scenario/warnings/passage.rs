use super::below;
use crate::model::boundary::Axis;
use crate::model::membrane::{MAX_SUBSTEPS, Membrane, MembraneSurface};
use crate::model::receiver::signed_distance;
use crate::model::{Model, Species, share_species};

/// Largest √(2DΔt) at a spherical membrane, in radii.
const LONG_AT_SPHERE: f64 = 0.25;
/// Least distance of a membrane from another or its own image, and of a plane from a wall, in √(2DΔt) of a step or,
/// between planes, of the shortest substep.
const STEPS_IN_GAP: f64 = 2.5;

struct Gap {
    /// In µm.
    length: f64,
    next: String,
    /// Between planes, long steps are divided.
    are_planes: bool,
}

impl Gap {
    /// Returns the largest √(2DΔt) without a warning, in µm.
    fn longest_step(&self) -> f64 {
        let substeps = if self.are_planes { f64::from(MAX_SUBSTEPS) } else { 1.0 };
        substeps.sqrt() * self.length / STEPS_IN_GAP
    }
}

pub(in crate::scenario) fn long_step_through(membrane: &Membrane, model: &Model) -> Option<String> {
    let MembraneSurface::Sphere { radius, .. } = membrane.surface else { return None };
    let species = fastest(membrane, model)?;
    let step = (2.0 * species.diffusion * model.time_step).sqrt();
    let longest = (LONG_AT_SPHERE * f64::from(radius)).powi(2) / (2.0 * species.diffusion);
    let effect = match gap(membrane, model).filter(|gap| step > gap.longest_step()) {
        None => "the equilibrium is right, but the flux is not".to_owned(),
        Some(gap) => format!("neither the flux nor, so near {}, the equilibrium is right", gap.next),
    };
    (model.time_step > longest).then(|| {
        format!(
            "a step takes {} {step:.3} µm, which is long compared with the radius of {radius} µm of {}: {effect}; time-step = {} \
             is short enough",
            species.name,
            membrane.name,
            below(longest)
        )
    })
}

/// Membranes are exact for steps and substeps that reach one and no wall.
pub(in crate::scenario) fn long_step_between_membranes(membrane: &Membrane, model: &Model) -> Option<String> {
    let species = fastest(membrane, model)?;
    let gap = gap(membrane, model)?;
    if gap.length <= 0.0 {
        return Some(format!(
            "{} touches or crosses {}: steps that reach both pass the membrane at a wrong rate; move them apart",
            membrane.name, gap.next
        ));
    }
    let longest = gap.longest_step().powi(2) / (2.0 * species.diffusion);
    (model.time_step > longest).then(|| {
        format!(
            "a step takes {} {:.3} µm, which is long for the gap of {:.3} µm between {} and {}: steps that reach both pass the \
             membrane at a wrong rate; time-step = {} is short enough",
            species.name,
            (2.0 * species.diffusion * model.time_step).sqrt(),
            gap.length,
            membrane.name,
            gap.next,
            below(longest)
        )
    })
}

fn fastest<'a>(membrane: &Membrane, model: &'a Model) -> Option<&'a Species> {
    let seen = model.species.iter().zip(&membrane.sees).filter(|(_, sees)| **sees);
    seen.map(|(species, _)| species).max_by(|a, b| a.diffusion.total_cmp(&b.diffusion))
}

/// Returns the smallest gap next to a membrane.
fn gap(membrane: &Membrane, model: &Model) -> Option<Gap> {
    let shares =
        |other: &&Membrane| !std::ptr::eq(*other, membrane) && share_species(&membrane.sees, &other.sees);
    let others = model.membranes.iter().filter(shares).filter_map(|other| {
        let length = distance([membrane.surface, other.surface], model)?;
        let are_planes = [membrane, other].iter().all(|membrane| is_plane(membrane));
        Some(Gap { length, next: other.name.clone(), are_planes })
    });
    let gaps = others.chain(gap_to_boundary(membrane, model));
    gaps.min_by(|a, b| a.length.total_cmp(&b.length))
}

fn gap_to_boundary(membrane: &Membrane, model: &Model) -> Option<Gap> {
    let are_planes = is_plane(membrane);
    let image =
        |length: f32| Gap { length: length.into(), next: "its periodic image".to_owned(), are_planes };
    match membrane.surface {
        MembraneSurface::Plane { axis, position } => match model.boundary.axes[axis] {
            Axis::Periodic { low, high } => Some(image(high - low)),
            Axis::Reflecting { low, high } => {
                let seen = model.species.iter().zip(&membrane.sees).filter(|(_, sees)| **sees);
                let radius = seen.map(|(species, _)| species.radius).fold(0.0, f32::max);
                let length = f64::from((position - low).min(high - position) - radius);
                Some(Gap { length, next: "a wall".to_owned(), are_planes })
            }
            _ => None,
        },
        MembraneSurface::Sphere { radius, .. } => {
            Some(image(model.boundary.shortest_period()? - 2.0 * radius))
        }
    }
}

fn is_plane(membrane: &Membrane) -> bool {
    matches!(membrane.surface, MembraneSurface::Plane { .. })
}

/// Returns 0 or less for surfaces that touch or cross, and `None` for planes across different axes.
fn distance(surfaces: [MembraneSurface; 2], model: &Model) -> Option<f64> {
    use MembraneSurface::{Plane, Sphere};
    let along = |axis: usize, offset: f32| f64::from(model.boundary.axes[axis].displacement(offset)).abs();
    match surfaces {
        [Plane { axis, position }, Plane { axis: other, position: at }] => {
            (axis == other).then(|| along(axis, position - at))
        }
        [Plane { axis, position }, Sphere { center, radius }]
        | [Sphere { center, radius }, Plane { axis, position }] => {
            Some(along(axis, position - center[axis]) - f64::from(radius))
        }
        [Sphere { center, radius }, Sphere { center: at, radius: other }] => {
            let apart = f64::from(signed_distance(0.0, center, &model.boundary, at));
            let [radius, other] = [radius, other].map(f64::from);
            // One of both is negative.
            Some((apart - (radius + other)).max((radius - other).abs() - apart))
        }
    }
}
