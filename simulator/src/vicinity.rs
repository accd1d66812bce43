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
use crate::bodies::Bodies;
use crate::boundary::Boundary;
use crate::crossing::Path;
use crate::receiver::{finder, rounding};

/// How far a particle may get in this step: in a ball of radius `half` around the middle of its straight way, and beyond
/// that as far as diffusion bends it and receivers come towards it, `more`. All in µm.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reach {
    middle: [f32; 3],
    half: f32,
    more: f32,
}

impl Reach {
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

/// The balls in which there is no receiver, and the search for others.
#[derive(Debug)]
pub(crate) struct Vicinity {
    detector: Detector,
    /// By the places of particles: centre, and radius with how far receivers had got. All in µm.
    pub(crate) balls: Vec<[f32; 4]>,
    /// How far any receiver can have got since all balls were unknown, in µm.
    pub(crate) travelled: f32,
    steps: u32,
    /// How far the detector looks, as a multiple of the reach of a step. It does not change a result.
    factor: f32,
    queries: Vec<Sphere>,
    receivers: Vec<Sphere>,
    worth: Worth,
}

/// Whether searches cost less than looking at every receiver. Nothing of it changes a result.
#[derive(Debug, Default)]
struct Worth {
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
/// Steps of moving receivers after which balls are forgotten, so that rounding adds up to nothing.
const FORGET: u32 = 64;
/// How far the detector looks: the first, the least and the most.
const FACTORS: [f32; 3] = [4.0, 1.5, 64.0];
/// Receivers found per particle, between which the detector looks as far as before.
const FOUND: [usize; 2] = [1, 4];

impl Vicinity {
    /// A search in the space of a model, where it has receivers.
    ///
    /// # Errors
    /// [`Error::Detection`] for a box without extent.
    pub(crate) fn new(bodies: &Bodies, boundary: &Boundary) -> Result<Option<Self>, Error> {
        if bodies.all.is_empty() {
            return Ok(None);
        }
        Ok(Some(Self {
            detector: finder(boundary)?,
            balls: Vec::new(),
            travelled: 0.0,
            steps: 0,
            factor: FACTORS[0],
            queries: Vec::new(),
            receivers: Vec::new(),
            worth: Worth::default(),
        }))
    }

    /// Before a step of so many particles. Says whether it is to search, or to look at every receiver.
    pub(crate) fn begin(&mut self, particles: usize, bodies: &Bodies) -> bool {
        if bodies.move_about() {
            if self.steps.is_multiple_of(FORGET) {
                self.balls.clear();
                self.travelled = 0.0;
            }
            self.steps += 1;
        }
        self.balls.resize(particles, UNKNOWN);
        if bodies.move_about() || self.receivers.is_empty() {
            let sphere = |body: &crate::bodies::Body| Sphere::new(body.center, body.receiver.radius);
            self.receivers.clear();
            self.receivers.extend(bodies.all.iter().map(sphere));
        }
        self.worth.begin()
    }

    /// Behind a step.
    pub(crate) fn end(&mut self, bodies: &Bodies) {
        self.travelled += bodies.longest_way;
    }

    /// Whether a particle meets no receiver in the step.
    #[inline(always)]
    pub(crate) fn is_clear(&self, place: usize, reach: &Reach) -> bool {
        let [x, y, z, radius] = self.balls[place];
        let d = [reach.middle[0] - x, reach.middle[1] - y, reach.middle[2] - z];
        let distance = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
        distance + reach.half + reach.more <= radius - self.travelled
    }

