use std::cmp::Ordering;

use super::mover::{Mover, dot, length};
use crate::model::boundary::{Axis, Boundary};
use crate::model::reactive_pairs::ReactivePairs;
use crate::model::receiver::rounding;
use crate::model::{Contact, Model};

#[derive(Debug)]
pub(crate) struct Rules {
    pub(crate) is_elastic: bool,
    pub(crate) boundary: Boundary,
    pub(crate) domains: Vec<Boundary>,
    /// Reciprocal masses by species; diffusion coefficients for separation.
    mobility: Vec<f64>,
    reactive: ReactivePairs,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CollisionEvent {
    /// Fraction of the step; infinite without an event.
    pub(crate) time: f64,
    /// Ids in ascending order, or [`WALL`].
    ids: [u32; 2],
    /// Indices of the movers, or [`WALL`].
    pub(crate) at: [u32; 2],
    /// Number of the wall: 2·axis or 2·axis + 1 of a plane, or [`VESSEL_WALL`].
    wall: u32,
}

pub(crate) const WALL: u32 = u32::MAX;
const VESSEL_WALL: u32 = 6;

impl CollisionEvent {
    pub(crate) const NEVER: Self = Self { time: f64::INFINITY, ids: [WALL; 2], at: [WALL; 2], wall: 0 };

    pub(crate) fn compare(&self, other: &Self) -> Ordering {
        self.time.total_cmp(&other.time).then_with(|| (self.ids, self.wall).cmp(&(other.ids, other.wall)))
    }

    pub(crate) fn earlier(self, other: Self) -> Self {
        if other.compare(&self).is_lt() { other } else { self }
    }

    pub(crate) fn particles(&self) -> &[u32] {
        let count = self.at.iter().filter(|&&at| at != WALL).count();
        &self.at[..count]
    }
}

impl Rules {
    pub(crate) fn new(model: &Model) -> Option<Self> {
        let mobility = match model.contact {
            Contact::Separate => model.species.iter().map(|species| species.diffusion).collect(),
            Contact::Elastic => model.species.iter().map(|species| 1.0 / species.mass).collect(),
            _ => return None,
        };
        Some(Self {
            is_elastic: model.contact == Contact::Elastic,
            boundary: model.boundary,
            domains: model.center_domains(),
            mobility,
            reactive: ReactivePairs::new(model),
        })
    }

    /// Returns `true` if a pair may react or overlaps; its collisions are not detected.
    pub(crate) fn passes(&self, pair: [&Mover; 2]) -> bool {
        self.may_react(pair) || self.overlap(pair)
    }

    pub(crate) fn may_react(&self, [a, b]: [&Mover; 2]) -> bool {
        self.reactive.contain(a.species, b.species)
    }

    pub(crate) fn overlap(&self, [a, b]: [&Mover; 2]) -> bool {
        // The lower id, so that the order of particles has no effect.
        let first = if a.id < b.id { a } else { b };
        let tolerance = rounding(first.position.map(|c| c as f32), a.radius + b.radius);
        -a.gap(b, a.time, &self.boundary) > f64::from(tolerance)
    }

    /// Returns the collision after both clocks; `None` if the particles do not approach.
    pub(crate) fn predict(&self, movers: &[Mover], mut pair: [u32; 2]) -> Option<CollisionEvent> {
        if movers[pair[0] as usize].id > movers[pair[1] as usize].id {
            pair.reverse();
        }
        let [a, b] = pair.map(|at| &movers[at as usize]);
        let now = a.time.max(b.time);
        let d = a.displacement(b, now, &self.boundary);
        let relative: [f64; 3] = std::array::from_fn(|k| b.motion[k] - a.motion[k]);
        let approach = -dot(d, relative);
        if approach <= 0.0 {
            return None;
        }
        // Rounding may leave a small overlap.
        let apart = (dot(d, d) - a.contact_distance(b).powi(2)).max(0.0);
        let root = approach * approach - dot(relative, relative) * apart;
        let time = now + apart / (approach + root.max(0.0).sqrt());
        (root >= 0.0).then_some(CollisionEvent { time, ids: [a.id, b.id], at: pair, wall: 0 })
    }

