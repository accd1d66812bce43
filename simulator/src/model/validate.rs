use lazygrid_io::excerpt;

use crate::Error;
use crate::model::boundary::{Axis, Boundary};
use crate::model::decay_chain::faulty_chain;
use crate::model::message::Symbols;
use crate::model::probability::ReactionProbabilities;
use crate::model::receiver::{Adsorption, Receiver, ReceiverKind, WallFace};
use crate::model::time::longest_step;
use crate::model::transmitter::{Schedule, Shape, Transmitter};
use crate::model::{Contact, Decay, Flow, Model, Reaction, ReactionRate, Species, Unbinding};

/// Entries of bursts that follow the first one of their transmitter in a step: about 100 MB.
const MAX_REPEATED_ENTRIES: u64 = 1 << 20;

impl Model {
    pub(crate) fn misfit(&self, species: &Species) -> Option<String> {
        self.misfit_between_walls(species).or_else(|| self.misfit_in_period(species))
    }

    /// Colliding spheres must be able to touch their nearest images only.
    fn misfit_in_period(&self, species: &Species) -> Option<String> {
        let period = self.boundary.shortest_period().filter(|_| self.contact.collides())?;
        (4.0 * species.radius > period).then(|| {
            format!(
                "species {} has the radius {} µm, and particles collide in a periodic box that is {period} µm long; make the \
                 radius at most a quarter of that, or the box longer",
                species.name, species.radius
            )
        })
    }

    fn misfit_between_walls(&self, species: &Species) -> Option<String> {
        let (walls, wide) = self.boundary.too_narrow(species.radius)?;
        Some(format!(
            "species {} has the radius {} µm, but the walls {walls} are {wide} µm apart; make the radius less than half of \
             that, or move the walls apart",
            species.name, species.radius
        ))
    }

    pub(crate) fn idle_contact(&self) -> Option<String> {
        (self.contact == Contact::Elastic && !self.has_velocity()).then(|| {
            "contact is elastic but no species has a thermal-speed or speed, so no particle has a velocity; give a species a \
             thermal-speed, or set contact = \"separate\" for diffusing particles"
                .to_owned()
        })
    }

    pub(crate) fn groundless_flow(&self) -> Option<String> {
        let groundless =
            matches!(self.flow, Some(Flow::Poiseuille { .. })) && self.boundary.along().is_none();
        groundless.then(|| {
            "Poiseuille flow needs a cylinder, and the boundary is not one; make the boundary a cylinder, or the flow a plug"
                .to_owned()
        })
    }

    fn check_vessel(&self) -> Result<(), Error> {
        let Some(vessel) = &self.boundary.vessel else { return Ok(()) };
        positive("the radius of the vessel", vessel.radius.into())?;
        let mut across = (0..3).filter(|&k| Some(k) != vessel.along).map(|k| self.boundary.axes[k]);
        ensure(vessel.along.is_none_or(|along| along < 3) && across.all(|axis| axis == Axis::Open), || {
            "a cylinder must be along axis 0, 1 or 2, and the axes across a cylinder or sphere must be open; remove their \
             walls or periods"
                .to_owned()
        })
    }

    /// Checks that the model can be run.
    ///
    /// # Errors
    /// [`Error::Model`] with the first fault.
    pub fn check(&self) -> Result<(), Error> {
        positive("the time step", self.time_step)?;
        refuse(self.boundary.faulty_axis())?;
        for species in &self.species {
            let name = |what: &str| format!("{what} of species {}", species.name);
            not_negative(&name("the radius"), species.radius.into())?;
            not_negative(&name("the diffusion coefficient"), species.diffusion)?;
            not_negative(&name("the thermal speed"), species.thermal_speed)?;
            not_negative(&name("the speed"), species.speed)?;
            not_negative(&name("the tumble rate"), species.tumble_rate)?;
            ensure(species.speed == 0.0 || species.thermal_speed == 0.0, || {
                name("the speed") + " and the thermal speed exclude each other; remove one"
            })?;
            positive(&name("the mass"), species.mass)?;
            finite(&name("the drift"), &species.drift)?;
            refuse(self.misfit(species))?;
        }
        let taxis = (0..self.species.len()).find_map(|species| self.faulty_chemotaxis(species));
        refuse(self.faulty_attractant().map(|(_, message)| message).or(taxis))?;
        refuse(self.idle_contact().or_else(|| self.groundless_flow()))?;
        refuse(self.beyond_dimensions().or_else(|| self.release_beyond_range()))?;
        self.check_flow()?;
        self.check_vessel()?;
        refuse(self.faulty_membrane().map(|(_, message)| message))?;
        self.reactions.iter().try_for_each(|reaction| self.check_reaction(reaction))?;
        self.decays.iter().try_for_each(|decay| self.check_decay(decay))?;
        refuse(faulty_chain(self).map(|(_, message)| message))?;
        self.check_channels()?;
        self.transmitters.iter().try_for_each(|transmitter| self.check_transmitter(transmitter))?;
        self.check_repeated_bursts()?;
        self.receivers.iter().try_for_each(|receiver| self.check_receiver(receiver))?;
        refuse(self.faulty_absorber().map(|(_, message)| message))
    }

