//! The model as plain data. Lengths are in µm and times in s, or any other consistent pair of units.

pub mod boundary;
pub mod chemotaxis;
pub(crate) mod decay_chain;
pub mod flow_field;
pub mod membrane;
pub mod message;
pub mod particles;
pub(crate) mod probability;
pub(crate) mod reactive_pairs;
pub mod receiver;
pub mod receptors;
pub mod time;
pub mod transmitter;
pub mod vessel;

mod dimensions;
mod duplicates;
mod validate;

use std::sync::Arc;

use crate::model::boundary::Boundary;
use crate::model::chemotaxis::{Attractant, Chemotaxis};
use crate::model::flow_field::FlowField;
use crate::model::membrane::Membrane;
use crate::model::receiver::Receiver;
use crate::model::transmitter::Transmitter;
use crate::random::gaussian::{direction, normals};

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Model {
    pub time_step: f64,
    /// Other fields refer to a species by its index.
    pub species: Vec<Species>,
    pub attractants: Vec<Attractant>,
    pub reactions: Vec<Reaction>,
    pub decays: Vec<Decay>,
    pub transmitters: Vec<Transmitter>,
    pub receivers: Vec<Receiver>,
    pub membranes: Vec<Membrane>,
    pub boundary: Boundary,
    pub flow: Option<Flow>,
    /// Begin and end of the flow, in s; `None` if it is always on.
    pub flow_pulse: Option<[f64; 2]>,
    pub contact: Contact,
    pub logs_arrivals: bool,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Species {
    pub name: String,
    /// In µm.
    pub radius: f32,
    /// Diffusion coefficient D, in µm²/s.
    pub diffusion: f64,
    /// In µm/s.
    pub drift: [f64; 3],
    /// For elastic contact; only ratios matter.
    pub mass: f64,
    /// Standard deviation of each velocity component at release, in µm/s.
    pub thermal_speed: f64,
    /// Run speed of a swimmer, in µm/s.
    pub speed: f64,
    /// Rate at which a swimmer takes a random direction, in 1/s.
    pub tumble_rate: f64,
    pub chemotaxis: Option<Chemotaxis>,
}

impl Default for Species {
    fn default() -> Self {
        Self {
            name: String::new(),
            radius: 0.0,
            diffusion: 0.0,
            drift: [0.0; 3],
            mass: 1.0,
            thermal_speed: 0.0,
            speed: 0.0,
            tumble_rate: 0.0,
            chemotaxis: None,
        }
    }
}

impl Species {
    pub fn has_velocity(&self) -> bool {
        self.thermal_speed > 0.0 || self.speed > 0.0
    }
}

#[derive(Clone, Debug, PartialEq)]
pub enum Flow {
    /// Uniform velocity, in µm/s.
    Plug([f64; 3]),
    /// Parabolic profile along a cylinder: v(r) = 2v(1 − r²/R²), with the mean v.
    Poiseuille {
        mean: f64,
    },
    Field(Arc<FlowField>),
}

/// A reaction of two particles within the binding radius.
///
/// Products take the ids of their reactants, in order. A reactant that is its own product keeps its position and may
/// react with several partners in one step. The other product then stays where its reactant was, or appears at the
/// unbinding radius from this catalyst. Products of two consumed reactants appear where these meet.
///
/// A pair undergoes at most one reaction per step, by the probabilities of those whose binding radius contains it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reaction {
    pub name: String,
    pub reactants: [u32; 2],
    /// `None` removes the reactant.
    pub products: [Option<u32>; 2],
    /// Largest center distance of a reacting pair, in µm.
    pub binding_radius: f32,
    /// Distance of two products, in µm.
    pub unbinding_radius: f32,
    pub chance: ReactionRate,
}

impl Reaction {
    pub(crate) fn separates(&self) -> bool {
        self.unbinding_radius > 0.0 && self.products.iter().all(Option::is_some)
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ReactionRate {
    /// Probability per step.
    PerStep(f64),
    /// Rate λ in 1/s: a probability of 1 − exp(−λΔt) per step without competing events.
    PerTime(f64),
}

impl Default for ReactionRate {
    fn default() -> Self {
        Self::PerStep(1.0)
    }
}

/// A unimolecular reaction into up to two products.
///
/// The first product takes the reactant's id, and a single product its position. A second product gets a new id.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Decay {
    pub name: String,
    pub reactant: u32,
    /// A second product requires a first.
    pub products: [Option<u32>; 2],
    pub unbinding: Unbinding,
    /// In 1/s.
    pub rate: f64,
}

impl Decay {
    pub fn splits(&self) -> bool {
        self.products[1].is_some()
    }
}

/// The distance of two products, which go in opposite random directions from the reactant, the faster one further.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unbinding {
    /// At this distance, in µm.
    Apart(f32),
    /// Uniform in a ball of this radius, in µm: the inverse of a reaction that is equally likely anywhere in it.
    Within(f32),
}

impl Default for Unbinding {
    fn default() -> Self {
        Self::Apart(0.0)
    }
}

