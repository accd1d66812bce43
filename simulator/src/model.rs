//! What is simulated, in plain data. Lengths are in µm and times in s throughout; any other consistent pair of
//! units serves as well.

use crate::boundary::Boundary;
use crate::receiver::Receiver;
use crate::transmitter::Transmitter;

/// Everything that a run is about but its seed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Model {
    /// Δt in s.
    pub time_step: f64,
    /// The kinds of particles; elsewhere named by their place here.
    pub species: Vec<Species>,
    /// Reactions of two particles.
    pub reactions: Vec<Reaction>,
    /// Reactions of one.
    pub decays: Vec<Decay>,
    /// Where particles come from.
    pub transmitters: Vec<Transmitter>,
    /// Where they are counted.
    pub receivers: Vec<Receiver>,
    /// Where they may be.
    pub boundary: Boundary,
    /// What carries them all along.
    pub flow: Option<Flow>,
    /// What happens to overlapping particles that do not react.
    pub contact: Contact,
    /// Whether each arrival at a receiver is kept, with the transmitter that the particle is from.
    pub logs_arrivals: bool,
}

/// A kind of particle.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Species {
    /// Its name.
    pub name: String,
    /// Radius in µm.
    pub radius: f32,
    /// Diffusion coefficient in µm²/s.
    pub diffusion: f64,
    /// Drift velocity in µm/s.
    pub drift: [f64; 3],
    /// Mass; only ratios matter. Used by elastic contact.
    pub mass: f64,
    /// Standard deviation of each component of the velocity at release, in µm/s.
    pub thermal_speed: f64,
    /// The speed at which a swimmer runs, in µm/s, straight on but for walls and tumbling.
    pub speed: f64,
    /// How often a swimmer turns into a random direction, in 1/s.
    pub tumble_rate: f64,
}

impl Species {
    /// Whether these particles have a velocity of their own.
    pub fn has_velocity(&self) -> bool {
        self.thermal_speed > 0.0 || self.speed > 0.0
    }
}

/// A flow that carries particles along.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Flow {
    /// Everywhere the same, in µm/s.
    Plug([f64; 3]),
    /// Along a vessel, with this mean in µm/s: twice that in the middle, nothing at the wall, v(r) = 2v(1 − r²/R²).
    Poiseuille {
        /// The mean over the cross-section.
        mean: f64,
    },
}

/// Two particles that come within a distance of each other react.
///
/// Products take the places and the ids of their reactants, in order. A reactant that comes out as the species it
/// was is not used up: it stays where it is and may meet several partners in one step.
///
/// Several reactions of the same reactants are channels: a pair takes one of those in whose binding radius it is, or
/// none, with the chances that they have.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reaction {
    /// How it is named in output, as in `A + B -> C`.
    pub name: String,
    /// What reacts; may be twice the same.
    pub reactants: [u32; 2],
    /// What becomes of each.
    pub products: [Option<u32>; 2],
    /// Centres at most this far apart, in µm.
    pub binding_radius: f32,
    /// How far apart two products are placed, in µm.
    pub unbinding_radius: f32,
    /// How soon a candidate pair reacts.
    pub chance: Chance,
}

/// How soon a pair reacts whose centres are within the binding radius.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Chance {
    /// With this probability in each step, whatever its length.
    PerStep(f64),
    /// At this rate, in 1/s: with probability 1 − exp(−λΔt) in a step, if nothing else can happen to it.
    PerTime(f64),
}

impl Default for Chance {
    fn default() -> Self {
        Self::PerStep(1.0)
    }
}

/// A particle that turns into others or into nothing by itself.
///
/// The first product takes the place and the id of the particle, the second one gets an id of its own.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Decay {
    /// How it is named in output, as in `A -> B`.
    pub name: String,
    /// What decays.
    pub reactant: u32,
    /// What becomes of it; a second product comes with a first.
    pub products: [Option<u32>; 2],
    /// Where two products appear.
    pub unbinding: Unbinding,
    /// In 1/s.
    pub rate: f64,
}

impl Decay {
    /// Whether two particles come of one.
    pub fn splits(&self) -> bool {
        self.products[1].is_some()
    }
}

/// Where two products of one particle appear: in a random direction from each other, the one that diffuses faster
/// further from where the particle was.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unbinding {
    /// This far apart, in µm.
    Apart(f32),
    /// With a distance vector that is uniform in a ball of this radius, in µm: the inverse of a reaction that happens
    /// anywhere within it.
    Within(f32),
}

impl Default for Unbinding {
    fn default() -> Self {
        Self::Apart(0.0)
    }
}

/// What happens to particles that overlap and do not react.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Contact {
    /// Nothing, and nobody looks.
    #[default]
    Ignore,
    /// They are counted.
    Count,
    /// They are pushed apart, as far as they overlapped.
    Separate,
    /// Those that approach each other exchange momentum as smooth elastic spheres.
    Elastic,
}

impl Model {
    /// Whether particles carry velocities: where some species has one.
    pub fn has_velocity(&self) -> bool {
        self.species.iter().any(Species::has_velocity)
    }

    /// √(2DΔt), the standard deviation of a step along each axis, in µm.
    pub fn step_length(&self, species: u32) -> f64 {
        (2.0 * self.species[species as usize].diffusion * self.time_step).sqrt()
    }

    /// How fast the flow is at a point, in µm/s.
    pub fn flow_at(&self, point: [f32; 3]) -> [f64; 3] {
        match (self.flow, &self.boundary.vessel) {
            (Some(Flow::Plug(velocity)), _) => velocity,
            (Some(Flow::Poiseuille { mean }), Some(vessel)) => {
                let part = (vessel.distance(point) / f64::from(vessel.radius)).min(1.0);
                let speed = 2.0 * mean * (1.0 - part * part);
                std::array::from_fn(|k| if k == vessel.along { speed } else { 0.0 })
            }
            _ => [0.0; 3],
        }
    }

    /// Whether some decay of a species gives two particles.
    pub(crate) fn comes_apart(&self, species: u32) -> bool {
        self.decays.iter().any(|decay| decay.reactant == species && decay.splits())
    }

    /// How much of the way between two particles is the first one's: the one that diffuses faster moves further.
    pub(crate) fn share(&self, [a, b]: [u32; 2]) -> f32 {
        let [a, b] = [a, b].map(|species| self.species[species as usize].diffusion);
        if a + b > 0.0 { (a / (a + b)) as f32 } else { 0.5 }
    }

    /// By species: where their centres may be.
    pub(crate) fn rooms(&self) -> Vec<Boundary> {
        self.species.iter().map(|species| self.boundary.inset(species.radius)).collect()
    }
}
