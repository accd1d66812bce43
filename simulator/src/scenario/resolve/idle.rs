//! Keys without effect.

use lazygrid_scenario::{Attractant, Output, Species};
use toml::Spanned;

use crate::Receiver;
use crate::model::{Contact, Model};
use crate::scenario::Problem;

pub(super) fn keys(
    species: &[Species],
    attractants: &[Attractant],
    output: &Output,
    model: &Model,
) -> Vec<Problem> {
    let masses = species.iter().filter(|_| model.contact != Contact::Elastic).filter_map(|one| {
        let message = format!(
            "the mass of {} has no effect, because only elastic particles have one; set contact = \"elastic\", or remove it",
            one.name.get_ref().0
        );
        Some(Problem::at(one.mass.as_ref()?.span(), message))
    });
    let is_followed = |index: usize| {
        let chemotaxes = model.species.iter().filter_map(|species| species.chemotaxis);
        chemotaxes.map(|taxis| taxis.attractant as usize).any(|attractant| attractant == index)
    };
    let idle = attractants.iter().enumerate().filter(|&(index, _)| !is_followed(index));
    let attractants = idle.map(|(_, one)| {
        let name = &one.name.get_ref().0;
        let message = format!(
            "no species follows {name}; give a swimmer chemotaxis = {{ attractant = \"{name}\", sensitivity }}, or remove it"
        );
        Problem::at(one.name.span(), message)
    });
    masses.chain(attractants).chain(output_warnings(output, model)).collect()
}

fn output_warnings(output: &Output, model: &Model) -> Vec<Problem> {
    let mut all = Vec::new();
    if let Some(every) = output.frames_every.as_ref().filter(|_| output.frames.is_empty()) {
        let message = "no frames are written; set frames = [\"xyz\"] or [\"npy\"], or remove this key";
        all.push(Problem::at(every.span(), message.to_owned()));
    }
    let is_logged = |receiver: &Receiver| receiver.kind.absorbs() || receiver.is_momentary();
    if let Some(span) = output.arrivals.as_ref().filter(|_| model.logs_arrivals).map(Spanned::span)
        && !model.receivers.iter().any(is_logged)
    {
        let message =
            "no receiver takes or counts particles, so that none arrives; declare one, or remove this key";
        all.push(Problem::at(span, message.to_owned()));
    }
    all
}
