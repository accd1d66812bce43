//! What is simulated, in plain data. Lengths are in µm and times in s throughout; any other consistent pair of
//! units serves as well.

use crate::Error;
use crate::boundary::Boundary;
use crate::receiver::Receiver;
use crate::transmitter::{Shape, Transmitter};

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
    /// What happens to overlapping particles that do not react.
    pub contact: Contact,
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
    /// Standard deviation of each component of the velocity at release, in µm/s. Where it is 0 for all species,
    /// particles carry no velocity.
    pub thermal_speed: f64,
}

/// Two particles that come within a distance of each other react.
///
/// Products take the places and the ids of their reactants, in order. A reactant that comes out as the species it
/// was is not used up: it stays where it is and may meet several partners in one step.
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
    /// Of each candidate pair in each step.
    pub probability: f64,
}

/// A particle that turns into another or into nothing by itself.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Decay {
    /// How it is named in output, as in `A -> B`.
    pub name: String,
    /// What decays.
    pub reactant: u32,
    /// What becomes of it.
    pub product: Option<u32>,
    /// In 1/s.
    pub rate: f64,
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
    /// Whether particles carry velocities.
    pub fn has_velocity(&self) -> bool {
        self.species.iter().any(|species| species.thermal_speed > 0.0)
    }

    /// √(2DΔt), the standard deviation of a step along each axis, in µm.
    pub fn step_length(&self, species: u32) -> f64 {
        (2.0 * self.species[species as usize].diffusion * self.time_step).sqrt()
    }

    /// By species: where their centres may be.
    pub(crate) fn rooms(&self) -> Vec<Boundary> {
        self.species.iter().map(|species| self.boundary.inset(species.radius)).collect()
    }

    /// What is wrong where particles of a species have no room between the walls.
    pub(crate) fn misfit(&self, species: &Species) -> Option<String> {
        let (axis, apart) = self.boundary.too_narrow(species.radius)?;
        Some(format!(
            "species {} has the radius {}, and the walls are {apart} apart along {axis}, too close for it; make the \
             radius less than half of that, or the box larger",
            species.name, species.radius
        ))
    }

    /// What is wrong where particles are to bounce off each other and have no velocity to do so.
    pub(crate) fn idle_contact(&self) -> Option<String> {
        (self.contact == Contact::Elastic && !self.has_velocity()).then(|| {
            "contact is elastic but no species has a thermal-speed, so that nothing has a velocity to bounce with; give \
             a species a thermal-speed, or let contact = \"separate\" push diffusing ones apart"
                .to_owned()
        })
    }

    /// Checks what is needed for a run to make sense.
    ///
    /// # Errors
    /// [`Error::Model`], naming the first thing that is wrong.
    pub fn check(&self) -> Result<(), Error> {
        let positive = |what: &str, value: f64| match value.is_finite() && value > 0.0 {
            true => Ok(()),
            false => Err(Error::Model(format!("{what} is {value}; it must be positive and finite"))),
        };
        let not_negative = |what: &str, value: f64| match value.is_finite() && value >= 0.0 {
            true => Ok(()),
            false => Err(Error::Model(format!("{what} is {value}; it must be finite and not negative"))),
        };
        positive("the time step", self.time_step)?;
        for species in &self.species {
            let of = |what: &str| format!("{what} of species {}", species.name);
            not_negative(&of("the radius"), species.radius.into())?;
            not_negative(&of("the diffusion coefficient"), species.diffusion)?;
            not_negative(&of("the thermal speed"), species.thermal_speed)?;
            positive(&of("the mass"), species.mass)?;
            if !species.drift.iter().all(|v| v.is_finite()) {
                return Err(Error::Model(of("the drift") + " must be finite"));
            }
            if let Some(message) = self.misfit(species) {
                return Err(Error::Model(message));
            }
        }
        if let Some(message) = self.idle_contact() {
            return Err(Error::Model(message));
        }
        for reaction in &self.reactions {
            let of = |what: &str| format!("{what} of {}", reaction.name);
            not_negative(&of("the binding radius"), reaction.binding_radius.into())?;
            not_negative(&of("the unbinding radius"), reaction.unbinding_radius.into())?;
            not_negative(&of("the probability"), reaction.probability)?;
            if reaction.probability > 1.0 {
                return Err(Error::Model(of("the probability") + " is above 1"));
            }
            let named = reaction.reactants.into_iter().chain(reaction.products.into_iter().flatten());
            self.check_species(&reaction.name, named)?;
            if reaction.reactants.map(Some) == reaction.products {
                return Err(Error::Model(format!("{} changes nothing; remove it", reaction.name)));
            }
        }
        for decay in &self.decays {
            not_negative(&format!("the rate of {}", decay.name), decay.rate)?;
            self.check_species(&decay.name, [decay.reactant].into_iter().chain(decay.product))?;
        }
        for transmitter in &self.transmitters {
            self.check_species(&transmitter.name, transmitter.release.iter().map(|&(species, _)| species))?;
            if matches!(transmitter.shape, Shape::Lattice(_, places) if places.contains(&0)) {
                return Err(Error::Model(format!(
                    "the lattice of {} has no places along an axis",
                    transmitter.name
                )));
            }
        }
        for receiver in &self.receivers {
            if receiver.sees.len() != self.species.len() {
                let (name, known) = (&receiver.name, self.species.len());
                let message = format!(
                    "{name} says of {} species whether it sees them, of {known}",
                    receiver.sees.len()
                );
                return Err(Error::Model(message));
            }
        }
        self.check_pairs()
    }

    fn check_species(&self, of: &str, species: impl IntoIterator<Item = u32>) -> Result<(), Error> {
        let count = self.species.len();
        match species.into_iter().find(|&s| s as usize >= count) {
            None => Ok(()),
            Some(s) => Err(Error::Model(format!("{of} names species {s} but there are {count}"))),
        }
    }

    /// One reaction for each pair of species, so that a candidate pair has one outcome.
    fn check_pairs(&self) -> Result<(), Error> {
        let unordered = |reaction: &Reaction| {
            let [a, b] = reaction.reactants;
            [a.min(b), a.max(b)]
        };
        for (k, second) in self.reactions.iter().enumerate() {
            if let Some(first) = self.reactions[..k].iter().find(|r| unordered(r) == unordered(second)) {
                let (a, b) = (&first.name, &second.name);
                return Err(Error::Model(format!("{a} and {b} have the same reactants; keep one")));
            }
        }
        Ok(())
    }
}
