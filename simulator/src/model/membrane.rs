//! Planes that diffusing particles pass with a permeability.
//!
//! The flux is κ times the difference of the concentrations on both sides. The distance |x| from the plane is a
//! reflected Brownian motion. Each time its local time L has grown by D/(2κ) on average, the particle takes either side
//! with equal probability (A. Lejay, *The snapping out Brownian motion*, The Annals of Applied Probability 26 (2016)
//! 1727), so that it has changed sides with the probability
//!
//! ```text
//! ½(1 − exp(−2κL/D)),   L = max(0, −min over s ≤ t of X(s)),   |x(t)| = X(t) + L
//! ```
//!
//! with the free path X. Between its ends X is a Brownian bridge, whose minimum has a closed form (`bridge.rs`), so
//! that L,
//! |x| and the side are exact for steps of any length that reach one membrane and no wall.

use crate::model::boundary::{Axis, Boundary};
use crate::model::receiver::Receiver;
use crate::model::{Contact, Flow, Model};
use crate::random::bridge::lowest;
use crate::random::philox::{Key, Purpose, open_unit};

/// A plane across an axis that holds back diffusing particles.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Membrane {
    pub name: String,
    /// Axis across which it is: 0, 1 or 2.
    pub axis: usize,
    /// Coordinate, in µm.
    pub position: f32,
    /// Permeability κ, in µm/s.
    pub permeability: f64,
    /// Flags by species: `true` if the membrane holds it back. Others pass freely.
    pub sees: Vec<bool>,
}

/// A step of a diffusing particle among membranes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MembraneStep<'a> {
    pub(crate) membranes: &'a [Membrane],
    /// Boundary of the center.
    pub(crate) domain: &'a Boundary,
    pub(crate) species: usize,
    /// D, in µm²/s.
    pub(crate) diffusion: f64,
    /// √(2DΔt), in µm.
    pub(crate) spread: f32,
}

/// The end of a step along an axis, without walls and images, and with them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct HeldEnd {
    pub(crate) free: f32,
    pub(crate) confined: f32,
}

/// The coordinates of the next membranes, between which a particle stays. A membrane belongs to the side above it.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Slab {
    low: f32,
    high: f32,
}

impl MembraneStep<'_> {
    pub(crate) fn ends(
        &self,
        [before, end]: [[f32; 3]; 2],
        (key, id, step): (Key, u32, u32),
    ) -> [Option<HeldEnd>; 3] {
        let words = |membrane: usize| key.draw(id, membrane as u32, step, Purpose::Membrane);
        std::array::from_fn(|axis| {
            self.planes(axis).next()?;
            Some(self.end(axis, [before[axis], end[axis]], words))
        })
    }

    fn end(&self, axis: usize, [before, end]: [f32; 2], words: impl Fn(usize) -> [u32; 4]) -> HeldEnd {
        let below = self.planes(axis).filter(|&(_, at)| at <= before).max_by(|a, b| a.1.total_cmp(&b.1));
        let above = self.planes(axis).filter(|&(_, at)| at > before).min_by(|a, b| a.1.total_cmp(&b.1));
        let [low, high] = [below, above].map(|next| next.map(|(_, at)| at));
        let slab = Slab { low: low.unwrap_or(f32::NEG_INFINITY), high: high.unwrap_or(f32::INFINITY) };
        let is_low = (before - slab.low) + (end - slab.low) < (slab.high - before) + (slab.high - end);
        let Some((membrane, at)) = (if is_low { below } else { above }) else {
            return self.within(axis, slab, end);
        };
        let sign = if is_low { 1.0 } else { -1.0 };
        let heights = [before, end].map(|x| sign * (x - at));
        let Some(lowest) = lowest(heights, self.spread, || words(membrane)[0]) else {
            return self.within(axis, slab, end);
        };
        let (height, local_time) = (heights[1] - lowest, -lowest);
        let rate = 2.0 * self.membranes[membrane].permeability / self.diffusion;
        let changes = -0.5 * libm::expm1(-rate * f64::from(local_time));
        if f64::from(open_unit(words(membrane)[1])) >= changes {
            return self.within(axis, slab, at + sign * height);
        }
        let others = self.planes(axis).map(|(_, at)| at);
        let other = match is_low {
            true => Slab { low: others.filter(|&x| x < at).fold(f32::NEG_INFINITY, f32::max), high: at },
            false => Slab { low: at, high: others.filter(|&x| x > at).fold(f32::INFINITY, f32::min) },
        };
        self.within(axis, other, at - sign * height)
    }

    /// Returns the species' membranes across an axis, with coordinates of their images.
    fn planes(&self, axis: usize) -> impl Iterator<Item = (usize, f32)> {
        let images: &[f32] = match self.domain.axes[axis] {
            Axis::Periodic { .. } => &[-1.0, 0.0, 1.0],
            _ => &[0.0],
        };
        let period = match self.domain.axes[axis] {
            Axis::Periodic { low, high } => high - low,
            _ => 0.0,
        };
        let own =
            move |(_, membrane): &(usize, &Membrane)| membrane.axis == axis && membrane.sees[self.species];
        let all = self.membranes.iter().enumerate().filter(own);
        all.flat_map(move |(k, membrane)| {
            images.iter().map(move |image| (k, membrane.position + image * period))
        })
    }

    /// Returns the end in a slab, mirrored at membranes.
    fn within(&self, axis: usize, slab: Slab, end: f32) -> HeldEnd {
        let free = slab.mirrored(end);
        let confined = self.domain.axes[axis].confine(free);
        match self.domain.axes[axis] {
            Axis::Periodic { .. } => HeldEnd { free, confined },
            // A wall may have mirrored it past a membrane.
            _ => HeldEnd { free, confined: slab.mirrored(confined) },
        }
    }

    pub(crate) fn separates(&self, [a, b]: [[f32; 3]; 2]) -> bool {
        let way = self.domain.displacement(a, b);
        (0..3).any(|axis| {
            let is_above = |at: f32| [a[axis] >= at, a[axis] + way[axis] >= at];
            self.planes(axis).map(|(_, at)| is_above(at)).any(|[a, b]| a != b)
        })
    }
}

