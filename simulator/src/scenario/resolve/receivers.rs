use std::collections::HashSet;

use lazygrid_scenario::{self as file, Finite};

use super::Names;
use super::checks::{span_of, warn};
use super::schedule::{single_radius, to_f32};
use super::transmitters::check_position;
use crate::memory::check_available;
use crate::model::Model;
use crate::model::receiver::{Adsorption, Receiver, ReceiverKind, WallFace};
use crate::model::receptors::{Ligand, ReceptorType};
use crate::model::transmitter::Shape;
use crate::scenario::{Problem, warnings};

pub(super) fn receivers(
    many: &[file::Receiver],
    names: &Names<'_>,
    model: &Model,
    warnings: &mut Vec<Problem>,
) -> Result<Vec<Receiver>, Problem> {
    check_memory(many, names.species.len())?;
    let (mut all, mut known) = (Vec::new(), HashSet::new());
    for one in many {
        for receiver in at_sites(one, names, model, warnings)? {
            if !known.insert(receiver.name.clone()) {
                let message = format!("there are two receivers '{}'; rename one", receiver.name);
                return Err(Problem::at(one.name.span(), message));
            }
            all.push(receiver);
        }
    }
    Ok(all)
}

fn at_sites(
    one: &file::Receiver,
    names: &Names<'_>,
    model: &Model,
    warnings: &mut Vec<Problem>,
) -> Result<Vec<Receiver>, Problem> {
    let receiver = receiver(one, names, model, warnings)?;
    let Some(center) = span_of(&one.center) else { return Ok(vec![receiver]) };
    let Some(lattice) = one.lattice else {
        check_position(&model.boundary, center.clone(), receiver.center, receiver.radius, warnings)?;
        return match model.overlaps_wall(&receiver) {
            None => Ok(vec![receiver]),
            Some(message) => Err(Problem::at(center, message)),
        };
    };
    let sites = lattice.places.map(u32::from);
    let shape = Shape::Lattice(lattice.size.map(|side| side.0 as f32), sites);
    let Some(count) = sites.into_iter().try_fold(1, u32::checked_mul) else {
        let message = format!("{sites:?} places are more than 2³² − 1; make them fewer");
        return Err(Problem::at(center, message));
    };
    let (mut all, warning_count) = (Vec::new(), warnings.len());
    for k in 0..count {
        let offset = shape.offset([0; 4], k, &model.boundary);
        let at = std::array::from_fn(|axis| receiver.center[axis] + offset[axis]);
        check_position(&model.boundary, center.clone(), at, receiver.radius, warnings)?;
        all.push(Receiver { name: format!("{}-{k}", receiver.name), center: at, ..receiver.clone() });
    }
    warnings.truncate(warning_count + 1);
    Ok(all)
}

/// Bytes of a receiver in a run, and bytes of its column for one species.
const RECEIVER_AND_COLUMN_BYTES: [u64; 2] = [1000, 100];

fn check_memory(many: &[file::Receiver], species: usize) -> Result<(), Problem> {
    let site_count = |one: &file::Receiver| -> u64 {
        let sites = one.lattice.map_or([1; 3], |lattice| lattice.places.map(|count| u32::from(count).into()));
        sites.into_iter().fold(1, u64::saturating_mul)
    };
    let count = many.iter().map(site_count).fold(0, u64::saturating_add);
    let needed =
        count.saturating_mul(RECEIVER_AND_COLUMN_BYTES[0] + RECEIVER_AND_COLUMN_BYTES[1] * species as u64);
    let fits = check_available(&format!("{count} receivers"), needed, "declare fewer, or raise the limit");
    let span = many.first().map(|one| one.kind.span()).unwrap_or_default();
    fits.map_err(|error| Problem { key: Some("receiver".to_owned()), ..Problem::at(span, error.to_string()) })
}

