use std::collections::HashSet;

use lazygrid_io::excerpt;
use lazygrid_scenario as file;

use super::checks::warn;
use super::schedule::{MAX_BITS, bits_span, schedule, to_f32};
use super::space::number;
use super::{Names, equation_name, number_equal_names};
use crate::model::boundary::{Axis, Boundary};
use crate::model::transmitter::{CountDistribution, Schedule, Shape, Transmitter};
use crate::scenario::{Problem, warnings};

pub(super) fn transmitters(
    many: Vec<file::Transmitter>,
    names: &Names<'_>,
    boundary: &Boundary,
    warnings: &mut Vec<Problem>,
) -> Result<Vec<Transmitter>, Problem> {
    let (mut all, mut known, mut symbols) = (Vec::new(), HashSet::new(), 0);
    for one in many {
        let (span, of_bits) = (one.name.span(), bits_span(&one));
        let resolved = transmitter(one, names, boundary, warnings)?;
        if let Schedule::Message(message) = &resolved.schedule {
            symbols += message.symbols.len() as usize;
        }
        if let Some(message) = resolved.point_beyond_range() {
            return Err(Problem::at(span, message));
        }
        if symbols > MAX_BITS {
            let message = format!(
                "the transmitters up to '{}' send {symbols} symbols, more than the limit of {MAX_BITS}; send fewer",
                resolved.name
            );
            return Err(Problem::at(of_bits, message));
        }
        if !known.insert(resolved.name.clone()) {
            let message = format!("there are two transmitters '{}'; rename one", resolved.name);
            return Err(Problem::at(span, message));
        }
        all.push(resolved);
    }
    Ok(all)
}

fn transmitter(
    transmitter: file::Transmitter,
    names: &Names<'_>,
    boundary: &Boundary,
    warnings: &mut Vec<Problem>,
) -> Result<Transmitter, Problem> {
    let (center, span) = match &transmitter.center {
        None => ([0.0; 3], transmitter.name.span()),
        Some(center) => (to_f32(*center.get_ref()), center.span()),
    };
    check_position(boundary, span, center, 0.0, warnings)?;
    if let Some(message) = faulty_shell(shape(transmitter.shape)) {
        return Err(Problem {
            key: Some("shape".to_owned()),
            ..Problem::at(transmitter.name.span(), message)
        });
    }
    let (schedule, release) = schedule(&transmitter, names)?;
    Ok(Transmitter {
        name: transmitter.name.into_inner().0,
        center,
        carrier: None,
        shape: shape(transmitter.shape),
        schedule,
        release,
        numbers: match transmitter.numbers {
            file::Numbers::Fixed => CountDistribution::Fixed,
            file::Numbers::Poisson => CountDistribution::Poisson,
        },
    })
}

fn shape(shape: file::Shape) -> Shape {
    match shape {
        file::Shape::Point => Shape::Point,
        file::Shape::Gaussian { width } => Shape::Gaussian(width.0 as f32),
        file::Shape::Ball { inner_radius, radius } => Shape::Shell(inner_radius.0 as f32, radius.0 as f32),
        file::Shape::Box { size } => Shape::Box(size.map(|side| side.0 as f32)),
        file::Shape::Cylinder { axis, radius, length } => {
            Shape::Cylinder(number(axis), radius.0 as f32, length.0 as f32)
        }
        file::Shape::Lattice { size, places } => {
            Shape::Lattice(size.map(|side| side.0 as f32), places.map(Into::into))
        }
    }
}

fn faulty_shell(shape: Shape) -> Option<String> {
    let Shape::Shell(inner, outer) = shape else { return None };
    (inner > outer).then(|| {
        format!("the inner-radius {inner} µm of the ball exceeds its radius {outer} µm; make it smaller")
    })
}

pub(super) fn sources(
    many: &[file::Source],
    names: &Names<'_>,
    boundary: &Boundary,
    warnings: &mut Vec<Problem>,
) -> Result<Vec<Transmitter>, Problem> {
    let one = |one| source(one, names, boundary, warnings);
    let mut all = many.iter().map(one).collect::<Result<Vec<_>, _>>()?;
    number_equal_names(all.iter_mut().map(|source| &mut source.name));
    Ok(all)
}

