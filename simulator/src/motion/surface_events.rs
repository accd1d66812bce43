//! The effects of receivers on a particle on its path in a step.

use crate::model::boundary::Boundary;
use crate::model::receiver::{Adsorption, ReceiverKind, signed_distance};
use crate::motion::adsorption;
use crate::motion::path_hit::{DrawContext, Path, hits};
use crate::motion::receiver_state::{ActiveReceivers, ReceiverState};
use crate::motion::reflection::{ReflectedPath, reflect_path};
use crate::random::philox::{Purpose, fine_unit};

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
        /// DrawContext comes before it where receptors are few: those with less.
        rank: u32,
    },
    /// It decayed; what came of that may have done so in reflect_path, in the next event.
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
pub(crate) struct ParticleMove {
    /// Its place.
    pub(crate) at: u32,
    pub(crate) species: u32,
    pub(crate) who: DrawContext,
    pub(crate) path: Path,
    /// How far it goes where surfaces reflect_path it, in µm; 0 where none does.
    pub(crate) gone: f32,
    /// Its own, in µm/s, where particles have velocities.
    pub(crate) velocity: Option<[f32; 3]>,
}

impl ActiveReceivers {
    /// Returns the event of a particle at the first of `receivers` that it reaches and that keeps it. Receivers that reflect it
    /// change its path.
    #[inline]
    pub(crate) fn resolve<'a>(
        &self,
        moved: &mut ParticleMove,
        (domain, time_step): (&Boundary, f32),
        receivers: impl Iterator<Item = &'a ReceiverState>,
    ) -> Option<Event> {
        let ParticleMove { at, species, who, path, .. } = *moved;
        let mut seen = receivers.filter(|body| body.receiver.sees[species as usize]);
        if self.any_reflect() {
            return reflect_or_keep(moved, (domain, time_step), seen);
        }
        let body = seen.find(|body| hits(body, domain, &path, who))?;
        Some(Event::Arrived { at, receiver: body.place })
    }
}

/// Returns the event of a particle at the receiver that keeps it, if some receivers reflect particles. Otherwise its path
/// becomes the reflected one.
fn reflect_or_keep<'a>(
    moved: &mut ParticleMove,
    (domain, time_step): (&Boundary, f32),
    seen: impl Iterator<Item = &'a ReceiverState>,
) -> Option<Event> {
    let ParticleMove { at, who, path, .. } = *moved;
    // A particle inside may leave.
    let is_outside =
        |body: &ReceiverState| signed_distance(body.receiver.radius, body.center, domain, path.before) >= 0.0;
    let reflects = |body: &ReceiverState| body.receiver.kind.reflects();
    let near: Vec<&ReceiverState> = seen.filter(|body| !reflects(body) || is_outside(body)).collect();
    let reflecting: Vec<&ReceiverState> = near.iter().copied().filter(|body| reflects(body)).collect();
    let mut velocity = moved.velocity.unwrap_or_default().map(|v| v * time_step);
    let reflected = reflect_path(&reflecting, domain, &path, &mut velocity);
    if let Some(ReflectedPath { path, gone, .. }) = reflected {
        (moved.path, moved.gone) = (path, gone);
        moved.velocity = moved.velocity.map(|_| velocity.map(|v| v / time_step));
    }
    for body in near.into_iter().filter(|body| body.receiver.kind != ReceiverKind::Reflecting) {
        // The path to the surface that reflected it first was straight.
        let taken = match &reflected {
            Some(ReflectedPath { first, path, .. }) if *first != body.place => path,
            _ => &path,
        };
        if !hits(body, domain, taken, who) {
            continue;
        }
        if !reflects(body) {
            return Some(Event::Arrived { at, receiver: body.place });
        }
        if let Some(event) = stays(at, body, (domain, taken, time_step), who) {
            return Some(event);
        }
    }
    None
}

/// Returns the event of a particle that reached a surface that keeps some of the particles that reach it.
fn stays(
    at: u32,
    body: &ReceiverState,
    (domain, path, time_step): (&Boundary, &Path, f32),
    who: DrawContext,
) -> Option<Event> {
    let radius = body.receiver.radius;
    let [a, b] = [(0.0, path.before), (1.0, path.after)]
        .map(|(part, point)| signed_distance(radius, body.center_at(part), domain, point).abs());
    let part = match body.sticking {
        Adsorption::PerStep(probability) => probability,
        Adsorption::Reactivity(reactivity) => {
            let diffusion = f64::from(path.diffusion + body.diffusion);
            let sphere = (f64::from(radius), reactivity);
            adsorption::Step::new(diffusion, time_step.into(), sphere).sticking(f64::from(a + b))
        }
    };
    // The first word said whether the path met the surface.
    let [_, word, rank, _] = who.key.draw(who.id, body.place, who.step, Purpose::Receiver);
    if fine_unit(word) >= part {
        return None;
    }
    let receiver = body.place;
    if !matches!(body.receiver.kind, ReceiverKind::Receptors(_)) {
        return Some(Event::Arrived { at, receiver });
    }
    let time = if a + b > 0.0 { a / (a + b) } else { 0.0 };
    let touching = std::array::from_fn(|k| path.before[k] + time * (path.end[k] - path.before[k]));
    let out = domain.displacement(body.center_at(time), touching);
    let length = (out[0] * out[0] + out[1] * out[1] + out[2] * out[2]).sqrt();
    let direction = if length > 0.0 { out.map(|c| c / length) } else { [1.0, 0.0, 0.0] };
    Some(Event::Bound { at, receiver, direction, rank })
}
