//! Receivers within a step, and their motion.

use crate::model::Model;
use crate::model::boundary::{Axis, Boundary};
use crate::model::receiver::{Adsorption, Receiver, ReceiverKind, signed_distance};
use crate::motion::adsorption::reactivity;
use crate::motion::path_hit::length;
use crate::random::gaussian::normals;
use crate::random::philox::{Key, Purpose};

#[derive(Clone, Debug)]
pub struct ReceiverState {
    /// Index in the model.
    pub index: u32,
    pub receiver: Receiver,
    /// At the beginning of the step, in µm.
    pub center: [f32; 3],
    /// In the step, not wrapped, in µm.
    pub displacement: [f32; 3],
    /// Part of the displacement, in µm.
    pub drift: [f32; 3],
    /// DΔt, in µm².
    pub diffusion: f32,
    /// Adsorption of a partial receiver.
    pub sticking: Adsorption,
    /// Index of the first receptor type.
    pub(crate) first_type: u32,
    /// Free receptors, by type.
    pub(crate) free: Vec<u32>,
    /// Dimensions: 3 for a sphere, 2 for a disk, 1 for a segment.
    pub dimensions: usize,
}

impl ReceiverState {
    pub fn new(index: u32, receiver: Receiver, time_step: f64) -> Self {
        Self {
            index,
            center: receiver.center,
            displacement: [0.0; 3],
            drift: receiver.velocity.map(|v| (v * time_step) as f32),
            diffusion: (receiver.diffusion * time_step) as f32,
            sticking: match receiver.kind {
                ReceiverKind::Partial(sticking) => sticking,
                _ => Adsorption::Reactivity(0.0),
            },
            first_type: 0,
            free: Vec::new(),
            dimensions: 3,
            receiver,
        }
    }

    /// Returns the center after a `fraction` of the step, in µm, not wrapped.
    #[inline(always)]
    pub fn center_at(&self, fraction: f32) -> [f32; 3] {
        std::array::from_fn(|k| self.center[k] + fraction * self.displacement[k])
    }

    /// Radius of a sphere of equal curvature: the drift of the distance, 2D/r, is D/r on a disk and 0 on a segment.
    pub(crate) fn curved_radius(&self) -> f32 {
        match self.dimensions {
            1 => f32::INFINITY,
            2 => 2.0 * self.receiver.radius,
            _ => self.receiver.radius,
        }
    }

    /// Returns the heights of a path's ends, negative inside, at two fractions of the step. In one dimension, a second
    /// end on the other side of the segment is negative too.
    #[inline(always)]
    pub(crate) fn heights(&self, domain: &Boundary, ends: [[f32; 3]; 2], fractions: [f32; 2]) -> [f32; 2] {
        let radius = self.receiver.radius;
        let height = |k: usize| signed_distance(radius, self.center_at(fractions[k]), domain, ends[k]);
        match self.dimensions == 1 && self.is_passed(domain, ends, fractions) {
            true => [height(0), -height(1) - 2.0 * radius],
            false => [height(0), height(1)],
        }
    }

    /// Returns `true` if the ends are on two sides of the center in one dimension.
    fn is_passed(&self, domain: &Boundary, ends: [[f32; 3]; 2], fractions: [f32; 2]) -> bool {
        let [from, to] = [0, 1].map(|k| domain.displacement(self.center_at(fractions[k]), ends[k])[0]);
        let period = domain.axes[0].period();
        // Half a period away, the sides change, too.
        let is_opposite = period > 0.0 && 2.0 * (from - to).abs() > period;
        from * to < 0.0 && !is_opposite
    }

    pub(crate) fn reactivities(&self, species: u32) -> impl Iterator<Item = f64> {
        let radius = self.receiver.radius.into();
        let types = self.receiver.receptor_types().iter().zip(&self.free);
        types.map(move |(kind, &free)| {
            kind.ligand(species).map_or(0.0, |ligand| reactivity(ligand.binding_rate, free, radius))
        })
    }
}

#[derive(Clone, Debug)]
pub(crate) struct ActiveReceivers {
    pub(crate) all: Vec<ReceiverState>,
    /// Indices of receivers that move or have receptors.
    changing: Vec<usize>,
    moving: bool,
    reflecting: bool,
    /// Largest DΔt.
    pub(crate) diffusion: f32,
    /// Largest displacement in the step, in µm.
    pub(crate) max_displacement: f32,
    /// Largest radius.
    pub(crate) largest: f32,
}

