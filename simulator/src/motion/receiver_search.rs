//! Which particles may meet a receiver in a step.
//!
//! Of each particle a ball is known in which there is no receiver, from when the detector last looked. As long as the way
//! of a particle stays in its ball there is nothing to decide. Those that leave theirs are given to the detector, as
//! spheres in which they may get about for some time, with the receivers as the other set. So a step costs a
//! distance per particle, and a search for few.
//!
//! A ball is a fact about space and not about the particle: it stays true whoever takes the place of a particle, and
//! however that is moved. What is left alone would have met no receiver, to the last bit, so results are those of a loop
//! over all receivers.
//!
//! Where most particles are so near receivers that they are given to the detector step after step, the loop is faster, and is
//! taken for some time.

use lazygrid::{Detector, Neighbors, Sphere};

use crate::Error;
use crate::model::boundary::Boundary;
use crate::model::receiver::{finder, rounding};
use crate::motion::path_hit::Path;
use crate::motion::receiver_state::ActiveReceivers;

/// How far a particle may get in this step: in a ball of radius `half` around the middle of its straight way, and beyond
/// that as far as diffusion bends it and receivers come towards it, `more`. All in µm.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StepBounds {
    middle: [f32; 3],
    half: f32,
    more: f32,
}

impl StepBounds {
    #[inline(always)]
    pub(crate) fn new(path: &Path, more: f32) -> Self {
        let way: [f32; 3] = std::array::from_fn(|k| path.end[k] - path.before[k]);
        let half = 0.5 * (way[0] * way[0] + way[1] * way[1] + way[2] * way[2]).sqrt();
        Self { middle: std::array::from_fn(|k| path.before[k] + 0.5 * way[k]), half, more }
    }

    /// How far that is from where the particle begins, in µm.
    pub(crate) fn around_beginning(&self) -> f32 {
        2.0 * self.half + self.more
    }
}

/// The clear_spheres in which there is no receiver, and the search for others.
#[derive(Debug)]
pub(crate) struct ReceiverSearch {
    detector: Detector,
    /// By the places of particles: centre, and radius with how far receivers had got. All in µm.
    pub(crate) clear_spheres: Vec<[f32; 4]>,
    /// How far any receiver can have got since all clear_spheres were unknown, in µm.
    pub(crate) travelled: f32,
    steps: u32,
    /// How far the detector looks, as a multiple of the reach of a step. It does not change a result.
    factor: f32,
    queries: Vec<Sphere>,
    receivers: Vec<Sphere>,
    worth: SearchCost,
}

/// Whether searches cost less than looking at every receiver. Nothing of it changes a result.
#[derive(Debug, Default)]
struct SearchCost {
    /// Steps with searches in this window.
    steps: u32,
    /// What they cost, as so many looks at a receiver.
    cost: u64,
    /// Steps to come without.
    rest: u32,
}

/// Steps over which searches are held against looks at every receiver. At first no ball is known, and the first searches
/// say little.
const WINDOW: u32 = 16;
/// Steps without a search where these were dearer.
const REST: u32 = 240;
/// What a search costs for each particle, and for each receiver that is found near one, in looks at a receiver: about 100 ns,
/// and 20 ns and often a look, beside 35 ns on the machine of the tables in docs/simulator.md.
const COSTS: [usize; 2] = [3, 1];

/// Nothing is known.
const UNKNOWN: [f32; 4] = [0.0, 0.0, 0.0, -1.0];
/// Steps of moving receivers after which clear_spheres are forgotten, so that rounding adds up to nothing.
const FORGET: u32 = 64;
/// The distances at which the detector looks: the first, the least and the most.
const FACTORS: [f32; 3] = [4.0, 1.5, 64.0];
/// Receivers found per particle, between which the detector looks as far as before.
const FOUND: [usize; 2] = [1, 4];

impl ReceiverSearch {
    /// A search in the space of a model, where it has receivers.
    ///
    /// # Errors
    /// [`Error::Detection`] for a box without extent.
    pub(crate) fn new(bodies: &ActiveReceivers, boundary: &Boundary) -> Result<Option<Self>, Error> {
        if bodies.all.is_empty() {
            return Ok(None);
        }
        Ok(Some(Self {
            detector: finder(boundary)?,
            clear_spheres: Vec::new(),
            travelled: 0.0,
            steps: 0,
            factor: FACTORS[0],
            queries: Vec::new(),
            receivers: Vec::new(),
            worth: SearchCost::default(),
        }))
    }

