use super::membrane_rows::{MAX_SPHERES, MembraneRows};
use super::path_bounds::long_path_iterations;
use crate::model::{Decay, Model};
use crate::{Axis, Error};

/// At a mean of 16, the probability of more than `MAX_DECAYS` of `decay.wgsl` is below 10⁻¹⁷.
const MAX_DECAY_RATE: f64 = 16.0;
/// Pairs of a receiver and a species that an arriving particle can name, as in `decay.wgsl`.
const MAX_LOGGED_PAIRS: usize = (1 << 23) - 2;

pub(super) fn chained_decays(model: &Model) -> impl Iterator<Item = (&Decay, &Decay)> {
    let after = |first: &Decay| {
        let product = first.products[0];
        model.decays.iter().filter(move |second| Some(second.reactant) == product)
    };
    model.decays.iter().flat_map(move |first| after(first).map(move |second| (first, second)))
}

fn logged_pairs(model: &Model) -> usize {
    model.receivers.len() * model.species.len()
}

pub(crate) fn can_log_arrivals(model: &Model) -> bool {
    logged_pairs(model) <= MAX_LOGGED_PAIRS
}

/// # Errors
/// [`Error::NotOnGpu`].
pub(crate) fn check(model: &Model) -> Result<(), Error> {
    let rejected = |what: String| Err(Error::NotOnGpu { what });
    for (first, second) in chained_decays(model) {
        let expected = second.rate * model.time_step;
        if expected > MAX_DECAY_RATE {
            return rejected(format!(
                "'{}' after '{}' at {expected:.1} expected decays per step; set time-step to {:.2e} or less",
                second.name,
                first.name,
                MAX_DECAY_RATE / second.rate
            ));
        }
    }
    if model.logs_arrivals && !can_log_arrivals(model) {
        return rejected(format!(
            "a log of arrivals for {} pairs of a receiver and a species, beyond {MAX_LOGGED_PAIRS}; set arrivals to false, \
             or use fewer receivers",
            logged_pairs(model)
        ));
    }
    check_receivers(model)
}

/// Receivers and species of a thread and step: software drivers end loops after 65,535 iterations.
const MAX_SEEN: usize = 60_000;
/// Surfaces make a thread visit receivers twice.
const MAX_SEEN_REFLECTING: usize = 25_000;

fn check_receivers(model: &Model) -> Result<(), Error> {
    let ligands = model.receptor_types().map(|kind| kind.ligands.len()).sum::<usize>();
    let seen = model.receivers.iter().flat_map(|r| &r.sees).filter(|sees| **sees).count() + ligands;
    let reflects = model.receivers.iter().any(|receiver| receiver.kind.reflects());
    let max_seen = if reflects { MAX_SEEN_REFLECTING } else { MAX_SEEN };
    let visits = seen.max(model.receivers.len());
    if visits > max_seen {
        let what = format!(
            "{visits} counts of a receiver and a species, beyond {max_seen}; use fewer receivers, or let them see fewer species"
        );
        return Err(Error::NotOnGpu { what });
    }
    let paths = long_path_iterations(model);
    if visits + paths > max_seen {
        let what = format!(
            "paths that drift past receivers within a step, with {paths} loop iterations, beyond {}; use fewer receivers, or, \
             if particles diffuse, shorten the time step until drift, flow and velocity move none by a sixteenth of a receiver's \
             radius",
            max_seen - visits
        );
        return Err(Error::NotOnGpu { what });
    }
    check_membranes(model, visits, max_seen - paths)
}

/// Loop iterations per membrane in a step of 64 passages: per spherical one in periodic space and otherwise, and per
/// plane.
const MEMBRANE_ITERATIONS: [usize; 3] = [660, 210, 8];

/// Axes along which a step has substeps, each with two loops over planes.
const AXES: usize = 3;

/// Each visit of a receiver loops over planes and spheres.
fn check_membranes(model: &Model, visits: usize, limit: usize) -> Result<(), Error> {
    let repeats = model.boundary.axes.iter().any(|axis| matches!(axis, Axis::Periodic { .. }));
    for (id, species) in model.species.iter().enumerate() {
        let rows = MembraneRows::new(model, id);
        let (planes, spheres) = rows.counts();
        let substeps = AXES * rows.max_substeps() * (2 * planes + 1);
        let iterations = membrane_iterations((planes, spheres), visits, repeats) + substeps;
        if iterations > limit || spheres > MAX_SPHERES {
            let what = format!(
                "{spheres} spherical and {planes} plane membranes with images that hold back {}, beyond {MAX_SPHERES} spheres or, \
                 with {visits} visits of receivers, {limit} loop iterations ({iterations} needed); use fewer membranes or receivers",
                species.name
            );
            return Err(Error::NotOnGpu { what });
        }
    }
    Ok(())
}

fn membrane_iterations((planes, spheres): (usize, usize), visits: usize, repeats: bool) -> usize {
    if planes + spheres == 0 {
        return 0;
    }
    let [periodic, open, plane] = MEMBRANE_ITERATIONS;
    let sphere = if repeats { periodic } else { open };
    visits * (planes + spheres + 3) + plane * planes + sphere * spheres
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn membranes_multiply_the_visits_of_receivers() {
        assert_eq!(membrane_iterations((0, 0), MAX_SEEN, true), 0);
        assert!(membrane_iterations((1, 0), 10_000, false) < MAX_SEEN);
        assert!(membrane_iterations((1, 0), 20_000, false) > MAX_SEEN);
        assert!(membrane_iterations((0, 90), 0, true) < MAX_SEEN);
        assert!(membrane_iterations((0, 91), 0, true) > MAX_SEEN);
    }
}