    /// Finds the receivers near these particles, each with where it begins and how far it reaches. Returns them
    /// by particle in the order of the bodies, with the distances in which all are found and what is left for the balls.
    ///
    /// # Errors
    /// What the detector says.
    pub(crate) fn find<'a>(
        &'a mut self,
        particles: impl Iterator<Item = ([f32; 3], f32)>,
        bodies: &Bodies,
    ) -> Result<Found<'a>, lazygrid::Error> {
        let Self { detector, travelled, factor, queries, receivers, balls, worth, .. } = self;
        queries.clear();
        queries.extend(particles.map(|(before, reach)| {
            let radius = *factor * reach + 1e-3 * bodies.largest;
            Sphere::new(before, radius + slack(before, radius, bodies, *travelled))
        }));
        let near = detector.neighbors_between(&*queries, &*receivers)?;
        let found: usize = (0..near.len()).map(|k| near.of(k).len()).sum();
        worth.see([queries.len(), found], balls.len() * receivers.len());
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

impl Worth {
    /// Whether a step is to search.
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
fn slack(before: [f32; 3], radius: f32, bodies: &Bodies, travelled: f32) -> f32 {
    rounding(before, radius + bodies.largest + travelled)
}

/// What the detector found.
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
        (bodies, boundary): (&Bodies, &Boundary),
    ) -> (Vec<u32>, [f32; 4]) {
        let Sphere { center, radius } = self.queries[k];
        let before = center.to_array();
        let slack = slack(before, radius, bodies, self.travelled);
        let mut clear = radius - slack;
        let mut candidates = Vec::new();
        for &other in self.near.of(k) {
            let body = &bodies.all[other as usize];
            let gap = crate::receiver::height(body.receiver.radius, body.center, boundary, before) - slack;
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
mod tests {
    use super::*;
    use crate::bodies::moved;
    use crate::model::{Flow, Model, Species};
    use crate::motion::Motion;
    use crate::particles::{Particle, Particles};
    use crate::philox::{Key, open_unit, philox};
    use crate::receiver::{Kind, Receiver, Receptors, Sticking};
    use crate::vessel::Vessel;

    const MANY: u32 = 60;

    fn place(k: u32) -> [f32; 3] {
        let [x, y, z, _] = philox([k, 1, 0, 0], [8, 8]).map(|word| 6.0 * open_unit(word) - 3.0);
        [x, y, z]
    }

    /// Receivers of all kinds, some of which move where `speed` is not 0.
    fn model(boundary: Boundary, flow: Option<Flow>, speed: f64) -> Model {
        let sizes = [0.05, 0.2, 0.5];
        let kinds = [
            Kind::Absorbing,
            Kind::Endpoint,
            Kind::Transparent,
            Kind::Reflecting,
            Kind::Partial(Sticking::PerStep(0.3)),
            Kind::Partial(Sticking::Reactivity(2.0)),
            Kind::Receptors(Receptors { count: 9, binding_rate: 2.0, unbinding_rate: 1.0 }),
        ];
        let receiver = |k: u32| Receiver {
            name: "rx".into(),
            center: place(k),
            radius: sizes[k as usize % 3],
            kind: kinds[k as usize / 3 % 7],
            sees: vec![true, !k.is_multiple_of(4)],
            velocity: if k.is_multiple_of(5) { [speed, 0.0, -speed] } else { [0.0; 3] },
            diffusion: if k.is_multiple_of(7) { speed } else { 0.0 },
        };
        let species = |name: &str, diffusion, drift, thermal_speed| Species {
            name: name.into(),
            radius: 0.01,
            diffusion,
            mass: 1.0,
            drift,
            thermal_speed,
            ..Species::default()
        };
        Model {
            time_step: 0.01,
            species: vec![species("A", 1.0, [0.0; 3], 0.0), species("B", 0.1, [20.0, 5.0, 0.0], 1.0)],
            receivers: (0..MANY).map(receiver).collect(),
            boundary,
            flow,
            ..Model::default()
        }
    }

    /// What befalls particles in some steps, and where they are, with or without a search; and how many steps searched.
    fn run(model: &Model, steps: u32, searches: bool) -> ((Vec<crate::motion::Event>, Particles), usize) {
        let mut motion = Motion::new(model);
        let mut vicinity = Vicinity::new(&motion.bodies, &model.boundary).unwrap().filter(|_| searches);
        assert_eq!(vicinity.is_some(), searches);
        let mut searched = 0;
        let mut particles = Particles::default();
        for id in 0..1500 {
            let position = model.rooms()[0].place(place(id + 1000));
            let particle =
                Particle { id, position, radius: 0.01, species: id % 2, velocity: [1.0, 0.0, 0.5] };
            particles.push(particle, true);
        }
        let mut centers: Vec<[f32; 3]> = model.receivers.iter().map(|receiver| receiver.center).collect();
        let mut all = Vec::new();
        for step in 0..steps {
            searched += usize::from(vicinity.as_ref().is_some_and(|vicinity| vicinity.worth.rest == 0));
            let places = moved(model, &centers, Key::new(3), step);
            motion.bodies.set(&centers, &places, &vec![5; centers.len()]);
            let events = motion.advance(&mut particles, vicinity.as_mut(), (Key::new(3), step)).unwrap();
            let mut gone: Vec<u32> = events.iter().map(crate::motion::Event::at).collect();
            particles.remove(&mut gone);
            centers = places.iter().map(|place| place.center).collect();
            all.extend(events);
        }
        ((all, particles), searched)
    }

    #[test]
    fn the_loop_takes_over_where_all_are_near() {
        // One sphere in a box not much wider, and the same one in a wide box.
        let of = |half: f32| {
            let mut model = model(Boundary::reflecting([-half; 3], [half; 3]), None, 0.0);
            let receiver = Receiver { center: [0.0; 3], radius: 0.2, ..model.receivers[9].clone() };
            model.receivers = vec![Receiver { kind: Kind::Reflecting, ..receiver }];
            model.species[1].drift = [0.0; 3];
            model
        };
        for (half, few, most) in [(0.35, 2, 40), (3.0, 400, 600)] {
            let model = of(half);
            let (found, searched) = run(&model, 600, true);
            assert!((few..=most).contains(&searched), "{searched} of 600 steps searched in {half}");
            assert_eq!(found, run(&model, 600, false).0, "{half}");
        }
    }

    #[test]
    fn a_search_gives_what_a_loop_gives() {
        let vessel = Vessel { along: 0, center: [0.0; 3], radius: 3.0 };
        let tube = Boundary { vessel: Some(vessel), ..Boundary::default() };
        let cases = [
            (Boundary::default(), None, 0.0),
            (Boundary::periodic([-3.0; 3], [3.0; 3]), None, 0.0),
            (Boundary::reflecting([-3.0; 3], [3.0; 3]), Some(Flow::Plug([3.0, 0.0, 0.0])), 0.0),
            (tube, Some(Flow::Poiseuille { mean: 10.0 }), 0.0),
            (Boundary::periodic([-3.0; 3], [3.0; 3]), None, 4.0),
            (Boundary::reflecting([-3.0; 3], [3.0; 3]), None, 4.0),
            // So fast that what they turn back goes much farther than it would alone.
            (Boundary::periodic([-3.0; 3], [3.0; 3]), None, 60.0),
            (Boundary::default(), None, 60.0),
        ];
        for (boundary, flow, speed) in cases {
            let model = model(boundary, flow, speed);
            // Fast receivers soon take most.
            let (steps, least) = if speed > 10.0 { (12, 8) } else { (100, 50) };
            let ((found, particles), searched) = run(&model, steps, true);
            assert!(searched > least, "{searched}");
            assert!(found.len() > 100 && particles.len() > 100, "{} {}", found.len(), particles.len());
            assert_eq!((found, particles), run(&model, steps, false).0, "{boundary:?}, {speed}");
        }
    }

    /// A receiver that comes throws the particle farther than either of them goes: at another one that takes it, or off
    /// which it goes back.
    #[test]
    fn what_a_particle_is_thrown_at_is_found() {
        let of = |center: f32, kind, velocity| Receiver {
            name: "rx".into(),
            center: [center, 0.0, 0.0],
            radius: 0.5,
            kind,
            sees: vec![true],
            velocity: [velocity, 0.0, 0.0],
            diffusion: 0.0,
        };
        for (kind, back) in [(Kind::Absorbing, 0.0), (Kind::Reflecting, 0.0), (Kind::Reflecting, -100.0)] {
            let model = Model {
                time_step: 0.01,
                species: vec![Species { name: "A".into(), radius: 0.01, mass: 1.0, ..Species::default() }],
                receivers: vec![
                    of(-0.51, Kind::Reflecting, 100.0),
                    of(2.1, kind, back),
                    of(4.2, Kind::Absorbing, 0.0),
                ],
                ..Model::default()
            };
            let after = [true, false].map(|searches| {
                let mut motion = Motion::new(&model);
                let mut vicinity =
                    Vicinity::new(&motion.bodies, &model.boundary).unwrap().filter(|_| searches);
                let mut particles = Particles::default();
                particles.push(Particle::default(), false);
                let centers: Vec<_> = model.receivers.iter().map(|receiver| receiver.center).collect();
                motion.bodies.set(&centers, &moved(&model, &centers, Key::new(3), 0), &[0; 3]);
                let events = motion.advance(&mut particles, vicinity.as_mut(), (Key::new(3), 0)).unwrap();
                (events, particles)
            });
            assert_eq!(after[0], after[1]);
            let x = after[0].1.position[0][0];
            assert!(
                kind == Kind::Absorbing && after[0].0.len() == 1 || kind == Kind::Reflecting && x < 1.6,
                "{after:?}"
            );
        }
    }
}