    /// Before a step of so many particles. Says whether it is to search, or to look at every receiver.
    pub(crate) fn begin(&mut self, particles: usize, bodies: &ActiveReceivers) -> bool {
        if bodies.move_about() {
            if self.steps.is_multiple_of(FORGET) {
                self.clear_spheres.clear();
                self.travelled = 0.0;
            }
            self.steps += 1;
        }
        self.clear_spheres.resize(particles, UNKNOWN);
        if bodies.move_about() || self.receivers.is_empty() {
            let sphere = |body: &crate::motion::receiver_state::ReceiverState| {
                Sphere::new(body.center, body.receiver.radius)
            };
            self.receivers.clear();
            self.receivers.extend(bodies.all.iter().map(sphere));
        }
        self.worth.begin()
    }

    /// Behind a step.
    pub(crate) fn end(&mut self, bodies: &ActiveReceivers) {
        self.travelled += bodies.max_displacement;
    }

    /// Returns `true` if a particle meets no receiver in the step.
    #[inline(always)]
    pub(crate) fn is_clear(&self, place: usize, reach: &StepBounds) -> bool {
        let [x, y, z, radius] = self.clear_spheres[place];
        let d = [reach.middle[0] - x, reach.middle[1] - y, reach.middle[2] - z];
        let distance = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
        distance + reach.half + reach.more <= radius - self.travelled
    }

    /// Finds the receivers near these particles, each with where it begins and how far it reaches. Returns them
    /// by particle in the order of the bodies, with the distances in which all are found and what is left for the clear_spheres.
    ///
    /// # Errors
    /// Fails if the detector fails.
    pub(crate) fn find<'a>(
        &'a mut self,
        particles: impl Iterator<Item = ([f32; 3], f32)>,
        bodies: &ActiveReceivers,
    ) -> Result<Found<'a>, lazygrid::Error> {
        let Self { detector, travelled, factor, queries, receivers, clear_spheres, worth, .. } = self;
        queries.clear();
        queries.extend(particles.map(|(before, reach)| {
            let radius = *factor * reach + 1e-3 * bodies.largest;
            Sphere::new(before, radius + slack(before, radius, bodies, *travelled))
        }));
        let near = detector.neighbors((&*queries, &*receivers))?;
        let found: usize = (0..near.len()).map(|k| near.neighbors_of(k).len()).sum();
        worth.see([queries.len(), found], clear_spheres.len() * receivers.len());
        let [_, least, most] = FACTORS;
        // A few say little about the next step.
        if found > FOUND[1] * queries.len().max(16) {
            *factor = (*factor / 1.5).max(least);
        } else if found < FOUND[0] * queries.len() {
            *factor = (*factor * 1.5).min(most);
        }
        Ok(Found { near, queries, travelled: *travelled })
    }
}

impl SearchCost {
    /// Returns `true` if a step is to search.
    fn begin(&mut self) -> bool {
        if self.rest > 0 {
            self.rest -= 1;
            return false;
        }
        if self.steps == WINDOW {
            *self = Self::default();
        }
        self.steps += 1;
        true
    }

    /// Enters a search for so many particles that found so many receivers, where otherwise so many looks are due in a step.
    fn see(&mut self, [queries, found]: [usize; 2], looks: usize) {
        self.cost += (COSTS[0] * queries + COSTS[1] * found) as u64;
        if self.cost > u64::from(WINDOW) * looks as u64 {
            *self = Self { rest: REST, ..Self::default() };
        }
    }
}

/// What rounding may do to the distances between a particle, its ball and receivers, and to how far these got.
fn slack(before: [f32; 3], radius: f32, bodies: &ActiveReceivers, travelled: f32) -> f32 {
    rounding(before, radius + bodies.largest + travelled)
}

/// The result of the detector.
pub(crate) struct Found<'a> {
    near: Neighbors<'a>,
    queries: &'a [Sphere],
    travelled: f32,
}

impl Found<'_> {
    /// The receivers that the `k`th particle may meet that reaches so far, and the ball in which there is none.
    pub(crate) fn of(
        &self,
        k: usize,
        reach: f32,
        (bodies, boundary): (&ActiveReceivers, &Boundary),
    ) -> (Vec<u32>, [f32; 4]) {
        let Sphere { center, radius } = self.queries[k];
        let before = center.to_array();
        let slack = slack(before, radius, bodies, self.travelled);
        let mut clear = radius - slack;
        let mut candidates = Vec::new();
        for &other in self.near.neighbors_of(k) {
            let body = &bodies.all[other as usize];
            let gap =
                crate::model::receiver::signed_distance(body.receiver.radius, body.center, boundary, before)
                    - slack;
            clear = clear.min(gap);
            if gap <= reach {
                candidates.push(other);
            }
        }
        let [x, y, z] = before;
        (candidates, [x, y, z, clear + self.travelled])
    }
}

#[cfg(test)]
mod tests;