/// Treatment of overlapping particles that do not react.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Contact {
    /// Neither searched nor resolved.
    #[default]
    Ignore,
    Count,
    /// Hard diffusing spheres collide on their paths; remaining overlaps are separated.
    Separate,
    /// Smooth elastic spheres collide on their paths and exchange momentum.
    Elastic,
}

impl Contact {
    pub(crate) fn collides(self) -> bool {
        matches!(self, Self::Separate | Self::Elastic)
    }
}

pub(crate) fn sorted([a, b]: [u32; 2]) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

/// Returns `true` if two surfaces see a common species.
pub(crate) fn share_species(a: &[bool], b: &[bool]) -> bool {
    a.iter().zip(b).any(|(a, b)| *a && *b)
}

impl Model {
    pub fn has_velocity(&self) -> bool {
        self.species.iter().any(Species::has_velocity)
    }

    /// Returns √(2DΔt) in µm.
    pub fn step_length(&self, species: u32) -> f64 {
        (2.0 * self.species[species as usize].diffusion * self.time_step).sqrt()
    }

    /// Returns the fraction of an interval, in s, with flow.
    pub(crate) fn flow_fraction(&self, [begin, end]: [f64; 2]) -> f64 {
        let Some([from, until]) = self.flow_pulse else { return 1.0 };
        // An interval below the rounding of its ends has no length.
        if end <= begin {
            return if (from..until).contains(&begin) { 1.0 } else { 0.0 };
        }
        ((end.min(until) - begin.max(from)) / (end - begin)).clamp(0.0, 1.0)
    }

    pub(crate) fn flow_fraction_of_step(&self, step: u32) -> f64 {
        self.flow_fraction([0.0, 1.0].map(|later| (f64::from(step) + later) * self.time_step))
    }

    /// Returns a velocity in µm/s.
    pub fn flow_at(&self, point: [f32; 3]) -> [f64; 3] {
        match (&self.flow, &self.boundary.vessel) {
            (Some(Flow::Plug(velocity)), _) => *velocity,
            (Some(Flow::Field(field)), _) => field.at(self.boundary.confine(point)),
            (Some(Flow::Poiseuille { mean }), Some(vessel)) => {
                let radius_fraction = (vessel.distance(point) / f64::from(vessel.radius)).min(1.0);
                let speed = 2.0 * mean * (1.0 - radius_fraction * radius_fraction);
                std::array::from_fn(|k| if Some(k) == vessel.along { speed } else { 0.0 })
            }
            _ => [0.0; 3],
        }
    }

    pub fn flow_field(&self) -> Option<&Arc<FlowField>> {
        match &self.flow {
            Some(Flow::Field(field)) => Some(field),
            _ => None,
        }
    }

    pub(crate) fn own_velocity(&self, species: u32, words: [u32; 4]) -> [f32; 3] {
        let Species { speed, thermal_speed, .. } = self.species[species as usize];
        match speed > 0.0 {
            true => self.boundary.direction_within(direction(words[0], words[1])).map(|c| c * speed as f32),
            false => self.boundary.flattened(normals(words)).map(|z| z * thermal_speed as f32),
        }
    }

    /// Scales the velocity between two speeds of swimmers, or two thermal speeds. Otherwise redraws it: 0 for a species
    /// without any.
    pub(crate) fn converted_velocity(
        &self,
        velocity: [f32; 3],
        [from, to]: [u32; 2],
        words: impl FnOnce() -> [u32; 4],
    ) -> [f32; 3] {
        let [old, new] = [from, to].map(|species| &self.species[species as usize]);
        if old.speed == new.speed && old.thermal_speed == new.thermal_speed {
            velocity
        } else if old.speed > 0.0 && new.speed > 0.0 {
            velocity.map(|v| v * (new.speed / old.speed) as f32)
        } else if old.thermal_speed > 0.0 && new.thermal_speed > 0.0 {
            velocity.map(|v| v * (new.thermal_speed / old.thermal_speed) as f32)
        } else {
            self.own_velocity(to, words())
        }
    }

    /// Returns flags by species.
    pub(crate) fn dissociating(&self) -> Vec<bool> {
        let mut dissociates = vec![false; self.species.len()];
        for decay in self.decays.iter().filter(|decay| decay.splits()) {
            dissociates[decay.reactant as usize] = true;
        }
        dissociates
    }

    pub(crate) fn dissociates(&self, species: u32) -> bool {
        self.decays.iter().any(|decay| decay.reactant == species && decay.splits())
    }

    pub(crate) fn forms_dissociating(&self) -> bool {
        let alone = self.decays.iter().filter(|decay| !self.dissociates(decay.reactant));
        alone.filter_map(|decay| decay.products[0]).any(|product| self.dissociates(product))
    }

    /// Returns the fraction of a displacement that the first species takes, in proportion to diffusion.
    pub(crate) fn first_fraction(&self, [a, b]: [u32; 2]) -> f32 {
        let [a, b] = [a, b].map(|species| self.species[species as usize].diffusion);
        if a + b > 0.0 { (a / (a + b)) as f32 } else { 0.5 }
    }

    pub(crate) fn center_domains(&self) -> Vec<Boundary> {
        self.species.iter().map(|species| self.boundary.inset(species.radius)).collect()
    }
}