    pub(crate) fn predict_wall(&self, movers: &[Mover], at: u32) -> Option<CollisionEvent> {
        let mover = &movers[at as usize];
        let domain = &self.domains[mover.species as usize];
        let Mover { position, motion, time, .. } = *mover;
        let plane = |k: usize| match domain.axes[k] {
            Axis::Reflecting { high, .. } if motion[k] > 0.0 => {
                Some(((f64::from(high) - position[k]) / motion[k], 2 * k as u32 + 1))
            }
            Axis::Reflecting { low, .. } if motion[k] < 0.0 => {
                Some(((f64::from(low) - position[k]) / motion[k], 2 * k as u32))
            }
            _ => None,
        };
        let round = domain.vessel.and_then(|vessel| {
            let [p, w] = [vessel.offset(position), vessel.across(motion)];
            let (a, b) = (dot(w, w), dot(p, w));
            let c = (dot(p, p) - f64::from(vessel.radius).powi(2)).min(0.0);
            (a > 0.0).then(|| (((b * b - a * c).sqrt() - b) / a, VESSEL_WALL))
        });
        let (after, wall) = (0..3).filter_map(plane).chain(round).min_by(|a, b| a.0.total_cmp(&b.0))?;
        Some(CollisionEvent { time: time + after.max(0.0), ids: [mover.id, WALL], at: [at, WALL], wall })
    }

    /// Returns the particles and the number of collisions. At a wall only the first particle is meaningful.
    pub(crate) fn outcome(&self, movers: &[Mover], event: &CollisionEvent) -> ([Mover; 2], u64) {
        let second = if event.at[1] == WALL { event.at[0] } else { event.at[1] };
        let mut pair = [event.at[0], second].map(|at| movers[at as usize]);
        pair.iter_mut().for_each(|mover| mover.advance(event.time));
        if event.at[1] == WALL {
            self.reflect(&mut pair[0], event.wall);
            return (pair, 0);
        }
        self.collide(&mut pair);
        (pair, 1)
    }

    fn reflect(&self, mover: &mut Mover, wall: u32) {
        match (wall, &self.domains[mover.species as usize].vessel) {
            (VESSEL_WALL, Some(vessel)) => {
                let out = vessel.offset(mover.position);
                let distance = vessel.length(out).max(f64::MIN_POSITIVE);
                let normal = out.map(|c| c / distance);
                for velocity in [&mut mover.motion, &mut mover.velocity] {
                    let speed = dot(*velocity, normal);
                    (0..3).for_each(|k| velocity[k] -= 2.0 * speed * normal[k]);
                }
            }
            _ => {
                let axis = (wall / 2) as usize;
                mover.motion[axis] = -mover.motion[axis];
                mover.velocity[axis] = -mover.velocity[axis];
            }
        }
    }

    /// The lower id is first. Returns `false` if the particles do not approach.
    pub(crate) fn collide(&self, [a, b]: &mut [Mover; 2]) -> bool {
        let d = a.displacement(b, a.time, &self.boundary);
        let mut mobilities = [a.species, b.species].map(|species| self.mobility[species as usize]);
        if mobilities == [0.0; 2] {
            mobilities = [1.0; 2];
        }
        let exchange = |u: &mut [f64; 3], v: &mut [f64; 3]| {
            // The expression of `predict`, so that both agree on the sign.
            let approach = -dot(d, std::array::from_fn(|k| v[k] - u[k]));
            if approach <= 0.0 {
                return false;
            }
            let impulse = 2.0 * approach / (dot(d, d) * (mobilities[0] + mobilities[1]));
            for k in 0..3 {
                u[k] -= impulse * mobilities[0] * d[k];
                v[k] += impulse * mobilities[1] * d[k];
            }
            true
        };
        let has_collided = exchange(&mut a.motion, &mut b.motion);
        if self.is_elastic {
            exchange(&mut a.velocity, &mut b.velocity);
        }
        for mover in [a, b] {
            mover.speed = length(mover.motion);
            mover.collided |= has_collided;
        }
        has_collided
    }
}
