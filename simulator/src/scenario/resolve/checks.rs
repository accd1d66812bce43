use std::ops::Range;

use lazygrid_scenario::File;
use toml::Spanned;

use crate::model::Model;
use crate::scenario::{Problem, warnings};

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
    let overlap = warnings::overlapping_absorbers(model);
    warnings.extend(overlap.map(|(k, message)| Problem::at(at(k), message)));
    let rounded = warnings::rounded_receiver_steps(model);
    warnings.extend(rounded.map(|(k, message)| Problem::at(at(k), message)));
    Ok(())
}
