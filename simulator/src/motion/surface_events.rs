//! The effects of receivers on a particle on its path in a step.

use crate::motion::adsorption;
use crate::motion::receiver_state::Body;
use crate::model::boundary::Boundary;
use crate::motion::path_hit::{Path, Who, meets};
use crate::motion::propagate::Motion;
use crate::random::philox::{Purpose, fine_unit};
use crate::model::receiver::{Kind, Sticking, height};
use crate::motion::reflection::{Turned, turn};

/// An event of a particle at an index.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    /// It reached a receiver, and is to be removed.
    Arrived {
        /// The index of the particle.
        at: u32,
        /// The receiver's place in the model.
        receiver: u32,
    },
    /// It is to bind to a receptor if one is free for it, and stands where it would be otherwise.
    Bound {
        /// The index of the particle.
        at: u32,
        /// The receiver's place in the model.
        receiver: u32,
        /// The position at which it touched the surface, from the center.
        direction: [f32; 3],
        /// Who comes before it where receptors are few: those with less.
        rank: u32,
    },
    /// It decayed; what came of that may have done so in turn, in the next event.
    Decayed {
        /// The index of the particle.
        at: u32,
        /// The decay's place in the model.
        decay: u32,
        /// The species of the product; `None` removes the particle.
        product: Option<u32>,
    },
}

impl Event {
    /// The index of the particle.
    pub fn at(&self) -> u32 {
        match *self {
            Self::Arrived { at, .. } | Self::Bound { at, .. } | Self::Decayed { at, .. } => at,
        }
    }
}

/// A particle on its way in a step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Passage {
    /// Its place.
    pub(crate) at: u32,
    pub(crate) species: u32,
    pub(crate) who: Who,
    pub(crate) path: Path,
    /// How far it goes where surfaces turn it, in µm; 0 where none does.
    pub(crate) gone: f32,
    /// Its own, in µm/s, where particles have velocities.
    pub(crate) velocity: Option<[f32; 3]>,
}

impl Motion {
    /// Settles what befalls a particle: the first receiver of these, in their order, on which it stays, else surfaces that
    /// turn it back, and decays.
    #[inline]
    pub(crate) fn settle<'a>(
        &self,
        passage: &mut Passage,
        bodies: impl Iterator<Item = &'a Body>,
        events: &mut Vec<Event>,
    ) {
        let Passage { at, species, who, path, .. } = *passage;
        let seen = bodies.filter(|body| body.receiver.sees[species as usize]);
        if self.bodies.turn_back() {
            if let Some(event) = self.settle_turning(passage, seen) {
                return events.push(event);
            }
        } else {
            let room = &self.steps[species as usize].room;
            for body in seen {
                if meets(body, room, &path, who) {
                    return events.push(Event::Arrived { at, receiver: body.place });
                }
            }
        }
        self.decay(passage, events);
    }

    /// The decay of a particle in the step.
    #[inline]
    pub(crate) fn decay(&self, passage: &Passage, events: &mut Vec<Event>) {
        let Passage { at, species, who: Who { key, id, step }, .. } = *passage;
        self.decays.befall(species, (key, id, step), |decay, product| {
            events.push(Event::Decayed { at, decay, product });
        });
    }

    /// The receiver on which a particle stays, where some turn particles back. It then stands where it would be otherwise.
    fn settle_turning<'a>(
        &self,
        passage: &mut Passage,
        seen: impl Iterator<Item = &'a Body>,
    ) -> Option<Event> {
        let room = &self.steps[passage.species as usize].room;
        let Passage { at, who, path, .. } = *passage;
        // A particle inside may leave.
        let is_outside = |body: &Body| height(body.receiver.radius, body.center, room, path.before) >= 0.0;
        let turns_back = |body: &Body| body.receiver.kind.turns_back();
        let near: Vec<&Body> = seen.filter(|body| !turns_back(body) || is_outside(body)).collect();
        let turning: Vec<&Body> = near.iter().copied().filter(|body| turns_back(body)).collect();
        let mut velocity = passage.velocity.unwrap_or_default().map(|v| v * self.time_step);
        let turned = turn(&turning, room, &path, &mut velocity);
        if let Some(Turned { path, gone, .. }) = turned {
            (passage.path, passage.gone) = (path, gone);
            passage.velocity = passage.velocity.map(|_| velocity.map(|v| v / self.time_step));
        }
        for body in near.into_iter().filter(|body| body.receiver.kind != Kind::Reflecting) {
            // Where its surface turned the way first, the way to there was straight.
            let way = match &turned {
                Some(Turned { first, path, .. }) if *first != body.place => path,
                _ => &path,
            };
            if !meets(body, room, way, who) {
                continue;
            }
            if !turns_back(body) {
                return Some(Event::Arrived { at, receiver: body.place });
            }
            if let Some(event) = self.stays(at, body, (room, way), who) {
                return Some(event);
            }
        }
        None
    }

    /// What comes of a particle that reached a surface of which not all that does so is taken.
    fn stays(&self, at: u32, body: &Body, (room, path): (&Boundary, &Path), who: Who) -> Option<Event> {
        let radius = body.receiver.radius;
        let [a, b] = [(0.0, path.before), (1.0, path.after)]
            .map(|(part, point)| height(radius, body.center_at(part), room, point).abs());
        let part = match body.sticking {
            Sticking::PerStep(probability) => probability,
            Sticking::Reactivity(reactivity) => {
                let diffusion = f64::from(path.diffusion + body.diffusion);
                let sphere = (f64::from(radius), reactivity);
                adsorption::Step::new(diffusion, self.time_step.into(), sphere).sticking(f64::from(a + b))
            }
        };
        // The first word said whether the path met the surface.
        let [_, word, rank, _] = who.key.draw(who.id, body.place, who.step, Purpose::Receiver);
        if fine_unit(word) >= part {
            return None;
        }
        let receiver = body.place;
        if !matches!(body.receiver.kind, Kind::Receptors(_)) {
            return Some(Event::Arrived { at, receiver });
        }
        let time = if a + b > 0.0 { a / (a + b) } else { 0.0 };
        let touching = std::array::from_fn(|k| path.before[k] + time * (path.end[k] - path.before[k]));
        let out = room.offset(body.center_at(time), touching);
        let length = (out[0] * out[0] + out[1] * out[1] + out[2] * out[2]).sqrt();
        let direction = if length > 0.0 { out.map(|c| c / length) } else { [1.0, 0.0, 0.0] };
        Some(Event::Bound { at, receiver, direction, rank })
    }
}