    fn check_flow(&self) -> Result<(), Error> {
        let velocity = match self.flow {
            Some(Flow::Plug(velocity)) => velocity,
            Some(Flow::Poiseuille { mean }) => [mean; 3],
            Some(Flow::Field(_)) | None => [0.0; 3],
        };
        finite("the velocity of the flow", &velocity)?;
        let pulse = self.flow_pulse.filter(|[from, until]| !(*from >= 0.0 && from < until));
        refuse(pulse.map(|[from, until]| {
            format!("the flow is on from {from} s until {until} s; the end must be later than the beginning")
        }))
    }

    pub(crate) fn resting_before(&self, receiver: &Receiver) -> Option<String> {
        let by_rate = |species: usize| match receiver.kind {
            ReceiverKind::Partial(Adsorption::Reactivity(_)) => receiver.sees[species],
            _ => receiver.binds(species),
        };
        let rests = |(k, species): &(usize, &Species)| by_rate(*k) && species.diffusion == 0.0;
        let mut all = self.species.iter().enumerate();
        let (_, species) = all.find(rests).filter(|_| receiver.diffusion == 0.0)?;
        Some(format!(
            "{} takes particles at a rate, which needs diffusion, but {} does not diffuse; exclude it by species, or give a \
             partial receiver a probability",
            receiver.name, species.name
        ))
    }

    /// Returns the boundary of the center, or of a point if the receiver does not fit.
    pub(crate) fn domain_of(&self, receiver: &Receiver) -> Boundary {
        match self.boundary.too_narrow(receiver.radius) {
            None => self.boundary.inset(receiver.radius),
            Some(_) => self.boundary,
        }
    }

    pub(crate) fn overlaps_wall(&self, receiver: &Receiver) -> Option<String> {
        let is_beyond = !self.domain_of(receiver).is_inside_walls(receiver.center);
        (receiver.moves() && is_beyond).then(|| {
            format!(
                "{} moves, and walls reflect its surface, but it begins at {:?} with the radius {} and overlaps a wall; move it \
                 inside, or let it rest",
                receiver.name, receiver.center, receiver.radius
            )
        })
    }

    /// Colliding particles cannot meet absorbing walls, which see only the ends of paths.
    pub(crate) fn missing_wall(&self, name: &str, face: WallFace) -> Option<String> {
        if self.contact.collides() {
            return Some(format!(
                "{name} is a wall that absorbs, which contact = \"separate\" or \"elastic\" does not support; set contact = \
                 \"count\""
            ));
        }
        let is_there = match face {
            WallFace::Low(axis) | WallFace::High(axis) => {
                self.boundary.axes.get(axis).is_some_and(|axis| matches!(axis, Axis::Reflecting { .. }))
            }
            WallFace::Side => self.boundary.vessel.is_some(),
        };
        (!is_there).then(|| {
            format!(
                "{name} is a wall that the boundary does not have; a reflecting box has low-x to high-z, a cylinder or sphere has \
                 side, and a cylinder low and high along its axis if it has reflecting ends"
            )
        })
    }