fn source(
    source: &file::Source,
    names: &Names<'_>,
    boundary: &Boundary,
    warnings: &mut Vec<Problem>,
) -> Result<Transmitter, Problem> {
    let (text, span) = (excerpt(source.equation.get_ref().as_bytes()), source.equation.span());
    let [left, right] = names.equation(&source.equation)?;
    let ([], &[species]) = (left.as_slice(), right.as_slice()) else {
        return Err(Problem::at(
            span,
            format!("'{text}' must have no reactant and one product, as in '-> A'"),
        ));
    };
    let dimensions = boundary.dimensions();
    let center_and_span = source.center.as_ref().map(|center| (to_f32(*center.get_ref()), center.span()));
    let (center, shape, volume) = match &source.shape {
        None => {
            if let Some((_, span)) = center_and_span {
                let message = "a center needs a shape; without both, particles appear everywhere".to_owned();
                return Err(Problem::at(span, message));
            }
            let Some((center, shape, volume)) = everywhere(boundary, names.species[species as usize].radius)
            else {
                let message = format!("'{text}' needs a [boundary], or a shape in which particles appear");
                return Err(Problem::at(span, message));
            };
            (center, shape, volume)
        }
        Some(spanned) => {
            let shape = shape(*spanned.get_ref());
            if let Some(message) = faulty_shell(shape) {
                return Err(Problem::at(spanned.span(), message));
            }
            let volume = match shape {
                Shape::Shell(inner, outer) => ball(dimensions, outer) - ball(dimensions, inner),
                Shape::Box(sides) => sides[..dimensions].iter().copied().map(f64::from).product(),
                _ => {
                    let message =
                        "particles appear in a ball or in a box; these shapes have a volume".to_owned();
                    return Err(Problem::at(spanned.span(), message));
                }
            };
            let (center, span) = center_and_span.unwrap_or(([0.0; 3], spanned.span()));
            check_position(boundary, span, center, 0.0, warnings)?;
            (center, shape, volume)
        }
    };
    let rates = vec![(species, source.rate.0 * volume)];
    Ok(Transmitter {
        name: equation_name(&source.equation),
        center,
        carrier: None,
        shape,
        schedule: Schedule::Steady { from: 0.0, until: f64::INFINITY, rates },
        release: Vec::new(),
        numbers: CountDistribution::Poisson,
    })
}

/// Returns center, shape and volume of the space of a particle's center; `None` if unbounded.
fn everywhere(boundary: &Boundary, radius: f32) -> Option<([f32; 3], Shape, f64)> {
    let side = |axis: Axis| match axis {
        Axis::Open => None,
        Axis::Frozen => Some([0.0; 2]),
        Axis::Reflecting { low, high } | Axis::Periodic { low, high } => Some([low, high]),
    };
    let inset = boundary.inset(radius);
    if let Some(vessel) = inset.vessel {
        let Some(along) = vessel.along else {
            return Some((vessel.center, Shape::Shell(0.0, vessel.radius), ball(3, vessel.radius + radius)));
        };
        let [[low, high], [from, to]] = [side(inset.axes[along])?, side(boundary.axes[along])?];
        let mut center = vessel.center;
        center[along] = 0.5 * (low + high);
        let volume = ball(2, vessel.radius + radius) * extent([from, to]);
        return Some((center, Shape::Cylinder(along, vessel.radius, high - low), volume));
    }
    let sides = |boundary: &Boundary| {
        let [x, y, z] = boundary.axes.map(side);
        Some([x?, y?, z?])
    };
    let inside = sides(&inset)?;
    let volume = sides(boundary)?.map(extent).into_iter().product();
    let sides = inside.map(|[low, high]| high - low);
    Some((inside.map(|[low, high]| 0.5 * (low + high)), Shape::Box(sides), volume))
}

/// Returns 1 along a frozen axis.
fn extent([low, high]: [f32; 2]) -> f64 {
    if low == high { 1.0 } else { f64::from(high - low) }
}

fn ball(dimensions: usize, radius: f32) -> f64 {
    let (pi, radius) = (std::f64::consts::PI, f64::from(radius));
    match dimensions {
        3 => 4.0 / 3.0 * pi * radius.powi(3),
        2 => pi * radius.powi(2),
        _ => 2.0 * radius,
    }
}

pub(super) fn check_position(
    boundary: &Boundary,
    span: std::ops::Range<usize>,
    center: [f32; 3],
    radius: f32,
    warnings: &mut Vec<Problem>,
) -> Result<(), Problem> {
    if warnings::is_walled_off(boundary, center, radius) {
        let walls = warnings::walls(boundary);
        return Err(Problem::at(span, format!("{center:?} is outside {walls}; move it inside")));
    }
    warn(warnings, span, warnings::image(boundary, center));
    Ok(())
}
