//! The model of a simulation, as plain data. Lengths are in µm and times in s, or any other consistent pair of units.

pub mod boundary;
pub mod message;
pub mod particles;
pub mod receiver;
pub mod transmitter;
pub mod vessel;

mod validate;

use crate::model::boundary::Boundary;
use crate::model::receiver::Receiver;
use crate::model::transmitter::Transmitter;

/// A complete description of a run, except its seed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Model {
    /// Time step Δt, in s.
    pub time_step: f64,
    /// Species of particles. Other parts of the model refer to them by index.
    pub species: Vec<Species>,
    /// Reactions of two particles.
    pub reactions: Vec<Reaction>,
    /// Unimolecular reactions.
    pub decays: Vec<Decay>,
    /// Sources of particles.
    pub transmitters: Vec<Transmitter>,
    /// Spheres that count, absorb, bind or reflect particles.
    pub receivers: Vec<Receiver>,
    /// Walls, periodic boundaries and the vessel.
    pub boundary: Boundary,
    /// Flow that carries all particles.
    pub flow: Option<Flow>,
    /// Treatment of overlapping particles that do not react.
    pub contact: Contact,
    /// If `true`, records each arrival at a receiver, with the transmitter that released the particle.
    pub logs_arrivals: bool,
}

/// A species of particles.
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
    /// Mass. Only ratios matter, and only for elastic contact.
    pub mass: f64,
    /// Standard deviation of each component of the velocity at release, in µm/s.
    pub thermal_speed: f64,
    /// Run speed of a swimmer, in µm/s. Between tumbles and reflections it swims along a line.
    pub speed: f64,
    /// Rate at which a swimmer tumbles, that is, takes a random direction, in 1/s.
    pub tumble_rate: f64,
}

impl Species {
    /// Returns `true` if particles of this species carry a velocity.
    pub fn has_velocity(&self) -> bool {
        self.thermal_speed > 0.0 || self.speed > 0.0
    }
}

/// A flow that carries particles along.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Flow {
    /// Uniform velocity, in µm/s.
    Plug([f64; 3]),
    /// Parabolic profile along a vessel: v(r) = 2v(1 − r²/R²), with the mean v.
    Poiseuille {
        /// Mean velocity over the cross-section, in µm/s.
        mean: f64,
    },
}

/// A bimolecular reaction of two particles within the binding radius.
///
/// Products take the positions and ids of their reactants, in order. A reactant that is also its own product is not
/// consumed: it keeps its position and may react with several partners in one step.
///
/// Several reactions of the same reactants are channels. In each step, a pair undergoes at most one of the channels
/// whose binding radius contains it, according to their probabilities.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reaction {
    /// Name in output, as in `A + B -> C`.
    pub name: String,
    /// Species of the reactants; both may be the same.
    pub reactants: [u32; 2],
    /// Species of the products; `None` removes the reactant.
    pub products: [Option<u32>; 2],
    /// Largest distance between the centers at which the pair can react, in µm.
    pub binding_radius: f32,
    /// Distance at which two products are placed, in µm.
    pub unbinding_radius: f32,
    /// Probability or rate at which a pair within the binding radius reacts.
    pub chance: ReactionRate,
}

/// The probability or rate at which a pair within the binding radius reacts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ReactionRate {
    /// Probability per step, independent of the time step.
    PerStep(f64),
    /// Rate λ in 1/s: the probability per step is 1 − exp(−λΔt) if no other event competes.
    PerTime(f64),
}

impl Default for ReactionRate {
    fn default() -> Self {
        Self::PerStep(1.0)
    }
}

/// A unimolecular reaction: a particle turns into up to two products, or disappears.
///
/// The first product keeps the position and id of the reactant. The second product gets a new id.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Decay {
    /// Name in output, as in `A -> B`.
    pub name: String,
    /// Species of the reactant.
    pub reactant: u32,
    /// Species of the products. A second product requires a first.
    pub products: [Option<u32>; 2],
    /// Placement of two products.
    pub unbinding: Unbinding,
    /// Rate, in 1/s.
    pub rate: f64,
}

impl Decay {
    /// Returns `true` if the decay has two products.
    pub fn splits(&self) -> bool {
        self.products[1].is_some()
    }
}

/// The placement of two products of a decay: in opposite random directions from the reactant. The product that diffuses
/// faster is placed further away.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unbinding {
    /// At this distance, in µm.
    Apart(f32),
    /// With a distance vector uniform in a ball of this radius, in µm. This is the inverse of a reaction that is
    /// equally likely anywhere within the ball.
    Within(f32),
}

impl Default for Unbinding {
    fn default() -> Self {
        Self::Apart(0.0)
    }
}

/// The treatment of particles that overlap and do not react.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Contact {
    /// Overlaps are neither searched nor resolved.
    #[default]
    Ignore,
    /// Overlaps are counted.
    Count,
    /// Particles collide on their paths as hard spheres that diffuse, and remaining overlaps are separated.
    Separate,
    /// Particles collide on their paths and exchange momentum as smooth elastic spheres.
    Elastic,
}

impl Model {
    /// Returns `true` if some species carries a velocity.
    pub fn has_velocity(&self) -> bool {
        self.species.iter().any(Species::has_velocity)
    }

    /// Returns √(2DΔt), the standard deviation of a step along each axis, in µm.
    pub fn step_length(&self, species: u32) -> f64 {
        (2.0 * self.species[species as usize].diffusion * self.time_step).sqrt()
    }

    /// Returns the flow velocity at a point, in µm/s.
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

    pub(crate) fn dissociates(&self, species: u32) -> bool {
        self.decays.iter().any(|decay| decay.reactant == species && decay.splits())
    }

    /// Returns the first particle's fraction of the displacement between two particles, in proportion to their
    /// diffusion.
    pub(crate) fn share(&self, [a, b]: [u32; 2]) -> f32 {
        let [a, b] = [a, b].map(|species| self.species[species as usize].diffusion);
        if a + b > 0.0 { (a / (a + b)) as f32 } else { 0.5 }
    }

    pub(crate) fn center_domains(&self) -> Vec<Boundary> {
        self.species.iter().map(|species| self.boundary.inset(species.radius)).collect()
    }
}
