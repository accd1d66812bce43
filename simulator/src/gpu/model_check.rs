//! Models that the device cannot run, and bounds of the displacement of their particles.

use super::membrane_rows::{MAX_SPHERES, MembraneRows};
use crate::model::receiver::ReceiverKind;
use crate::model::{Decay, Model};
use crate::motion::path_hit;
use crate::motion::propagate::Propagator;
use crate::motion::species_step::SpeciesStep;
use crate::motion::vessel_flow::{FlowStep, StepDrift, StepTime};
use crate::{Axis, Error, Receiver};

/// At a mean of 16, `MAX_DECAYS` of `decay.wgsl` is exceeded with a probability of 10⁻¹⁷.
const MAX_DECAY_RATE: f64 = 16.0;
/// Most pairs of a receiver and a species that an arriving particle can name, as in `decay.wgsl`.
const MAX_LOGGED_PAIRS: usize = (1 << 23) - 2;

pub(super) fn chained_decays(model: &Model) -> impl Iterator<Item = (&Decay, &Decay)> {
    let after = |first: &Decay| {
        let product = first.products[0];
        model.decays.iter().filter(move |second| Some(second.reactant) == product)
    };
    model.decays.iter().flat_map(move |first| after(first).map(move |second| (first, second)))
}

/// Returns the number of pairs of a receiver and a species.
fn logged_pairs(model: &Model) -> usize {
    model.receivers.len() * model.species.len()
}

/// Returns `true` if the device can name all receivers and species of arrivals.
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
    check_receivers(model)?;
    let steps = Propagator::new(model).steps;
    let carriers: Vec<Vec<Carried>> =
        (0..steps.len()).map(|species| Carried::all(model, &steps, species)).collect();
    // Others count ends of steps only, or nothing.
    let by_path = |r: &&Receiver| r.kind == ReceiverKind::Absorbing || r.kind.reflects() && r.kind.absorbs();
    let binds = |r: &&Receiver| matches!(r.kind, ReceiverKind::Receptors(_));
    for receiver in model.receivers.iter().filter(|r| by_path(r) || binds(r)) {
        let seen = (0..steps.len()).filter(|&species| receiver.sees[species]);
        let passed = |&s: &usize| carriers[s].iter().any(|carried| carried.drifts_past(receiver, model));
        if let Some(species) = seen.into_iter().find(passed) {
            return rejected(format!(
                "{}, whose drift may carry it past receiver {} within a step; shorten the time step until the drift of a \
                 step is a sixteenth of the receiver's radius, {} µm",
                model.species[species].name,
                receiver.name,
                receiver.radius / 16.0
            ));
        }
    }
    Ok(())
}

/// Most receivers and species of a thread and step: software drivers end loops after 65,535 iterations.
const MAX_SEEN: usize = 60_000;
/// Surfaces make a thread visit receivers twice.
const MAX_SEEN_REFLECTING: usize = 25_000;

fn check_receivers(model: &Model) -> Result<(), Error> {
    let ligands = model.receptor_types().map(|kind| kind.ligands.len()).sum::<usize>();
    let seen = model.receivers.iter().flat_map(|r| &r.sees).filter(|sees| **sees).count() + ligands;
    let reflects = model.receivers.iter().any(|receiver| receiver.kind.reflects());
    let most = if reflects { MAX_SEEN_REFLECTING } else { MAX_SEEN };
    let visits = seen.max(model.receivers.len());
    if visits > most {
        let what = format!(
            "{visits} counts of a receiver and a species, beyond {most}; use fewer receivers, or let them see fewer species"
        );
        return Err(Error::NotOnGpu { what });
    }
    check_membranes(model, visits, most)
}

/// Most loop iterations per membrane in a step of 64 passages: per spherical one in periodic space and otherwise, and
/// per plane.
const MEMBRANE_ITERATIONS: [usize; 3] = [660, 210, 8];

/// `visits` is the number of receivers that a particle visits. For each, a loop over planes and one over spheres find if
/// a membrane separates them.
fn check_membranes(model: &Model, visits: usize, most: usize) -> Result<(), Error> {
    let repeats = model.boundary.axes.iter().any(|axis| matches!(axis, Axis::Periodic { .. }));
    for (id, species) in model.species.iter().enumerate() {
        let counts = MembraneRows::new(model, id).counts();
        let iterations = membrane_iterations(counts, visits, repeats);
        let (planes, spheres) = counts;
        if iterations > most || spheres > MAX_SPHERES {
            let what = format!(
                "{spheres} spherical and {planes} plane membranes with images that hold back {}, beyond {MAX_SPHERES} spheres or, \
                 with {visits} visits of receivers, {most} loop iterations ({iterations} needed); use fewer membranes or receivers",
                species.name
            );
            return Err(Error::NotOnGpu { what });
        }
    }
    Ok(())
}

