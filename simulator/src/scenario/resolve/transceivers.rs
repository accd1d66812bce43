//! Transmitters and receivers.

use super::Names;
use crate::boundary::Boundary;
use crate::receiver::{Kind, Receiver};
use crate::scenario::file::{self, Finite};
use crate::scenario::{Problem, advice};
use crate::transmitter::{Shape, Transmitter};

pub(super) fn transmitters(
    many: Vec<file::Transmitter>,
    names: &Names<'_>,
    boundary: &Boundary,
    advice: &mut Vec<Problem>,
) -> Result<Vec<Transmitter>, Problem> {
    many.into_iter().map(|one| transmitter(one, names, boundary, advice)).collect()
}

fn transmitter(
    transmitter: file::Transmitter,
    names: &Names<'_>,
    boundary: &Boundary,
    advice: &mut Vec<Problem>,
) -> Result<Transmitter, Problem> {
    let (center, span) = match &transmitter.center {
        None => ([0.0; 3], transmitter.name.span()),
        Some(center) => (center.get_ref().map(|Finite(x)| x as f32), center.span()),
    };
    check_place(boundary, span, (center, 0.0), advice)?;
    let release =
        |release: &file::Release| -> Result<_, Problem> { Ok((names.get(&release.species)?, release.count)) };
    Ok(Transmitter {
        name: transmitter.name.into_inner().0,
        center,
        shape: match transmitter.shape {
            file::Shape::Point => Shape::Point,
            file::Shape::Gaussian { width } => Shape::Gaussian(width.0 as f32),
            file::Shape::Ball { inner_radius, radius } => {
                Shape::Shell(inner_radius.0 as f32, radius.0 as f32)
            }
            file::Shape::Box { size } => Shape::Box(size.map(|edge| edge.0 as f32)),
            file::Shape::Lattice { size, places } => {
                Shape::Lattice(size.map(|edge| edge.0 as f32), places.map(Into::into))
            }
        },
        times: transmitter.times.into_iter().map(|time| time.0).collect(),
        release: transmitter.release.iter().map(release).collect::<Result<_, _>>()?,
    })
}

pub(super) fn receivers(
    many: Vec<file::Receiver>,
    names: &Names<'_>,
    boundary: &Boundary,
    advice: &mut Vec<Problem>,
) -> Result<Vec<Receiver>, Problem> {
    many.into_iter().map(|one| receiver(one, names, boundary, advice)).collect()
}

fn receiver(
    receiver: file::Receiver,
    names: &Names<'_>,
    boundary: &Boundary,
    advice: &mut Vec<Problem>,
) -> Result<Receiver, Problem> {
    let mut sees = vec![receiver.species.is_none(); names.0.len()];
    for name in receiver.species.iter().flatten() {
        sees[names.get(name)? as usize] = true;
    }
    let center = receiver.center.get_ref().map(|Finite(x)| x as f32);
    let radius = receiver.radius.0 as f32;
    check_place(boundary, receiver.center.span(), (center, radius), advice)?;
    Ok(Receiver {
        name: receiver.name.0,
        center,
        radius,
        kind: match receiver.kind {
            file::ReceiverKind::Absorbing => Kind::Absorbing,
            file::ReceiverKind::Endpoint => Kind::Endpoint,
            file::ReceiverKind::Transparent => Kind::Transparent,
        },
        sees,
    })
}

/// Refuses a sphere behind walls, and advises about one outside a periodic box.
fn check_place(
    boundary: &Boundary,
    span: std::ops::Range<usize>,
    (center, radius): ([f32; 3], f32),
    advice: &mut Vec<Problem>,
) -> Result<(), Problem> {
    if advice::is_walled_off(boundary, center, radius) {
        let walls = advice::walls(boundary);
        return Err(Problem::at(span, format!("{center:?} is outside {walls}; move it inside")));
    }
    advice.extend(advice::image(boundary, center).map(|message| Problem::at(span, message)));
    Ok(())
}
