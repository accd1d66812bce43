//! Free paths of a species in a step, up to walls.
//!
//! A coordinate becomes `x + (s·z + d)` with `s` = √(2DΔt), a standard normal `z`, and the displacement `d` by drift,
//! flow and own velocity. Each operation is rounded to `f32`.

use crate::model::Model;
use crate::model::boundary::Boundary;
use crate::model::membrane::narrowest_gaps;
use crate::motion::path_hit::{BEND, Path, length};
use crate::motion::vessel_flow::{FieldStep, FlowStep, StepDrift, StepTime};
use crate::motion::wall::reflected;
use crate::random::philox::{DrawContext, Purpose};

#[derive(Clone, Copy, Debug)]
pub(crate) struct SpeciesStep {
    /// √(2DΔt).
    pub(crate) length: f32,
    /// Zero along absent axes.
    lengths: [f32; 3],
    /// DΔt.
    pub(crate) diffusion: f32,
    /// D in µm²/s.
    pub(crate) coefficient: f64,
    pub(crate) drift: StepDrift,
    /// Boundary of the center.
    pub(crate) domain: Boundary,
    /// Narrowest gap between membranes along each axis, in µm.
    pub(crate) gaps: [f32; 3],
    /// Bound of a path's distance from its chord by both diffusions.
    pub(crate) bend: f32,
}

impl SpeciesStep {
    /// `of_receivers` is the largest DΔt of a receiver.
    pub(crate) fn new(model: &Model, species: usize, time: StepTime, of_receivers: f32) -> Self {
        let kind = &model.species[species];
        let diffusion = (kind.diffusion * time.duration) as f32;
        let length = (2.0 * kind.diffusion * time.duration).sqrt() as f32;
        let domain = model.boundary.inset(kind.radius);
        Self {
            length,
            lengths: model.boundary.flattened([length; 3]),
            diffusion,
            coefficient: kind.diffusion,
            drift: StepDrift::new(model, species, time),
            domain,
            gaps: narrowest_gaps(&model.membranes, &domain, species),
            bend: BEND * (2.0 * (diffusion + of_receivers)).sqrt(),
        }
    }

    /// Bounds the distance of a path from its chord, in µm.
    #[inline(always)]
    pub(crate) fn bend_of(&self, path: &Path) -> f32 {
        let Some(vessel) = self.domain.vessel else { return self.bend };
        let is_reflected = |k: usize| Some(k) != vessel.along && path.free[k] != path.end[k];
        let corners = || length(std::array::from_fn(|k| path.free[k] - path.before[k]));
        if (0..3).any(is_reflected) { self.bend + corners() } else { self.bend }
    }
}

#[derive(Clone, Debug)]
pub(crate) struct FreePaths {
    pub(crate) duration: f32,
    bounded: bool,
    /// Set in a vessel, also without a flow.
    stream: Option<FlowStep>,
    field: Option<FieldStep>,
}

impl FreePaths {
    pub(crate) fn new(model: &Model, time: StepTime) -> Self {
        Self {
            duration: time.duration as f32,
            bounded: !model.boundary.is_unbounded(),
            stream: FlowStep::new(model, time),
            field: FieldStep::new(model, time),
        }
    }

    /// Returns the path and its end without walls. Walls reverse `velocity`.
    #[inline(always)]
    pub(crate) fn path(
        &self,
        kind: &SpeciesStep,
        [before, normal]: [[f32; 3]; 2],
        mut velocity: Option<&mut [f32; 3]>,
        context: DrawContext,
    ) -> (Path, [f32; 3]) {
        let SpeciesStep { length, lengths, diffusion, ref domain, .. } = *kind;
        let StepDrift { mut drift, at_wall } = kind.drift;
        if let Some(velocity) = &velocity {
            drift = std::array::from_fn(|axis| drift[axis] + velocity[axis] * self.duration);
        }
        let free_end = |drift: [f32; 3]| -> [f32; 3] {
            std::array::from_fn(|axis| before[axis] + (lengths[axis] * normal[axis] + drift[axis]))
        };
        if let Some(field) = &self.field {
            let carried = field.carry(domain, [before, free_end(drift)]);
            drift = std::array::from_fn(|axis| drift[axis] + carried[axis]);
        }
        let end = free_end(drift);
        let words = || context.draw(0, Purpose::Wall);
        if let Some(stream) = &self.stream {
            let reflect_at_end = |ends: [f32; 2]| match stream.vessel.along.filter(|&along| at_wall[along]) {
                Some(along) => reflected(domain.axes[along], ends, length, words()[along]).unwrap_or(ends[1]),
                None => ends[1],
            };
            let mut still = [0.0; 3];
            let velocity = velocity.unwrap_or(&mut still);
            let carried = stream.carry(domain, [before, end], velocity, reflect_at_end);
            // A variable index would keep an array in memory instead of registers.
            let carry = |from: [f32; 3]| {
                let along = |axis| {
                    if Some(axis) == stream.vessel.along { from[axis] + carried.by } else { from[axis] }
                };
                std::array::from_fn(along)
            };
            let (drift, free_end) = (carry(drift), carry(end));
            let (end, after) = (carried.end, carried.after);
            return (Path { before, end, after, free: free_end, drift, diffusion }, free_end);
        }
        if !self.bounded {
            return (Path { before, end, after: end, free: end, drift, diffusion }, end);
        }
        if let Some(velocity) = &mut velocity {
            (0..3)
                .filter(|&axis| domain.axes[axis].reverses(end[axis]))
                .for_each(|axis| velocity[axis] = -velocity[axis]);
        }
        let free_end = end;
        let mut end = end;
        if at_wall != [false; 3] {
            let words = words();
            for axis in (0..3).filter(|&axis| at_wall[axis]) {
                let ends = [before[axis], end[axis]];
                end[axis] = reflected(domain.axes[axis], ends, length, words[axis]).unwrap_or(end[axis]);
            }
        }
        (Path { before, end, after: domain.confine(end), free: free_end, drift, diffusion }, free_end)
    }
}
