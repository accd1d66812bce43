use crate::model::boundary::Boundary;
use crate::model::receiver::{Adsorption, ReceiverKind, signed_distance};
use crate::motion::adsorption;
use crate::motion::path_hit::{Hit, Path, hits, length};
use crate::motion::receiver_state::{ActiveReceivers, ReceiverState};
use crate::motion::reflection::{PathReflection, ReflectedPath, reflect_path};
use crate::motion::wall::AbsorbingWall;
use crate::random::philox::{DrawContext, Purpose, fine_unit};

/// `at` is the particle's index.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    /// A receiver removes the particle.
    Arrived { at: u32, receiver: u32 },
    /// The particle requests a receptor. If refused, it stays at the end of its path.
    Bound {
        at: u32,
        receiver: u32,
        receptor: u32,
        /// Unit vector from the receiver's center to the point of contact.
        direction: [f32; 3],
        /// The lowest comes first.
        rank: u32,
    },
    /// A decay of the product is the next event.
    Decayed {
        at: u32,
        decay: u32,
        /// Species of the product; `None` removes the particle.
        product: Option<u32>,
        /// `true` if the product, by its random word, dissociates only after the step.
        spared: bool,
    },
}

/// The event at a hit unless the particle decays before.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Capture {
    pub(crate) hit: Hit,
    pub(crate) event: Event,
}

impl Capture {
    /// Returns the time of the hit, in steps.
    pub(crate) fn time(&self, context: DrawContext) -> f32 {
        self.hit.time(context, self.event.receiver())
    }
}

impl Event {
    pub(crate) fn receiver(&self) -> u32 {
        match *self {
            Self::Arrived { receiver, .. } | Self::Bound { receiver, .. } => receiver,
            Self::Decayed { .. } => u32::MAX,
        }
    }

    pub fn at(&self) -> u32 {
        match *self {
            Self::Arrived { at, .. } | Self::Bound { at, .. } | Self::Decayed { at, .. } => at,
        }
    }
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct ParticleMove {
    pub(crate) at: u32,
    pub(crate) species: u32,
    pub(crate) context: DrawContext,
    pub(crate) path: Path,
    /// End without walls.
    pub(crate) free_end: [f32; 3],
    /// Length of a path that a receiver reflected, or 0.
    pub(crate) path_length: f32,
    pub(crate) reflection: Option<PathReflection>,
    /// `None` in a model without velocities.
    pub(crate) velocity: Option<[f32; 3]>,
}

impl ParticleMove {
    pub(crate) fn stay(&mut self) {
        let before = self.path.before;
        (self.path.end, self.path.after, self.free_end) = (before, before, before);
        self.reflection = None;
    }

    /// Returns the distance of the ends without images, in µm.
    pub(crate) fn length(&self) -> f32 {
        let Path { before, end, .. } = self.path;
        length(std::array::from_fn(|k| end[k] - before[k]))
    }
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct PathSurroundings<'a> {
    pub(crate) domain: &'a Boundary,
    /// Duration of the path, in s.
    pub(crate) duration: f32,
    pub(crate) walls: &'a [AbsorbingWall],
}

impl ActiveReceivers {
    /// Returns the first capture. Reflecting receivers change the path.
    #[inline]
    pub(crate) fn resolve<'a>(
        &self,
        moved: &mut ParticleMove,
        surroundings: PathSurroundings<'_>,
        receivers: impl Iterator<Item = &'a ReceiverState>,
    ) -> Option<Capture> {
        let ParticleMove { at, species, context, path, .. } = *moved;
        let seen = receivers.filter(|state| state.receiver.sees[species as usize]);
        if self.any_reflect() {
            return reflect_or_keep(moved, surroundings, seen);
        }
        let mut first = FirstHit::default();
        for state in seen {
            if let Some(hit) = hits(state, surroundings.domain, &path, context) {
                first.update(context, Capture { hit, event: Event::Arrived { at, receiver: state.index } });
            }
        }
        first.0
    }
}

#[derive(Default)]
pub(crate) struct FirstHit(pub(crate) Option<Capture>);

impl FirstHit {
    /// Draws hitting times only for several hits.
    pub(crate) fn update(&mut self, context: DrawContext, capture: Capture) {
        match &self.0 {
            Some(earlier) if earlier.time(context) <= capture.time(context) => {}
            _ => self.0 = Some(capture),
        }
    }
}