/// Bounds the loop iterations of a particle in a step.
fn membrane_iterations((planes, spheres): (usize, usize), visits: usize, repeats: bool) -> usize {
    if planes + spheres == 0 {
        return 0;
    }
    let [periodic, open, plane] = MEMBRANE_ITERATIONS;
    let sphere = if repeats { periodic } else { open };
    visits * (planes + spheres + 3) + plane * planes + sphere * spheres
}

/// Bounds of a species' displacement in a step apart from diffusion.
pub(super) struct Carried {
    /// Plug flow and drift, in µm.
    drift: [f32; 3],
    /// Largest displacement by a flow field along each axis, in µm.
    field: [f32; 3],
    /// Poiseuille flow, and own velocity in any direction, in µm.
    flow: f32,
    own: f32,
    diffusion: f32,
}

fn length(v: [f32; 3]) -> f32 {
    v.iter().map(|c| c * c).sum::<f32>().sqrt()
}

/// In standard deviations; a component exceeds it once in 10⁹ draws.
const MAX_THERMAL: f32 = 6.0;

impl Carried {
    /// Returns bounds in a steady flow, or with and without a pulse, which bound all fractions of it.
    pub(super) fn all(model: &Model, steps: &[SpeciesStep], species: usize) -> Vec<Self> {
        let parts = if model.flow_pulse.is_some() { &[1.0, 0.0][..] } else { &[1.0] };
        let drifts = parts.iter().map(|&part| StepDrift::new(model, species, StepTime::new(model, part)));
        drifts.map(|drift| Self::new(model, steps[species].diffusion, (species, drift.drift))).collect()
    }

    fn new(model: &Model, diffusion: f32, (species, drift): (usize, [f32; 3])) -> Self {
        let kind = &model.species[species];
        let speed = if kind.speed > 0.0 {
            kind.speed as f32
        } else {
            MAX_THERMAL * 3f32.sqrt() * kind.thermal_speed as f32
        };
        let flow = FlowStep::new(model, StepTime::new(model, 1.0)).map_or(0.0, |flow| flow.fastest as f32);
        // A product keeps the velocity of a reactant with the same speed.
        let hottest = model.species.iter().map(|species| species.thermal_speed).fold(0.0, f64::max);
        let speed = speed.max(MAX_THERMAL * 3f32.sqrt() * hottest as f32);
        let field = model.flow_field().map_or([0.0; 3], |field| field.fastest());
        let field = field.map(|v| (v * model.time_step) as f32);
        Self { drift, field, flow, own: speed * model.time_step as f32, diffusion }
    }

    pub(super) fn length(&self) -> f32 {
        length(self.drift) + self.carried()
    }

    /// Bounds the displacement apart from the drift.
    fn carried(&self) -> f32 {
        length(self.field) + self.flow.abs() + self.own
    }

    /// Returns `true` if drift may carry a diffusing particle past the receiver, or a line may involve a wall or
    /// another image.
    fn drifts_past(&self, receiver: &Receiver, model: &Model) -> bool {
        let (time_step, boundary) = (model.time_step, &model.boundary);
        let own = receiver.velocity.map(|v| (v * time_step) as f32);
        let diffusion = self.diffusion + (receiver.diffusion * time_step) as f32;
        let relative: [f32; 3] = std::array::from_fn(|k| self.drift[k] - own[k]);
        if diffusion > 0.0 {
            let length = length(relative) + self.carried();
            return path_hit::is_long(length, (2.0 * diffusion).sqrt(), receiver.radius);
        }
        let along = |k: usize| {
            let vessel = boundary.vessel.filter(|vessel| vessel.along == Some(k));
            self.field[k] + self.own + if vessel.is_some() { self.flow.abs() } else { 0.0 }
        };
        let across = |k: usize| boundary.vessel.is_some_and(|vessel| vessel.along != Some(k));
        (0..3).filter(|&k| relative[k] != 0.0 || along(k) > 0.0).any(|k| {
            let moved = self.drift[k].abs() + along(k);
            let (center, reach) = (receiver.center[k], receiver.radius + moved);
            match boundary.axes[k] {
                Axis::Open | Axis::Frozen => across(k),
                Axis::Reflecting { .. } if moved == 0.0 => false,
                Axis::Reflecting { .. } if own[k] != 0.0 => true,
                Axis::Reflecting { low, high } => center - reach < low || center + reach > high,
                Axis::Periodic { low, high } => {
                    2.0 * (receiver.radius + relative[k].abs() + along(k)) > high - low
                }
            }
        })
    }
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
