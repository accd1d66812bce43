//! The state of receivers in a step: position, displacement and surface.

use crate::motion::adsorption;
use crate::model::boundary::{Axis, Boundary};
use crate::model::Model;
use crate::random::gaussian::normals;
use crate::random::philox::{Key, Purpose};
use crate::model::receiver::{Kind, Receiver, Sticking};

/// A receiver in a step.
#[derive(Clone, Debug)]
pub struct Body {
    /// Its index in the model.
    pub place: u32,
    /// Its description in the model.
    pub receiver: Receiver,
    /// Its center at the beginning of the step, in µm.
    pub center: [f32; 3],
    /// Its displacement in the step, in µm.
    pub way: [f32; 3],
    /// The part of the displacement that is drift, in µm.
    pub drift: [f32; 3],
    /// DΔt, in µm².
    pub diffusion: f32,
    /// The adsorption rule of a surface that reflects the remaining particles.
    pub sticking: Sticking,
}

impl Body {
    /// Creates a receiver at its initial position in the model.
    pub fn new(place: u32, receiver: Receiver, time_step: f64) -> Self {
        Self {
            place,
            center: receiver.center,
            way: [0.0; 3],
            drift: receiver.velocity.map(|v| (v * time_step) as f32),
            diffusion: (receiver.diffusion * time_step) as f32,
            sticking: match receiver.kind {
                Kind::Partial(sticking) => sticking,
                _ => Sticking::Reactivity(0.0),
            },
            receiver,
        }
    }

    /// Returns its center after the fraction `part` of the step, from 0 to 1.
    #[inline(always)]
    pub fn center_at(&self, part: f32) -> [f32; 3] {
        std::array::from_fn(|k| self.center[k] + part * self.way[k])
    }

    /// Sets the reactivity for `free` free receptors.
    fn set_free(&mut self, free: u32) {
        if let Kind::Receptors(receptors) = self.receiver.kind {
            let radius = self.receiver.radius.into();
            self.sticking =
                Sticking::Reactivity(adsorption::reactivity(receptors.binding_rate, free, radius));
        }
    }
}

/// The receivers of a model that affect particles, in its order.
#[derive(Clone, Debug)]
pub(crate) struct Bodies {
    pub(crate) all: Vec<Body>,
    /// Indices in `all` of the receivers that move or have receptors.
    changing: Vec<usize>,
    moving: bool,
    turning: bool,
    /// The largest DΔt of a receiver, in µm².
    pub(crate) diffusion: f32,
    /// The largest displacement of a receiver in this step, in µm.
    pub(crate) longest_way: f32,
    /// The largest radius, in µm.
    pub(crate) largest: f32,
}

impl Bodies {
    /// Creates the receivers of a model that [`Model::check`] accepts.
    pub(crate) fn new(model: &Model) -> Self {
        let acts = model.receivers.iter().enumerate().filter(|(_, r)| r.kind != Kind::Transparent);
        let all: Vec<Body> =
            acts.map(|(at, receiver)| Body::new(at as u32, receiver.clone(), model.time_step)).collect();
        let changes = |body: &Body| body.receiver.moves() || matches!(body.receiver.kind, Kind::Receptors(_));
        Self {
            changing: (0..all.len()).filter(|&k| changes(&all[k])).collect(),
            moving: all.iter().any(|body| body.receiver.moves()),
            turning: all.iter().any(|body| body.receiver.kind.turns_back()),
            diffusion: all.iter().map(|body| body.diffusion).fold(0.0, f32::max),
            largest: all.iter().map(|body| body.receiver.radius).fold(0.0, f32::max),
            longest_way: 0.0,
            all,
        }
    }

    /// Returns `true` if some receivers move.
    pub(crate) fn move_about(&self) -> bool {
        self.moving
    }

    /// Returns `true` if some receivers reflect particles.
    pub(crate) fn turn_back(&self) -> bool {
        self.turning
    }

    /// Updates centers, displacements and numbers of free receptors for a step.
    pub(crate) fn set(&mut self, centers: &[[f32; 3]], places: &[Place], free: &[u32]) {
        self.longest_way = 0.0;
        for &k in &self.changing {
            let body = &mut self.all[k];
            let at = body.place as usize;
            body.center = centers[at];
            body.way = places[at].way;
            let way = body.way.iter().map(|w| w * w).sum::<f32>().sqrt();
            self.longest_way = self.longest_way.max(way);
            body.set_free(free[at]);
        }
    }
}

/// The center of a receiver and its last displacement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Place {
    /// Center, in µm.
    pub(crate) center: [f32; 3],
    /// Displacement in the last step, not wrapped at periodic boundaries, in µm.
    pub(crate) way: [f32; 3],
}

/// Moves receivers by a step. Walls act on their surfaces; receivers pass through each other.
pub(crate) fn moved(model: &Model, centers: &[[f32; 3]], key: Key, step: u32) -> Vec<Place> {
    let one = |(at, (receiver, &center)): (usize, (&Receiver, &[f32; 3]))| {
        if !receiver.moves() {
            return Place { center, way: [0.0; 3] };
        }
        let spread = (2.0 * receiver.diffusion * model.time_step).sqrt() as f32;
        let z = normals(key.draw(at as u32, 0, step, Purpose::Body));
        let end: [f32; 3] = std::array::from_fn(|k| {
            center[k] + (spread * z[k] + (receiver.velocity[k] * model.time_step) as f32)
        });
        let room = room_of(model, receiver);
        let after = room.place(end);
        let way = std::array::from_fn(|k| match room.axes[k] {
            Axis::Periodic { .. } => end[k] - center[k],
            _ => after[k] - center[k],
        });
        Place { center: after, way }
    };
    model.receivers.iter().zip(centers).enumerate().map(one).collect()
}

/// Returns the boundary of a receiver's center. If the receiver does not fit between the walls, only its center stays
/// inside.
fn room_of(model: &Model, receiver: &Receiver) -> Boundary {
    let room = model.boundary;
    match room.too_narrow(receiver.radius) {
        None => room.inset(receiver.radius),
        Some(_) => room,
    }
}
