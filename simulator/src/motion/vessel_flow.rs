//! Displacement of particles by flows and drift.

use std::sync::Arc;

use crate::model::boundary::{Axis, Boundary};
use crate::model::flow_field::FlowField;
use crate::model::vessel::Vessel;
use crate::model::{Flow, Model};

#[derive(Clone, Copy, Debug)]
pub(crate) struct FlowStep {
    pub(crate) vessel: Vessel,
    /// Displacement per step by Poiseuille flow on the axis.
    pub(crate) fastest: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct StepTime {
    pub(crate) duration: f64,
    /// Fraction of the duration in which the flow is on.
    pub(crate) flow_fraction: f64,
}

impl StepTime {
    pub(crate) fn new(model: &Model, flow_fraction: f64) -> Self {
        Self { duration: model.time_step, flow_fraction }
    }

    fn in_flow(&self) -> f64 {
        self.flow_fraction * self.duration
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct StepDrift {
    /// In µm.
    pub(crate) drift: [f32; 3],
    /// Axes whose walls reflect Brownian motion with drift exactly; other walls mirror the path.
    pub(crate) at_wall: [bool; 3],
}

impl StepDrift {
    pub(crate) fn new(model: &Model, species: usize, time: StepTime) -> Self {
        let kind = &model.species[species];
        let plug = match &model.flow {
            Some(Flow::Plug(velocity)) => velocity.map(|v| time.flow_fraction * v),
            _ => [0.0; 3],
        };
        let drift = std::array::from_fn(|k| ((kind.drift[k] + plug[k]) * time.duration) as f32);
        // Walls mirror lines of colliding particles; another end could overlap one of them.
        let is_exact = kind.diffusion > 0.0 && !kind.has_velocity() && !model.contact.collides();
        // An absorbing wall needs no reflection: survivors never touched it.
        let reflects = |k| {
            matches!(model.boundary.axes[k], Axis::Reflecting { .. })
                && !model.receivers.iter().any(|receiver| receiver.is_across(k) && receiver.sees[species])
        };
        let flows = |k: usize| match model.flow {
            Some(Flow::Field(_)) => true,
            Some(Flow::Poiseuille { mean }) => mean != 0.0 && model.boundary.along() == Some(k),
            _ => false,
        };
        let drifts = |k: usize| drift[k] != 0.0 || time.flow_fraction > 0.0 && flows(k);
        Self { drift, at_wall: std::array::from_fn(|k| is_exact && drifts(k) && reflects(k)) }
    }
}

#[derive(Clone, Debug)]
pub(crate) struct FieldStep {
    field: Arc<FlowField>,
    duration: f64,
}

impl FieldStep {
    pub(crate) fn new(model: &Model, time: StepTime) -> Option<Self> {
        Some(Self { field: model.flow_field()?.clone(), duration: time.in_flow() })
    }

    /// Returns the displacement between `ends`, the second without flow and walls.
    ///
    /// The mean of the velocities at the beginning and at the predicted end (Heun) is right to second order in the time
    /// step, also with diffusion.
    pub(crate) fn carry(&self, domain: &Boundary, [before, end]: [[f32; 3]; 2]) -> [f32; 3] {
        let first = self.field.at(before);
        let predicted = std::array::from_fn(|k| end[k] + (first[k] * self.duration) as f32);
        let last = self.field.at(domain.confine(predicted));
        std::array::from_fn(|k| (0.5 * (first[k] + last[k]) * self.duration) as f32)
    }
}

pub(crate) struct AdvectedPath {
    pub(crate) end: [f32; 3],
    pub(crate) after: [f32; 3],
    /// Displacement along a cylinder.
    pub(crate) by: f32,
}

impl FlowStep {
    pub(crate) fn new(model: &Model, time: StepTime) -> Option<Self> {
        let mean = match model.flow {
            Some(Flow::Poiseuille { mean }) => mean,
            _ => 0.0,
        };
        let fastest = 2.0 * (time.flow_fraction * mean) * time.duration;
        Some(Self { vessel: model.boundary.vessel?, fastest })
    }

    /// Returns the path between `ends`, and reverses `velocity` at walls. The second end is without walls and
    /// Poiseuille flow. `reflect_at_end` reflects the coordinate along a cylinder if the particle drifts.
    pub(crate) fn carry(
        &self,
        domain: &Boundary,
        ends: [[f32; 3]; 2],
        velocity: &mut [f32; 3],
        reflect_at_end: impl FnOnce([f32; 2]) -> f32,
    ) -> AdvectedPath {
        let [before, free_end] = ends;
        let mut end = match &domain.vessel {
            Some(vessel) => vessel.reflect(before, free_end, velocity),
            None => free_end,
        };
        let Some(along) = self.vessel.along else { return AdvectedPath { end, after: end, by: 0.0 } };
        // Right to second order in the time step: the flow does not change the path across the cylinder.
        let profile = |p| 1.0 - (self.vessel.distance(p) / f64::from(self.vessel.radius)).powi(2);
        let by = (self.fastest * 0.5 * (profile(before) + profile(end))) as f32;
        end[along] = reflect_at_end([before[along], end[along] + by]);
        let mut after = end;
        if domain.axes[along].reverses(end[along]) {
            velocity[along] = -velocity[along];
        }
        after[along] = domain.axes[along].confine(end[along]);
        AdvectedPath { end, after, by }
    }
}