impl Slab {
    fn mirrored(self, x: f32) -> f32 {
        let Self { low, high } = self;
        let x = if x < low { 2.0 * low - x } else { x };
        let x = if x >= high { 2.0 * high - x } else { x };
        x.min(high.next_down()).max(low)
    }
}

impl Model {
    pub(crate) fn faulty_membrane(&self) -> Option<(usize, String)> {
        (0..self.membranes.len()).find_map(|k| Some((k, self.fault_of_membrane(k)?)))
    }

    fn fault_of_membrane(&self, k: usize) -> Option<String> {
        let membrane = &self.membranes[k];
        let Membrane { ref name, axis, position, permeability, ref sees } = *membrane;
        let fault = |what: String| Some(format!("membrane {name} {what}"));
        if sees.len() != self.species.len() || axis > 2 {
            return fault(format!(
                "is across axis {axis} and sees {} species, of {}",
                sees.len(),
                self.species.len()
            ));
        }
        if !(permeability.is_finite() && permeability >= 0.0) {
            return fault(format!("has the permeability {permeability}; it must be finite and not negative"));
        }
        let seen = self.species.iter().zip(sees).filter(|(_, sees)| **sees);
        let radius = seen.map(|(species, _)| species.radius).fold(0.0, f32::max);
        let is_inside = match self.boundary.axes[axis].inset(radius) {
            Axis::Open => position.is_finite(),
            Axis::Reflecting { low, high } | Axis::Periodic { low, high } => {
                low < position && position < high
            }
            Axis::Frozen => false,
        };
        if !is_inside || self.boundary.vessel.is_some_and(|vessel| vessel.along != Some(axis)) {
            return fault(format!(
                "is at {position} µm, where no plane fits; put it between the walls of a box, or across the axis of a cylinder"
            ));
        }
        let shared = |other: &Membrane| (0..sees.len()).find(|&species| sees[species] && other.sees[species]);
        let is_same = |other: &&Membrane| other.axis == axis && other.position == position;
        if let Some(other) = self.membranes[..k].iter().filter(is_same).find(|other| shared(other).is_some())
        {
            return fault(format!("is where {} is for the same species; remove one", other.name));
        }
        if matches!(self.contact, Contact::Separate | Contact::Elastic) {
            return fault(
                "holds back particles that collide; let contact be \"count\" or \"ignore\"".to_owned(),
            );
        }
        let flow = match self.flow {
            Some(Flow::Plug(velocity)) => velocity[axis],
            Some(Flow::Poiseuille { mean }) => mean,
            None => 0.0,
        };
        let drifts = |species: &usize| {
            let one = &self.species[*species];
            sees[*species] && (one.has_velocity() || one.drift[axis] != 0.0 || flow != 0.0)
        };
        if let Some(species) = (0..sees.len()).find(drifts) {
            let species = &self.species[species].name;
            return fault(format!(
                "holds back {species}, which drifts or swims through it; let it drift along the membrane, or exclude it by species"
            ));
        }
        let receiver = self.receivers.iter().find(|receiver| self.meets(receiver, membrane))?;
        fault(format!(
            "meets receiver {}, which moves, reflects or touches it; use a resting absorbing receiver away from it",
            receiver.name
        ))
    }

    fn meets(&self, receiver: &Receiver, membrane: &Membrane) -> bool {
        let shares = membrane.sees.iter().zip(&receiver.sees).any(|(a, b)| *a && *b);
        let axis = membrane.axis;
        let away = self.boundary.axes[axis].displacement(receiver.center[axis] - membrane.position);
        shares
            && receiver.kind.is_active_sphere()
            && (receiver.moves() || receiver.kind.reflects() || away.abs() <= receiver.radius)
    }
}

#[cfg(test)]
mod tests;
