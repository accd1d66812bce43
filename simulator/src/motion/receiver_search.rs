//! The search for particles that may hit a receiver.
//!
//! Every particle has a clear sphere, in which the last search found no receiver, so a path inside it hits none. Other
//! particles go to the detector as spheres that cover several steps. So most particles cost one distance per step.
//!
//! A clear sphere stays valid if another particle takes its index. Results equal a loop over all receivers bit for bit.
//!
//! This loop takes over for some steps if most particles leave their clear spheres in every step.

use lazygrid::{Detector, Neighbors, Sphere};

use crate::Error;
use crate::model::boundary::Boundary;
use crate::model::receiver::{finder, rounding, signed_distance};
use crate::motion::path_hit::{Path, length};
use crate::motion::receiver_state::{ActiveReceivers, ReceiverState};

/// A sphere around the middle of a path's ends, enlarged by `margin` for diffusion and approaching receivers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StepBounds {
    middle: [f32; 3],
    half: f32,
    margin: f32,
}

impl StepBounds {
    #[inline(always)]
    pub(crate) fn new(path: &Path, margin: f32) -> Self {
        let displacement: [f32; 3] = std::array::from_fn(|k| path.end[k] - path.before[k]);
        let middle = std::array::from_fn(|k| path.before[k] + 0.5 * displacement[k]);
        Self { middle, half: 0.5 * length(displacement), margin }
    }

    pub(crate) fn around_beginning(&self) -> f32 {
        2.0 * self.half + self.margin
    }
}

#[derive(Debug)]
pub(crate) struct ReceiverSearch {
    detector: Detector,
    /// Center, and radius plus `traveled` at the search, by particle.
    pub(crate) clear_spheres: Vec<[f32; 4]>,
    /// Sum of largest displacements of receivers since all clear spheres expired.
    pub(crate) traveled: f32,
    steps: u32,
    /// Radius of a search, relative to the bound of a step. Results do not depend on it.
    factor: f32,
    queries: Vec<Sphere>,
    receivers: Vec<Sphere>,
    cost: SearchCost,
}

#[derive(Debug, Default)]
struct SearchCost {
    steps: u32,
    /// In tests of a receiver.
    cost: u64,
    /// Steps left without searches.
    pause: u32,
}

/// Steps over which costs are compared, several because no clear sphere is known at first.
const COMPARED_STEPS: u32 = 16;
/// Steps without searches after a window in which searches cost more.
const STEPS_WITHOUT_SEARCH: u32 = 240;
/// Cost of a search in tests of a receiver, per particle and per found receiver: about 100 ns, and 20 ns plus often a
/// test, which takes 35 ns (two cores of an AMD EPYC).
const SEARCH_COSTS: [usize; 2] = [3, 1];

const NO_CLEAR_SPHERE: [f32; 4] = [0.0, 0.0, 0.0, -1.0];
/// Steps of moving receivers after which clear spheres expire, to bound rounding errors.
const MAX_CLEAR_SPHERE_STEPS: u32 = 64;
/// First, smallest and largest `factor`.
const RADIUS_FACTORS: [f32; 3] = [4.0, 1.5, 64.0];
/// Numbers of found receivers per particle between which `factor` does not change.
const FOUND_PER_QUERY: [usize; 2] = [1, 4];

impl ReceiverSearch {
    pub(crate) fn new(
        active_receivers: &ActiveReceivers,
        boundary: &Boundary,
    ) -> Result<Option<Self>, Error> {
        if active_receivers.all.is_empty() {
            return Ok(None);
        }
        Ok(Some(Self {
            detector: finder(boundary)?,
            clear_spheres: Vec::new(),
            traveled: 0.0,
            steps: 0,
            factor: RADIUS_FACTORS[0],
            queries: Vec::new(),
            receivers: Vec::new(),
            cost: SearchCost::default(),
        }))
    }

    /// Returns `false` if the loop over all receivers is faster.
    pub(crate) fn begin(&mut self, particles: usize, active_receivers: &ActiveReceivers) -> bool {
        if active_receivers.move_about() {
            if self.steps.is_multiple_of(MAX_CLEAR_SPHERE_STEPS) {
                self.clear_spheres.clear();
                self.traveled = 0.0;
            }
            self.steps += 1;
        }
        self.clear_spheres.resize(particles, NO_CLEAR_SPHERE);
        if active_receivers.move_about() || self.receivers.is_empty() {
            let sphere = |state: &ReceiverState| Sphere::new(state.center, state.receiver.radius);
            self.receivers.clear();
            self.receivers.extend(active_receivers.all.iter().map(sphere));
        }
        self.cost.begin()
    }

