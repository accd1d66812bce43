use std::path::Path;

use lazygrid_scenario::{self as file, AxisName, BoundaryKind, Finite};
use toml::Spanned;

use super::checks::{refuse_keys, span_of};
use super::flow_field;
use super::schedule::to_f32;
use crate::model::Flow;
use crate::model::boundary::{Axis, Boundary};
use crate::model::vessel::Vessel;
use crate::scenario::Problem;

pub(super) fn boundary(boundary: Option<&file::Boundary>, dimensions: usize) -> Result<Boundary, Problem> {
    let mut found = match boundary.map(|boundary| (boundary, *boundary.kind.get_ref())) {
        None => Boundary::default(),
        Some((boundary, BoundaryKind::Cylinder)) => cylinder(boundary)?,
        Some((boundary, BoundaryKind::Sphere)) => sphere(boundary)?,
        Some((boundary, kind)) => walls(boundary, kind, dimensions)?,
    };
    let ends = boundary.and_then(|boundary| boundary.ends.as_ref());
    if let (Some(ends), true) = (ends, dimensions < 3) {
        let message = format!("a cylinder in {dimensions} dimensions is a disk, without ends; remove them");
        return Err(Problem::at(ends.span(), message));
    }
    found.axes[dimensions..].fill(Axis::Frozen);
    Ok(found)
}

fn walls(boundary: &file::Boundary, kind: BoundaryKind, dimensions: usize) -> Result<Boundary, Problem> {
    let others = [
        ("axis", span_of(&boundary.axis)),
        ("center", span_of(&boundary.center)),
        ("radius", span_of(&boundary.radius)),
        ("ends", span_of(&boundary.ends)),
        ("at-ends", span_of(&boundary.at_ends)),
    ];
    refuse_keys(others, |key| {
        format!("{key} goes with kind = \"cylinder\" or \"sphere\"; a box has low and high")
    })?;
    let (Some(low), Some(high)) = (&boundary.low, &boundary.high) else {
        return Err(Problem::at(boundary.kind.span(), "a box needs low and high, its corners".to_owned()));
    };
    let [from, to] = [low, high].map(|corner| to_f32(*corner.get_ref()));
    if (0..dimensions).any(|k| from[k] >= to[k]) {
        let message = format!("{to:?} is not above low = {from:?} along every axis");
        return Err(Problem::at(high.span(), message));
    }
    Ok(match kind {
        BoundaryKind::Periodic => Boundary::periodic(from, to),
        _ => Boundary::reflecting(from, to),
    })
}

fn sphere(boundary: &file::Boundary) -> Result<Boundary, Problem> {
    let others = [
        ("axis", span_of(&boundary.axis)),
        ("ends", span_of(&boundary.ends)),
        ("at-ends", span_of(&boundary.at_ends)),
    ];
    refuse_keys(others, |key| format!("{key} goes with a cylinder; a sphere has a radius and a center"))?;
    Ok(Boundary { vessel: Some(vessel(boundary, None)?), ..Boundary::default() })
}

fn vessel(boundary: &file::Boundary, along: Option<usize>) -> Result<Vessel, Problem> {
    refuse_keys([("low", span_of(&boundary.low)), ("high", span_of(&boundary.high))], |key| {
        format!(
            "{key} goes with a box; a cylinder or sphere has a radius and a center, and a cylinder an axis and ends"
        )
    })?;
    let Some(radius) = &boundary.radius else {
        let message = "a cylinder or sphere needs a radius".to_owned();
        return Err(Problem::at(boundary.kind.span(), message));
    };
    let center = boundary.center.as_ref().map_or([0.0; 3], |center| to_f32(*center.get_ref()));
    Ok(Vessel { along, center, radius: radius.get_ref().0 as f32 })
}

fn cylinder(boundary: &file::Boundary) -> Result<Boundary, Problem> {
    let along = number(boundary.axis.as_ref().map(|axis| *axis.get_ref()).unwrap_or_default());
    let vessel = vessel(boundary, Some(along))?;
    let mut axes = [Axis::Open; 3];
    match (&boundary.ends, &boundary.at_ends) {
        (None, None) => {}
        (Some(ends), kind) => {
            let [low, high] = ends.get_ref().map(|Finite(x)| x as f32);
            if low >= high {
                return Err(Problem::at(ends.span(), format!("the upper end {high} is not above {low}")));
            }
            axes[along] = match kind.as_ref().map(|kind| *kind.get_ref()) {
                None | Some(file::Ends::Reflecting) => Axis::Reflecting { low, high },
                Some(file::Ends::Periodic) => Axis::Periodic { low, high },
            };
        }
        (None, Some(kind)) => {
            return Err(Problem::at(
                kind.span(),
                "at-ends needs ends, their two coordinates along the axis".to_owned(),
            ));
        }
    }
    Ok(Boundary { axes, vessel: Some(vessel) })
}

pub(super) fn number(axis: AxisName) -> usize {
    match axis {
        AxisName::X => 0,
        AxisName::Y => 1,
        AxisName::Z => 2,
    }
}

pub(super) fn flow(
    flow: Option<&file::Flow>,
    boundary: &Boundary,
    directory: &Path,
) -> Result<Option<Flow>, Problem> {
    let Some(flow) = flow else { return Ok(None) };
    if *flow.profile.get_ref() == file::Profile::Field {
        return flow_field::read(flow, directory).map(|field| Some(Flow::Field(field)));
    }
    flow_field::check_unused(flow)?;
    let span = flow.profile.span();
    let along = |speed: f64| match boundary.vessel.and_then(|vessel| vessel.along) {
        Some(along) => Ok(std::array::from_fn(|k| if k == along { speed } else { 0.0 })),
        None => {
            let message = "a speed needs a cylinder, and the boundary is not one; give a velocity".to_owned();
            Err(Problem::at(span.clone(), message))
        }
    };
    Ok(Some(match (*flow.profile.get_ref(), &flow.velocity, &flow.speed) {
        (file::Profile::Plug, Some(velocity), None) => Flow::Plug(velocity.get_ref().map(|Finite(v)| v)),
        (file::Profile::Plug, None, Some(speed)) => Flow::Plug(along(speed.get_ref().0)?),
        (file::Profile::Poiseuille, None, Some(speed)) => {
            along(0.0)?;
            Flow::Poiseuille { mean: speed.get_ref().0 }
        }
        (file::Profile::Plug, ..) => {
            return Err(Problem::at(
                span,
                "a plug needs either a velocity, or a speed along the cylinder".to_owned(),
            ));
        }
        (file::Profile::Poiseuille | file::Profile::Field, ..) => {
            return Err(Problem::at(
                span,
                "Poiseuille flow needs a speed, its mean along the cylinder".to_owned(),
            ));
        }
    }))
}

pub(super) fn flow_pulse(flow: &file::Flow) -> Result<Option<[f64; 2]>, Problem> {
    let Some(key) = flow.until.as_ref().or(flow.from.as_ref()) else { return Ok(None) };
    let time = |key: &Option<Spanned<file::NotNegative>>| key.as_ref().map(|time| time.get_ref().0);
    let [from, until] = [time(&flow.from).unwrap_or(0.0), time(&flow.until).unwrap_or(f64::INFINITY)];
    if from >= until {
        let message =
            format!("the flow is on from {from} s until {until} s; the end must be later than the beginning");
        return Err(Problem::at(key.span(), message));
    }
    Ok(Some([from, until]))
}
