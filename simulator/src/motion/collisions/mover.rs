use crate::model::boundary::{Axis, Boundary};
use crate::model::particles::Particles;
pub(crate) use crate::model::vessel::dot;
use crate::motion::path_hit::Path;

#[derive(Clone, Copy, Debug)]
pub(crate) struct Flight {
    pub(crate) path: Path,
    /// End without walls.
    pub(crate) free_end: [f32; 3],
    /// After a tumble and before walls.
    pub(crate) tumbled_velocity: [f32; 3],
    /// At the end, in µm/s.
    pub(crate) velocity: [f32; 3],
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Mover {
    /// At `time`, not wrapped.
    pub(crate) position: [f64; 3],
    /// Fraction of the step up to which the path is known.
    pub(crate) time: f64,
    /// Displacement per step.
    pub(crate) motion: [f64; 3],
    /// Length of `motion`.
    pub(crate) speed: f64,
    /// Own velocity, in µm/s.
    pub(crate) velocity: [f64; 3],
    pub(crate) id: u32,
    pub(crate) species: u32,
    pub(crate) radius: f32,
    pub(crate) collided: bool,
}

impl Mover {
    pub(crate) fn new(particles: &Particles, at: usize, flight: &Flight) -> Self {
        let position = flight.path.before.map(f64::from);
        let motion = std::array::from_fn(|k| f64::from(flight.free_end[k]) - position[k]);
        Self {
            position,
            time: 0.0,
            motion,
            speed: length(motion),
            velocity: flight.tumbled_velocity.map(f64::from),
            id: particles.id[at],
            species: particles.species[at],
            radius: particles.radius[at],
            collided: false,
        }
    }

    pub(crate) fn position_at(&self, time: f64) -> [f64; 3] {
        std::array::from_fn(|k| self.position[k] + (time - self.time) * self.motion[k])
    }

    pub(crate) fn advance(&mut self, time: f64) {
        self.position = self.position_at(time);
        self.time = time;
    }

    pub(crate) fn displacement(&self, other: &Self, time: f64, boundary: &Boundary) -> [f64; 3] {
        let [from, to] = [self, other].map(|mover| mover.position_at(time));
        std::array::from_fn(|k| boundary.axes[k].displacement_exact(to[k] - from[k]))
    }

    pub(crate) fn contact_distance(&self, other: &Self) -> f64 {
        f64::from(self.radius) + f64::from(other.radius)
    }

    /// Negative for an overlap.
    pub(crate) fn gap(&self, other: &Self, time: f64, boundary: &Boundary) -> f64 {
        length(self.displacement(other, time, boundary)) - self.contact_distance(other)
    }

    pub(crate) fn finish_flight(&self, flight: &mut Flight, domain: &Boundary) {
        let end = self.position.map(|c| c as f32);
        let after = domain.confine(end);
        let end = std::array::from_fn(|k| match domain.axes[k] {
            Axis::Periodic { .. } => end[k],
            _ => after[k],
        });
        flight.path = Path { end, after, ..flight.path };
        if flight.path.diffusion == 0.0 {
            flight.path.drift = std::array::from_fn(|k| end[k] - flight.path.before[k]);
            flight.path.free = end;
        }
        flight.velocity = self.velocity.map(|v| v as f32);
    }
}

pub(crate) fn length(a: [f64; 3]) -> f64 {
    dot(a, a).sqrt()
}