impl ActiveReceivers {
    pub(crate) fn new(model: &Model) -> Self {
        let first_types = model.first_receptor_types();
        let sees = |r: &Receiver| r.sees.contains(&true);
        let acts = model.receivers.iter().enumerate().filter(|(_, r)| r.kind.is_active_sphere() && sees(r));
        let all: Vec<ReceiverState> = acts
            .map(|(at, receiver)| ReceiverState {
                dimensions: model.boundary.dimensions(),
                first_type: first_types[at],
                ..ReceiverState::new(at as u32, receiver.clone(), model.time_step)
            })
            .collect();
        let changes = |state: &ReceiverState| {
            state.receiver.moves() || matches!(state.receiver.kind, ReceiverKind::Receptors(_))
        };
        Self {
            changing: (0..all.len()).filter(|&k| changes(&all[k])).collect(),
            moving: all.iter().any(|state| state.receiver.moves()),
            reflecting: all.iter().any(|state| state.receiver.kind.reflects()),
            diffusion: all.iter().map(|state| state.diffusion).fold(0.0, f32::max),
            largest: all.iter().map(|state| state.receiver.radius).fold(0.0, f32::max),
            max_displacement: 0.0,
            all,
        }
    }

    pub(crate) fn move_about(&self) -> bool {
        self.moving
    }

    pub(crate) fn any_reflect(&self) -> bool {
        self.reflecting
    }

    pub(crate) fn set(&mut self, centers: &[[f32; 3]], receiver_moves: &[ReceiverMove], free: &[u32]) {
        self.max_displacement = 0.0;
        for &k in &self.changing {
            let state = &mut self.all[k];
            let at = state.index as usize;
            state.center = centers[at];
            state.displacement = receiver_moves[at].displacement;
            self.max_displacement = self.max_displacement.max(length(state.displacement));
            let first = state.first_type as usize;
            state.free.clear();
            state.free.extend_from_slice(&free[first..first + state.receiver.receptor_types().len()]);
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ReceiverMove {
    /// In µm.
    pub(crate) center: [f32; 3],
    /// Not wrapped.
    pub(crate) displacement: [f32; 3],
}

impl ReceiverMove {
    pub(crate) fn at_rest(centers: &[[f32; 3]]) -> Vec<Self> {
        centers.iter().map(|&center| Self { center, displacement: [0.0; 3] }).collect()
    }
}

/// Walls and membranes reflect surfaces; receivers pass through each other.
pub(crate) fn move_receivers(model: &Model, centers: &[[f32; 3]], key: Key, step: u32) -> Vec<ReceiverMove> {
    let one = |(at, (receiver, &center)): (usize, (&Receiver, &[f32; 3]))| {
        if !receiver.moves() {
            return ReceiverMove { center, displacement: [0.0; 3] };
        }
        let spread = (2.0 * receiver.diffusion * model.time_step).sqrt() as f32;
        let z = normals(key.draw(at as u32, 0, step, Purpose::ReceiverMotion));
        let end: [f32; 3] = std::array::from_fn(|k| {
            center[k] + (spread * z[k] + (receiver.velocity[k] * model.time_step) as f32)
        });
        let domain = model.domain_of(receiver);
        let end = model.held_receiver(receiver, &domain, [center, end]);
        let after = domain.confine(end);
        let displacement = std::array::from_fn(|k| match domain.axes[k] {
            Axis::Periodic { .. } => end[k] - center[k],
            _ => after[k] - center[k],
        });
        ReceiverMove { center: after, displacement }
    };
    model.receivers.iter().zip(centers).enumerate().map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn path_opposite_to_a_segment_in_a_periodic_box_does_not_pass_it() {
        let receiver = Receiver { center: [2.0, 0.0, 0.0], radius: 0.5, ..Receiver::default() };
        let segment = ReceiverState { dimensions: 1, ..ReceiverState::new(0, receiver, 1.0) };
        let domain = |axis| Boundary { axes: [axis, Axis::Frozen, Axis::Frozen], vessel: None };
        let heights = |axis, [from, to]: [f32; 2]| {
            segment.heights(&domain(axis), [from, to].map(|x| [x, 0.0, 0.0]), [0.0, 1.0])
        };
        let periodic = Axis::Periodic { low: 0.0, high: 10.0 };
        assert_eq!(heights(periodic, [6.75, 7.25]), [4.25, 4.25]);
        assert_eq!(heights(periodic, [1.25, 2.75]), [0.25, -1.25]);
        assert_eq!(heights(Axis::Open, [-6.0, 8.0]), [7.5, -6.5]);
    }
}