/// Returns the body of a transmitter that reflects or moves; one that only moves is a point that particles pass.
pub(super) fn body(transmitter: &file::Transmitter, species: usize) -> Result<Option<Receiver>, Problem> {
    let radius = &transmitter.body_radius;
    let body = Receiver {
        name: transmitter.name.get_ref().0.clone(),
        center: transmitter.center.as_ref().map_or([0.0; 3], |center| to_f32(*center.get_ref())),
        radius: radius.as_ref().map_or(Ok(0.0), |r| single_radius(r.get_ref().0, r.span()))?,
        kind: ReceiverKind::Reflecting,
        sees: vec![radius.is_some(); species],
        velocity: transmitter.velocity.map(|Finite(v)| v),
        diffusion: transmitter.diffusion.0,
        ..Receiver::default()
    };
    Ok((body.radius > 0.0 || body.moves()).then_some(body))
}

fn receiver(
    one: &file::Receiver,
    names: &Names<'_>,
    model: &Model,
    warnings: &mut Vec<Problem>,
) -> Result<Receiver, Problem> {
    let sees = names.seen(one.species.as_ref())?;
    let kind = kind(one, names, &sees)?;
    let (center, radius) = extent(one)?;
    let receiver = Receiver {
        name: one.name.get_ref().0.clone(),
        center,
        radius,
        kind,
        sees,
        velocity: one.velocity.map(|Finite(v)| v),
        diffusion: one.diffusion.0,
        surface_diffusion: one.surface_diffusion.as_ref().map_or(0.0, |d| d.get_ref().0),
    };
    if let (&ReceiverKind::Wall(face), Some(span)) = (&receiver.kind, span_of(&one.face))
        && let Some(message) = model.missing_wall(&receiver.name, face)
    {
        return Err(Problem::at(span, message));
    }
    if let Some(message) = model.resting_before(&receiver) {
        return Err(Problem::at(one.kind.span(), message));
    }
    warn(warnings, one.kind.span(), warnings::long_step_before(&receiver, model));
    if let Some(span) = span_of(&one.unbinding_rate).or_else(|| span_of(&one.receptors)) {
        let messages =
            [warnings::fast_unbinding(&receiver, model), warnings::rounded_unbinding(model, &receiver)];
        warn(warnings, span, messages.into_iter().flatten());
    }
    Ok(receiver)
}

fn extent(one: &file::Receiver) -> Result<([f32; 3], f32), Problem> {
    let is_wall = *one.kind.get_ref() == file::ReceiverKind::Wall;
    let center = one.center.as_ref();
    let moves = one.velocity.iter().any(|v| v.0 != 0.0) || one.diffusion.0 > 0.0 || one.lattice.is_some();
    match (center, &one.radius) {
        (Some(center), Some(radius)) if !is_wall => {
            let single = single_radius(radius.get_ref().0, radius.span())?;
            Ok((to_f32(*center.get_ref()), single))
        }
        (None, None) if is_wall && !moves => Ok(([0.0; 3], 0.0)),
        _ if is_wall => {
            let message =
                "a wall has a face, and neither center, radius, lattice nor motion; remove them".to_owned();
            Err(Problem::at(one.kind.span(), message))
        }
        _ => Err(Problem::at(one.kind.span(), "a receiver needs a center and a radius".to_owned())),
    }
}

