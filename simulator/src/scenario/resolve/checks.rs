use std::ops::Range;

use lazygrid_scenario::File;
use toml::Spanned;

use crate::model::Model;
use crate::scenario::{Problem, warnings};

pub(super) fn span_of<T>(value: &Option<Spanned<T>>) -> Option<Range<usize>> {
    value.as_ref().map(Spanned::span)
}

/// Refuses the first of the keys that is given.
pub(super) fn refuse_keys<const N: usize>(
    keys: [(&str, Option<Range<usize>>); N],
    message: impl Fn(&str) -> String,
) -> Result<(), Problem> {
    match keys.into_iter().find_map(|(key, span)| Some((key, span?))) {
        Some((key, span)) => Err(Problem::at(span, message(key))),
        None => Ok(()),
    }
}

pub(super) fn warn(
    warnings: &mut Vec<Problem>,
    span: Range<usize>,
    messages: impl IntoIterator<Item = String>,
) {
    warnings.extend(messages.into_iter().map(|message| Problem::at(span.clone(), message)));
}

/// Returns the spans of all receivers, in `receiver` tables and transmitters with a body.
pub(super) fn receiver_spans(file: &File, has_body: impl Iterator<Item = bool>) -> Vec<Range<usize>> {
    let site_count = |one: &lazygrid_scenario::Receiver| {
        let sites = one.lattice.map_or([1; 3], |lattice| lattice.places.map(u32::from));
        sites.into_iter().map(|count| count as usize).product()
    };
    let receivers = file.receivers.iter();
    let mut spans: Vec<_> =
        receivers.flat_map(|one| std::iter::repeat_n(one.name.span(), site_count(one))).collect();
    let bodies = file.transmitters.iter().zip(has_body).filter(|(_, has_body)| *has_body);
    spans.extend(bodies.map(|(transmitter, _)| Spanned::span(&transmitter.name)));
    spans
}

/// Checks receivers together; `spans` are their locations in the file.
pub(super) fn check_receivers(
    model: &Model,
    spans: &[Range<usize>],
    warnings: &mut Vec<Problem>,
) -> Result<(), Problem> {
    let at = |k: usize| spans.get(k).cloned().unwrap_or_default();
    if let Some((k, message)) = model.faulty_absorber() {
        return Err(Problem::at(at(k), message));
    }
    let found = [warnings::overlapping_absorbers(model), warnings::rounded_receiver_steps(model)];
    warnings.extend(found.into_iter().flatten().map(|(k, message)| Problem::at(at(k), message)));
    Ok(())
}