    pub(crate) fn end(&mut self, active_receivers: &ActiveReceivers) {
        self.traveled += active_receivers.max_displacement;
    }

    #[inline(always)]
    pub(crate) fn is_clear(&self, index: usize, bounds: &StepBounds) -> bool {
        let [x, y, z, radius] = self.clear_spheres[index];
        let distance = length([bounds.middle[0] - x, bounds.middle[1] - y, bounds.middle[2] - z]);
        distance + bounds.half + bounds.margin <= radius - self.traveled
    }

    /// Returns receivers in the order of the model. `particles` are beginnings of paths, and bounds of their lengths.
    pub(crate) fn find<'a>(
        &'a mut self,
        particles: impl Iterator<Item = ([f32; 3], f32)>,
        active_receivers: &ActiveReceivers,
    ) -> Result<NearbyReceivers<'a>, lazygrid::Error> {
        let Self { detector, traveled, factor, queries, receivers, clear_spheres, cost, .. } = self;
        queries.clear();
        queries.extend(particles.map(|(before, search_radius)| {
            let radius = *factor * search_radius + 1e-3 * active_receivers.largest;
            Sphere::new(before, radius + slack(before, radius, active_receivers, *traveled))
        }));
        let near = detector.neighbors((&*queries, &*receivers))?;
        let found: usize = (0..near.len()).map(|k| near.neighbors_of(k).len()).sum();
        cost.add([queries.len(), found], clear_spheres.len() * receivers.len());
        let [_, min_factor, max_factor] = RADIUS_FACTORS;
        // A search of few particles does not predict the next one.
        if found > FOUND_PER_QUERY[1] * queries.len().max(16) {
            *factor = (*factor / 1.5).max(min_factor);
        } else if found < FOUND_PER_QUERY[0] * queries.len() {
            *factor = (*factor * 1.5).min(max_factor);
        }
        Ok(NearbyReceivers { near, queries, traveled: *traveled })
    }
}

impl SearchCost {
    fn begin(&mut self) -> bool {
        if self.pause > 0 {
            self.pause -= 1;
            return false;
        }
        if self.steps == COMPARED_STEPS {
            *self = Self::default();
        }
        self.steps += 1;
        true
    }

    fn add(&mut self, [queries, found]: [usize; 2], tests: usize) {
        self.cost += (SEARCH_COSTS[0] * queries + SEARCH_COSTS[1] * found) as u64;
        if self.cost > u64::from(COMPARED_STEPS) * tests as u64 {
            *self = Self { pause: STEPS_WITHOUT_SEARCH, ..Self::default() };
        }
    }
}

/// Bounds the rounding of distances and of receiver displacements, in µm.
fn slack(before: [f32; 3], radius: f32, active_receivers: &ActiveReceivers, traveled: f32) -> f32 {
    rounding(before, radius + active_receivers.largest + traveled)
}

pub(crate) struct NearbyReceivers<'a> {
    near: Neighbors<'a>,
    queries: &'a [Sphere],
    traveled: f32,
}

impl NearbyReceivers<'_> {
    /// Returns the receivers within `search_radius`, and the new clear sphere.
    pub(crate) fn receivers_near(
        &self,
        k: usize,
        search_radius: f32,
        (active_receivers, boundary): (&ActiveReceivers, &Boundary),
    ) -> (Vec<u32>, [f32; 4]) {
        let Sphere { center, radius } = self.queries[k];
        let before = center.to_array();
        let slack = slack(before, radius, active_receivers, self.traveled);
        let mut clear = radius - slack;
        let mut candidates = Vec::new();
        for &other in self.near.neighbors_of(k) {
            let state = &active_receivers.all[other as usize];
            let gap = signed_distance(state.receiver.radius, state.center, boundary, before) - slack;
            clear = clear.min(gap);
            if gap <= search_radius {
                candidates.push(other);
            }
        }
        let [x, y, z] = before;
        (candidates, [x, y, z, clear + self.traveled])
    }
}

#[cfg(test)]
mod tests;