fn reflect_or_keep<'a>(
    moved: &mut ParticleMove,
    PathSurroundings { domain, duration, walls }: PathSurroundings<'_>,
    seen: impl Iterator<Item = &'a ReceiverState>,
) -> Option<Capture> {
    let ParticleMove { at, species, context, path, free_end, .. } = *moved;
    let is_outside = |state: &ReceiverState| {
        signed_distance(state.receiver.radius, state.center, domain, path.before) >= 0.0
    };
    let reflects = |state: &ReceiverState| state.receiver.kind.reflects();
    let near: Vec<&ReceiverState> = seen.filter(|state| !reflects(state) || is_outside(state)).collect();
    let reflecting: Vec<&ReceiverState> = near.iter().copied().filter(|state| reflects(state)).collect();
    let mut velocity = moved.velocity.unwrap_or_default().map(|v| v * duration);
    let walls = walls.iter().filter(|wall| wall.sees[species as usize]);
    let extended = walls.fold(path, |path, wall| wall.extend_to_wall(domain, path, free_end));
    let reflected = reflect_path(&reflecting, domain, &extended, &mut velocity);
    if let Some(ReflectedPath { path, path_length, reflection, .. }) = reflected {
        (moved.path, moved.path_length, moved.reflection) = (path, path_length, Some(reflection));
        moved.velocity = moved.velocity.map(|_| velocity.map(|v| v / duration));
    }
    let mut first = FirstHit::default();
    for state in near.into_iter().filter(|state| state.receiver.kind != ReceiverKind::Reflecting) {
        // The path to the first reflecting surface is the original one.
        let free_path = match &reflected {
            Some(ReflectedPath { first, path, .. }) if *first != state.index => path,
            _ => &path,
        };
        let Some(hit) = hits(state, domain, free_path, context) else { continue };
        let event = match reflects(state) {
            true => adsorb(moved, state, (domain, free_path, duration)),
            false => Some(Event::Arrived { at, receiver: state.index }),
        };
        if let Some(event) = event {
            first.update(context, Capture { hit, event });
        }
    }
    first.0
}

fn adsorb(
    moved: &ParticleMove,
    state: &ReceiverState,
    (domain, path, time_step): (&Boundary, &Path, f32),
) -> Option<Event> {
    let ParticleMove { at, species, context, .. } = *moved;
    let has_receptors = matches!(state.receiver.kind, ReceiverKind::Receptors(_));
    let reactivity = state.reactivities(species).sum();
    if has_receptors && reactivity <= 0.0 {
        return None;
    }
    let [a, b] = state.heights(domain, [path.before, path.after], [0.0, 1.0]);
    let sticking = if has_receptors { Adsorption::Reactivity(reactivity) } else { state.sticking };
    let probability = match sticking {
        Adsorption::PerStep(probability) => probability,
        Adsorption::Reactivity(reactivity) => {
            let diffusion = f64::from(path.diffusion + state.diffusion);
            let sphere = (f64::from(state.curved_radius()), reactivity);
            adsorption::AdsorptionStep::new(diffusion, time_step.into(), sphere)
                .sticking([a, b].map(f64::from))
        }
    };
    // The first word has decided on the hit.
    let [_, word, rank, of_type] = context.draw(state.index, Purpose::Receiver);
    if fine_unit(word) >= probability {
        return None;
    }
    let receiver = state.index;
    if !has_receptors {
        return Some(Event::Arrived { at, receiver });
    }
    let [a, b] = [a.abs(), b.abs()];
    let time = if a + b > 0.0 { a / (a + b) } else { 0.0 };
    let touching = std::array::from_fn(|k| path.before[k] + time * (path.end[k] - path.before[k]));
    let out = domain.displacement(state.center_at(time), touching);
    let distance = length(out);
    let direction = if distance > 0.0 { out.map(|c| c / distance) } else { [1.0, 0.0, 0.0] };
    let receptor = state.first_type + chosen_type(state, species, fine_unit(of_type) * reactivity);
    Some(Event::Bound { at, receiver, receptor, direction, rank })
}

/// Returns the type at which the sum of reactivities passes `at`.
fn chosen_type(state: &ReceiverState, species: u32, mut at: f64) -> u32 {
    let mut last = 0;
    for (k, reactivity) in (0..).zip(state.reactivities(species)).filter(|&(_, reactivity)| reactivity > 0.0)
    {
        last = k;
        at -= reactivity;
        if at < 0.0 {
            break;
        }
    }
    last
}