    fn check_receiver(&self, receiver: &Receiver) -> Result<(), Error> {
        let name = |what: &str| format!("{what} of {}", receiver.name);
        let (known, says) = (self.species.len(), receiver.sees.len());
        ensure(says == known, || {
            format!("{} has flags for {says} species of {known}; give one for each", receiver.name)
        })?;
        not_negative(&name("the diffusion coefficient"), receiver.diffusion)?;
        not_negative(&name("the surface diffusion"), receiver.surface_diffusion)?;
        ensure(receiver.surface_diffusion == 0.0 || !receiver.receptor_types().is_empty(), || {
            name("the surface diffusion") + " moves bound particles; give it receptors, or set 0"
        })?;
        finite(&name("the velocity"), &receiver.velocity)?;
        finite(&name("the center"), &receiver.center.map(f64::from))?;
        not_negative(&name("the radius"), receiver.radius.into())?;
        match receiver.kind {
            ReceiverKind::Partial(Adsorption::PerStep(probability)) => {
                is_probability(&name("the probability"), probability)?
            }
            ReceiverKind::Partial(Adsorption::Reactivity(rate)) => not_negative(&name("the rate"), rate)?,
            ReceiverKind::Wall(face) => refuse(self.missing_wall(&receiver.name, face))?,
            _ => {}
        }
        self.check_receptors(receiver)?;
        if receiver.reflects_some() {
            positive(&name("the radius"), receiver.radius.into())?;
        }
        refuse(self.resting_before(receiver).or_else(|| self.overlaps_wall(receiver)))
    }

    fn check_receptors(&self, receiver: &Receiver) -> Result<(), Error> {
        let name = &receiver.name;
        for kind in receiver.receptor_types() {
            self.check_species(name, kind.ligands.iter().map(|ligand| ligand.species))?;
            for (k, ligand) in kind.ligands.iter().enumerate() {
                not_negative(&format!("the binding rate of {name}"), ligand.binding_rate)?;
                not_negative(&format!("the unbinding rate of {name}"), ligand.unbinding_rate)?;
                let species = &self.species[ligand.species as usize].name;
                ensure(receiver.sees[ligand.species as usize], || {
                    format!(
                        "receptors of {name} bind {species}, which {name} does not see; let it see {species}"
                    )
                })?;
                ensure(kind.ligands[..k].iter().all(|other| other.species != ligand.species), || {
                    format!("receptors of {name} have two rates for {species}; give them one")
                })?;
            }
        }
        Ok(())
    }

    fn check_reaction(&self, reaction: &Reaction) -> Result<(), Error> {
        let name = |what: &str| format!("{what} of {}", reaction.name);
        not_negative(&name("the binding radius"), reaction.binding_radius.into())?;
        not_negative(&name("the unbinding radius"), reaction.unbinding_radius.into())?;
        match reaction.chance {
            ReactionRate::PerTime(rate) => not_negative(&name("the rate inside"), rate)?,
            ReactionRate::PerStep(probability) => is_probability(&name("the probability"), probability)?,
        }
        let named = reaction.reactants.into_iter().chain(reaction.products.into_iter().flatten());
        self.check_species(&reaction.name, named)?;
        let changes = reaction.reactants.map(Some) != reaction.products;
        ensure(changes, || format!("{} changes nothing; remove it", reaction.name))
    }

    fn check_decay(&self, decay: &Decay) -> Result<(), Error> {
        let name = |what: &str| format!("{what} of {}", decay.name);
        not_negative(&name("the rate"), decay.rate)?;
        let (Unbinding::Apart(radius) | Unbinding::Within(radius)) = decay.unbinding;
        not_negative(&name("the unbinding radius"), radius.into())?;
        ensure(decay.products[0].is_some() || !decay.splits(), || {
            name("the second product") + " comes without a first; make it the first"
        })?;
        self.check_species(&decay.name, [Some(decay.reactant)].into_iter().chain(decay.products).flatten())
    }

    fn check_channels(&self) -> Result<(), Error> {
        let Some((total, indices)) = self.excessive_probability() else { return Ok(()) };
        let names = indices.iter().map(|&index| self.reactions[index].name.as_str());
        let names = names.collect::<Vec<_>>().join(" and of ");
        // Probabilities per step do not depend on the time step.
        let fits = |time_step: f64| Self { time_step, ..self.clone() }.excessive_probability().is_none();
        let remedy = match fits(0.0) {
            false => "lower them".to_owned(),
            true => {
                let longest = longest_step(self.time_step, fits);
                format!("lower them, or set time-step to {longest:.2e} or less")
            }
        };
        Err(Error::Model(format!(
            "the probabilities of {} add up to {} in a step, more than the limit of 1; {remedy}",
            excerpt(names.as_bytes()),
            (1e6 * total).round() / 1e6
        )))
    }

