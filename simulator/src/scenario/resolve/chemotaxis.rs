use lazygrid_scenario::{self as file, Finite};

use super::checks::{span_of, warn};
use crate::model::Model;
use crate::model::chemotaxis::{Attractant, AttractantProfile, Chemotaxis};
use crate::scenario::{Problem, warnings};

fn attractant(one: &file::Attractant) -> Attractant {
    let profile = match one.profile {
        file::AttractantProfile::Linear { level, gradient } => {
            AttractantProfile::Linear { level: level.0, gradient: gradient.map(|Finite(g)| g) }
        }
        file::AttractantProfile::Gaussian { peak, width } => {
            AttractantProfile::Gaussian { peak: peak.0, width: width.0 }
        }
        file::AttractantProfile::Source { peak, radius } => {
            AttractantProfile::Source { peak: peak.0, radius: radius.0 }
        }
    };
    let center = one.center.map(|Finite(x)| x as f32);
    Attractant { name: one.name.get_ref().0.clone(), center, profile }
}

pub(super) fn resolve(
    attractants: &[file::Attractant],
    species: &[file::Species],
    model: &mut Model,
    warnings: &mut Vec<Problem>,
) -> Result<(), Problem> {
    model.attractants = attractants.iter().map(attractant).collect();
    if let Some((k, message)) = model.faulty_attractant() {
        return Err(Problem::at(attractants[k].name.span(), message));
    }
    for (index, one) in species.iter().enumerate() {
        let Some(taxis) = &one.chemotaxis else {
            let span = span_of(&one.tumble_rate).unwrap_or_default();
            warn(warnings, span, warnings::frequent_tumbles(model, index));
            continue;
        };
        let span = taxis.attractant.span();
        let name = taxis.attractant.get_ref();
        let Some(found) = model.attractants.iter().position(|known| known.name == *name) else {
            let known: Vec<_> = model.attractants.iter().map(|known| known.name.as_str()).collect();
            let [name, known] = [name, &known.join(", ")].map(|text| lazygrid_io::excerpt(text.as_bytes()));
            return Err(Problem::at(span, format!("there is no attractant '{name}'; there are {known}")));
        };
        let half_saturation = taxis.half_saturation.map(|k| k.0);
        let sensitivity = taxis.sensitivity.0;
        model.species[index].chemotaxis =
            Some(Chemotaxis { attractant: found as u32, sensitivity, half_saturation });
        if let Some(message) = model.faulty_chemotaxis(index) {
            return Err(Problem::at(span, message));
        }
        warn(warnings, span, warnings::frequent_tumbles(model, index));
    }
    Ok(())
}