fn kind(one: &file::Receiver, names: &Names<'_>, sees: &[bool]) -> Result<ReceiverKind, Problem> {
    let kind = *one.kind.get_ref();
    let misplaced = [
        (span_of(&one.probability), "probability", file::ReceiverKind::Partial),
        (span_of(&one.rate), "rate", file::ReceiverKind::Partial),
        (span_of(&one.count), "count", file::ReceiverKind::Receptors),
        (span_of(&one.binding_rate), "binding-rate", file::ReceiverKind::Receptors),
        (span_of(&one.unbinding_rate), "unbinding-rate", file::ReceiverKind::Receptors),
        (span_of(&one.receptors), "receptors", file::ReceiverKind::Receptors),
        (span_of(&one.surface_diffusion), "surface-diffusion", file::ReceiverKind::Receptors),
        (span_of(&one.face), "face", file::ReceiverKind::Wall),
    ];
    for (span, key, kind_of_key) in misplaced {
        if let Some(span) = span.filter(|_| kind != kind_of_key) {
            let kind_of_key = match kind_of_key {
                file::ReceiverKind::Partial => "partial",
                file::ReceiverKind::Wall => "wall",
                _ => "receptors",
            };
            return Err(Problem::at(
                span,
                format!("{key} goes with kind = \"{kind_of_key}\"; remove the key, or change the kind"),
            ));
        }
    }
    let lacking = |message: &str| Err(Problem::at(one.kind.span(), message.to_owned()));
    Ok(match kind {
        file::ReceiverKind::Absorbing => ReceiverKind::Absorbing,
        file::ReceiverKind::Endpoint => ReceiverKind::Endpoint,
        file::ReceiverKind::Transparent => ReceiverKind::Transparent,
        file::ReceiverKind::Reflecting => ReceiverKind::Reflecting,
        file::ReceiverKind::Partial => ReceiverKind::Partial(match (&one.probability, &one.rate) {
            (Some(probability), None) => Adsorption::PerStep(probability.get_ref().0),
            (None, Some(rate)) => Adsorption::Reactivity(rate.get_ref().0),
            _ => {
                return lacking(
                    "a partial receiver has either a rate, in µm/s, or a probability for each step",
                );
            }
        }),
        file::ReceiverKind::Wall => {
            let Some(face) = &one.face else {
                return lacking("a wall needs a face: low-x to high-z, or side of a cylinder or sphere");
            };
            ReceiverKind::Wall(match face.get_ref() {
                file::Face::LowX => WallFace::Low(0),
                file::Face::LowY => WallFace::Low(1),
                file::Face::LowZ => WallFace::Low(2),
                file::Face::HighX => WallFace::High(0),
                file::Face::HighY => WallFace::High(1),
                file::Face::HighZ => WallFace::High(2),
                file::Face::Side => WallFace::Side,
            })
        }
        file::ReceiverKind::Receptors => ReceiverKind::Receptors(receptor_types(one, names, sees)?),
    })
}

fn receptor_types(
    one: &file::Receiver,
    names: &Names<'_>,
    sees: &[bool],
) -> Result<Vec<ReceptorType>, Problem> {
    let short = (&one.count, &one.binding_rate, &one.unbinding_rate);
    match (short, &one.receptors) {
        ((Some(count), Some(binding), Some(unbinding)), None) => {
            let [binding, unbinding] = [binding, unbinding].map(|rate| rate.get_ref().0);
            let species = (0..).zip(sees).filter(|&(_, &sees)| sees).map(|(species, _)| species);
            Ok(vec![ReceptorType::new((*count.get_ref()).into(), binding, unbinding, species)])
        }
        ((None, None, None), Some(types)) if !types.get_ref().is_empty() => {
            types.get_ref().iter().map(|kind| receptor_type(kind, names, sees)).collect()
        }
        _ => Err(Problem::at(
            one.kind.span(),
            "receptors have a count, a binding-rate in µm³/s and an unbinding-rate in 1/s, or types in a list \
             `receptors`, each with a count and ligands"
                .to_owned(),
        )),
    }
}

fn receptor_type(
    kind: &file::ReceptorType,
    names: &Names<'_>,
    sees: &[bool],
) -> Result<ReceptorType, Problem> {
    let mut ligands: Vec<Ligand> = Vec::new();
    if kind.ligands.get_ref().is_empty() {
        let message =
            "the list is empty, so that these receptors bind nothing; name a ligand, or remove the type";
        return Err(Problem::at(kind.ligands.span(), message.to_owned()));
    }
    for ligand in kind.ligands.get_ref() {
        let species = names.get(&ligand.species)?;
        let (name, span) = (ligand.species.get_ref(), ligand.species.span());
        if !sees[species as usize] {
            return Err(Problem::at(span, format!("the receiver's species leave out '{name}'; add it")));
        }
        if ligands.iter().any(|other| other.species == species) {
            return Err(Problem::at(
                span,
                format!("'{name}' is a ligand of these receptors twice; remove one"),
            ));
        }
        let [binding_rate, unbinding_rate] = [ligand.binding_rate, ligand.unbinding_rate].map(|rate| rate.0);
        ligands.push(Ligand { species, binding_rate, unbinding_rate });
    }
    Ok(ReceptorType { count: kind.count.into(), ligands })
}
