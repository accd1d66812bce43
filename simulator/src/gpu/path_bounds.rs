use crate::Axis;
use crate::model::Model;
use crate::model::receiver::{Receiver, ReceiverKind};
use crate::motion::path_hit::{is_long, length};
use crate::motion::propagate::Propagator;
use crate::motion::species_step::SpeciesStep;
use crate::motion::vessel_flow::{FlowStep, StepDrift, StepTime};

/// Bounds of a species' displacement without diffusion in a step, in µm.
struct PathBounds {
    radius: f32,
    /// Plug flow and drift.
    drift: [f32; 3],
    /// Flow field, along each axis.
    field: [f32; 3],
    /// Poiseuille flow, and own velocity in any direction.
    flow: f32,
    own_displacement: f32,
    diffusion: f32,
}

/// In standard deviations; `normals` returns at most 5.77.
const MAX_THERMAL: f32 = 6.0;

/// Bound of a path's distance from its drift, in √(2DΔt).
const MAX_SPREADS: f32 = 4.0;
/// Iterations in which a path passes a sphere once, at most 295 in 3500 bridges of all ratios of drift, diffusion and
/// radius; all segments of `path_bridge.wgsl` and `path_line.wgsl`.
const PASSAGE_ITERATIONS: usize = 400;
const MAX_SEGMENTS: usize = 8191;
const MAX_LINE_SEGMENTS: usize = 3000;
/// Reflections of a line in a vessel, followed twice, with a segment between any two.
const VESSEL_ITERATIONS: usize = 200;

impl PathBounds {
    /// Returns one bound, or two with a pulse, which bound all its fractions.
    fn all(model: &Model, steps: &[SpeciesStep], species: usize) -> Vec<Self> {
        let flow_fractions = if model.flow_pulse.is_some() { &[1.0, 0.0][..] } else { &[1.0] };
        let drifts = flow_fractions
            .iter()
            .map(|&flow_fraction| StepDrift::new(model, species, StepTime::new(model, flow_fraction)));
        drifts.map(|drift| Self::new(model, species, steps[species].diffusion, drift.drift)).collect()
    }

    fn new(model: &Model, species: usize, diffusion: f32, drift: [f32; 3]) -> Self {
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
        Self {
            radius: kind.radius,
            drift,
            field,
            flow,
            own_displacement: speed * model.time_step as f32,
            diffusion,
        }
    }

    fn length(&self) -> f32 {
        length(self.drift) + self.undirected_length()
    }

    fn undirected_length(&self) -> f32 {
        length(self.field) + self.flow.abs() + self.own_displacement
    }

    /// Bounds the loop iterations of a path's hit; 0 if the path's ends are enough.
    fn iterations_at(&self, receiver: &Receiver, model: &Model) -> usize {
        let receiver_displacement = receiver.velocity.map(|v| (v * model.time_step) as f32);
        let diffusion = self.diffusion + (receiver.diffusion * model.time_step) as f32;
        let spread = (2.0 * diffusion).sqrt();
        let relative: [f32; 3] = std::array::from_fn(|k| self.drift[k] - receiver_displacement[k]);
        let images: usize = (0..3).map(|k| self.images(k, receiver, spread, model)).sum();
        let vessel = model.boundary.vessel;
        let across = |k: usize| vessel.is_some_and(|vessel| vessel.along != Some(k));
        let has_corners = (0..3).any(|k| across(k) && (self.drift[k] != 0.0 || self.along(k, model) > 0.0));
        if diffusion > 0.0 {
            let moved = length(relative) + self.undirected_length();
            if !is_long(moved, spread, receiver.radius) {
                return 0;
            }
            let narrow = vessel.filter(|_| has_corners).map_or(f32::INFINITY, |vessel| vessel.radius);
            let passages = 1 + images + (moved / narrow).min(MAX_LINE_SEGMENTS as f32) as usize;
            let corners = if has_corners { VESSEL_ITERATIONS } else { 0 };
            return corners + (PASSAGE_ITERATIONS * passages).min(MAX_SEGMENTS);
        }
        if has_corners {
            return VESSEL_ITERATIONS + images.min(MAX_LINE_SEGMENTS);
        }
        if images == 0 { 0 } else { 1 + images.min(MAX_LINE_SEGMENTS) }
    }

    /// Bounds walls and images at which the path may reach the receiver again.
    fn images(&self, axis: usize, receiver: &Receiver, spread: f32, model: &Model) -> usize {
        let receiver_displacement = (receiver.velocity[axis] * model.time_step) as f32;
        let along = self.along(axis, model) + MAX_SPREADS * spread;
        let relative = (self.drift[axis] - receiver_displacement).abs() + along;
        let moved = self.drift[axis].abs() + along;
        let (center, extent) = (receiver.center[axis], receiver.radius + moved);
        let stays = receiver_displacement == 0.0 && receiver.diffusion == 0.0;
        let passed = |moved: f32, width: f32| 1 + (moved / width).min(MAX_LINE_SEGMENTS as f32) as usize;
        match model.boundary.axes[axis].inset(self.radius) {
            Axis::Open | Axis::Frozen => 0,
            Axis::Reflecting { .. } if moved == 0.0 => 0,
            Axis::Reflecting { low, high } if stays && center - extent >= low && center + extent <= high => 0,
            Axis::Reflecting { low, high } => passed(moved, high - low),
            Axis::Periodic { .. } if relative == 0.0 => 0,
            Axis::Periodic { low, high } if 2.0 * (receiver.radius + relative) <= high - low => 0,
            Axis::Periodic { low, high } => passed(relative, high - low),
        }
    }

    fn along(&self, axis: usize, model: &Model) -> f32 {
        let is_vessel = model.boundary.vessel.is_some_and(|vessel| vessel.along == Some(axis));
        self.field[axis] + self.own_displacement + if is_vessel { self.flow.abs() } else { 0.0 }
    }
}

/// Bounds the loop iterations of a path; 0 if none drifts past a receiver within a step, and no line reaches one after
/// a wall or at another image.
pub(super) fn long_path_iterations(model: &Model) -> usize {
    let steps = Propagator::new(model).steps;
    // Others count ends of steps only, or nothing.
    let follows_path = |receiver: &&Receiver| match receiver.kind {
        ReceiverKind::Absorbing | ReceiverKind::Receptors(_) => true,
        _ => receiver.kind.reflects() && receiver.kind.absorbs(),
    };
    let of_species = |species: usize| -> usize {
        let bounds = PathBounds::all(model, &steps, species);
        let max_iterations =
            |receiver: &Receiver| bounds.iter().map(|one| one.iterations_at(receiver, model)).max();
        let seen = || model.receivers.iter().filter(follows_path).filter(|receiver| receiver.sees[species]);
        match seen().filter_map(max_iterations).sum() {
            0 => 0,
            // Lines to the other receivers have one segment.
            iterations => iterations + seen().count(),
        }
    };
    (0..steps.len()).map(of_species).max().unwrap_or(0)
}

/// Bounds the displacement of all but one in ten million particles.
pub(super) fn search_distance(model: &Model, steps: &[SpeciesStep], species: usize) -> f32 {
    let step = &steps[species];
    let longest = PathBounds::all(model, steps, species).iter().map(PathBounds::length).fold(0.0, f32::max);
    1.01 * (6.0 * step.length + longest) + step.bend
}