    /// Returns the sum of the first probabilities above 1, and their reactions.
    fn excessive_probability(&self) -> Option<(f64, Vec<usize>)> {
        let chances = ReactionProbabilities(self);
        let mut shells = chances.pairs().flat_map(|pair| chances.shells(pair));
        shells.find_map(|shell| {
            let total: f64 = shell.channels.iter().map(|(_, probability)| probability).sum();
            let indices = || shell.channels.iter().map(|&(index, _)| index).collect();
            (total > 1.0 + 1e-9).then(|| (total, indices()))
        })
    }

    fn check_transmitter(&self, transmitter: &Transmitter) -> Result<(), Error> {
        let name = &transmitter.name;
        self.check_species(name, transmitter.release.iter().map(|&(species, _)| species))?;
        let count = self.receivers.len();
        let unknown = transmitter.carrier.filter(|&carrier| carrier as usize >= count);
        refuse(
            unknown.map(|carrier| {
                format!("{name} moves with receiver {carrier} but there are {count} receivers")
            }),
        )?;
        let is_empty = matches!(transmitter.shape, Shape::Lattice(_, sites) if sites.contains(&0));
        ensure(!is_empty, || format!("the lattice of {name} has no places along an axis"))?;
        match &transmitter.schedule {
            Schedule::Times(times) => {
                let are_times = times.iter().all(|time| time.is_finite() && *time >= 0.0);
                ensure(are_times && times.is_sorted(), || {
                    format!("the times of {name} must be in ascending order and not negative; sort them")
                })
            }
            Schedule::Message(message) => {
                positive(&format!("the symbol time of {name}"), message.symbol_time)?;
                not_negative(&format!("the start of {name}"), message.start)?;
                refuse(message.faulty_symbol_time(name, self.time_step))?;
                let alphabet = message.modulation.alphabet(transmitter.release.len());
                let known = match &message.symbols {
                    Symbols::Given(symbols) => symbols.iter().all(|&symbol| (symbol as usize) < alphabet),
                    Symbols::Random { alphabet: m, .. } => *m as usize <= alphabet && m.is_power_of_two(),
                };
                ensure(known, || {
                    format!("{name} sends symbols that its modulation does not have; use fewer symbols")
                })
            }
            Schedule::Steady { from, until, rates } => {
                self.check_species(name, rates.iter().map(|&(species, _)| species))?;
                rates.iter().try_for_each(|&(_, rate)| positive(&format!("a rate of {name}"), rate))?;
                ensure(*from >= 0.0 && from < until, || {
                    format!(
                        "{name} releases from {from} s until {until} s; the end must be later than the beginning"
                    )
                })
            }
        }
    }

    /// Refuses many bursts in one step: each costs memory even without particles.
    fn check_repeated_bursts(&self) -> Result<(), Error> {
        let mut entries: u64 = 0;
        for transmitter in &self.transmitters {
            entries = entries.saturating_add(transmitter.repeated_entries(self.time_step));
            ensure(entries <= MAX_REPEATED_ENTRIES, || {
                format!(
                    "{} has bursts at several times within a step: after the first one they have {entries} entries of 'release', \
                     with those of earlier transmitters, and may have {MAX_REPEATED_ENTRIES}; give fewer times per step",
                    transmitter.name
                )
            })?;
        }
        Ok(())
    }

    fn check_species(&self, owner: &str, species: impl IntoIterator<Item = u32>) -> Result<(), Error> {
        let count = self.species.len();
        let unknown = species.into_iter().find(|&s| s as usize >= count);
        refuse(unknown.map(|s| format!("{owner} names species {s} but there are {count}")))
    }
}

fn refuse(fault: Option<String>) -> Result<(), Error> {
    fault.map_or(Ok(()), |message| Err(Error::Model(message)))
}

fn ensure(holds: bool, message: impl FnOnce() -> String) -> Result<(), Error> {
    refuse((!holds).then(message))
}

fn finite(what: &str, values: &[f64; 3]) -> Result<(), Error> {
    ensure(values.iter().all(|v| v.is_finite()), || format!("{what} is {values:?}; it must be finite"))
}

fn positive(what: &str, value: f64) -> Result<(), Error> {
    ensure(value.is_finite() && value > 0.0, || format!("{what} is {value}; it must be positive and finite"))
}

fn is_probability(what: &str, value: f64) -> Result<(), Error> {
    not_negative(what, value)?;
    ensure(value <= 1.0, || format!("{what} is {value}; it must be at most 1"))
}

fn not_negative(what: &str, value: f64) -> Result<(), Error> {
    ensure(value.is_finite() && value >= 0.0, || {
        format!("{what} is {value}; it must be finite and not negative")
    })
}
