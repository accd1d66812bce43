//! A model as the tables that kernels read. Pure functions.

use super::layout::{EventRow, NOTHING, OccupancyRow, Params, ReactionRow, ReceptorRow, SpeciesRow};
use super::receiver_cells::MIN_LISTED_RECEIVERS;
use super::receiver_trajectory::max_rows;
use crate::model::receiver::{Adsorption, ReceiverKind, Receptors};
use crate::model::{Contact, Decay, Model};
use crate::motion::propagate::{Propagator, SpeciesStep};
use crate::motion::{adsorption, path_hit};
use crate::random::philox::Key;
use crate::reaction::Reactions;
use crate::{Axis, Boundary, Error, Receiver};

/// The tables of a model.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Tables {
    pub(super) params: Params,
    pub(super) species_rows: Vec<SpeciesRow>,
    pub(super) event_rows: Vec<EventRow>,
    pub(super) occupancy_rows: Vec<OccupancyRow>,
    /// Indexed by receiver; empty if no receiver has receptors.
    pub(super) receptors: Vec<ReceptorRow>,
    /// `true` if some surfaces reflect particles.
    pub(super) reflects: bool,
    /// The most rows of the table of positions of receivers.
    pub(super) receiver_rows: usize,
    pub(super) reaction_rows: Vec<ReactionRow>,
    pub(super) tallies: Tallies,
}

/// The layout of tallies: arrivals by receiver and species, then decays, then reactions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Tallies {
    pub(super) species: usize,
    pub(super) receivers: usize,
    pub(super) decays: usize,
    pub(super) reactions: usize,
}

impl Tallies {
    pub(super) fn arrival(&self, receiver: usize, species: usize) -> usize {
        receiver * self.species + species
    }

    pub(super) fn decay(&self, decay: usize) -> usize {
        self.receivers * self.species + decay
    }

    pub(super) fn reaction(&self, reaction: usize) -> usize {
        self.decay(self.decays) + reaction
    }

    pub(super) fn len(&self) -> usize {
        self.reaction(self.reactions)
    }
}

/// The part of a lifetime that a step may take where a particle decays once in a step at most.
const MAX_CHAINED_DECAY: f64 = 0.02;

/// Refuses models without kernels.
///
/// # Errors
/// [`Error::NotOnGpu`], which names the first unsupported part.
pub(super) fn check(model: &Model) -> Result<(), Error> {
    let rejected = |what: String| Err(Error::NotOnGpu { what });
    match model.contact {
        Contact::Separate => return rejected("contact by separating overlaps".to_owned()),
        Contact::Elastic => return rejected("elastic contact".to_owned()),
        Contact::Ignore | Contact::Count => {}
    }
    if let Some(species) = model.species.iter().find(|species| species.thermal_speed > 0.0) {
        return rejected(format!("velocities, which species {} has", species.name));
    }
    if let Some(species) = model.species.iter().find(|species| species.speed > 0.0) {
        return rejected(format!("swimmers, such as {}", species.name));
    }
    if model.logs_arrivals {
        return rejected("a log of arrivals, of which it has the counts only".to_owned());
    }
    if model.boundary.vessel.is_some() {
        return rejected("a cylinder".to_owned());
    }
    if let Some(decay) = model.decays.iter().find(|decay| decay.splits()) {
        return rejected(format!("'{}', where one particle becomes two", decay.name));
    }
    let decays = |species: u32| model.decays.iter().filter(move |decay| decay.reactant == species);
    for first in &model.decays {
        // Short steps notice what decays twice in the next one.
        let is_fast = |second: &&Decay| second.rate * model.time_step > MAX_CHAINED_DECAY;
        if let Some(second) = first.products[0].and_then(|product| decays(product).find(is_fast)) {
            return rejected(format!(
                "'{}' behind '{}' in one step; time-step = {:.2e} would do",
                second.name,
                first.name,
                MAX_CHAINED_DECAY / second.rate
            ));
        }
    }
    let reactions = Reactions::new(model);
    let pairs = (0..model.species.len() as u32).flat_map(|a| (0..=a).map(move |b| [a, b]));
    for [a, b] in pairs {
        if let Err(names) = reactions.only(a, b) {
            return rejected(format!("several reactions of the same reactants ({})", names.join("; ")));
        }
    }
    check_receivers(model)?;
    let steps = Propagator::new(model).steps;
    // Others count ends of steps only, or nothing.
    let by_path = |r: &&Receiver| r.kind == ReceiverKind::Absorbing || r.kind.reflects() && r.kind.absorbs();
    let binds = |r: &&Receiver| matches!(r.kind, ReceiverKind::Receptors(_));
    for receiver in model.receivers.iter().filter(|r| by_path(r) || binds(r)) {
        let seen = (0..steps.len()).filter(|&species| receiver.sees[species]);
        let passed = |&s: &usize| drifts_past((receiver, model.time_step), &steps[s], &model.boundary);
        if let Some(species) = seen.into_iter().find(passed) {
            return rejected(format!(
                "the way of {} past receiver {}, by which its drift may carry it within a step; steps of a sixteenth \
                 of the receiver's radius would do",
                model.species[species].name, receiver.name
            ));
        }
    }
    Ok(())
}

/// The most receivers and species that one thread visits in a step, because software drivers end loops after 65,535
/// iterations.
const MAX_SEEN: usize = 60_000;
/// The same if surfaces reflect: a thread then visits receivers twice.
const MAX_SEEN_REFLECTING: usize = 25_000;
/// Loop iterations of a thread near surfaces, its additional iterations per search, and the most reflections in a step.
const REFLECTION_ITERATIONS: u32 = 60_000;
const ITERATIONS_PER_SEARCH: u32 = 1_100;
const BOUNCES: u32 = 64;

/// Returns the most searches for surfaces by a particle in a step. A particle searches again if moving surfaces pushed it
/// beyond the region of the search. Each search, and the test of absorbing receivers, visits all receivers of a species.
fn max_requeries(species_rows: &[SpeciesRow]) -> u32 {
    let most = species_rows.iter().map(|kind| kind.decays_begin - kind.events_begin).max().unwrap_or(0);
    (REFLECTION_ITERATIONS.saturating_sub(most + ITERATIONS_PER_SEARCH) / (most + ITERATIONS_PER_SEARCH))
        .clamp(1, BOUNCES)
}

fn check_receivers(model: &Model) -> Result<(), Error> {
    let seen: usize = model.receivers.iter().map(|r| r.sees.iter().filter(|sees| **sees).count()).sum();
    let reflects = model.receivers.iter().any(|receiver| receiver.kind.reflects());
    let most = if reflects { MAX_SEEN_REFLECTING } else { MAX_SEEN };
    // Receptors take one workgroup per receiver.
    let max_requeries = seen.max(model.receivers.len());
    match max_requeries > most {
        true => Err(Error::NotOnGpu {
            what: format!(
                "so many receivers, at all of which each particle max_requeries: {max_requeries} counts of a receiver and a species, \
                 beyond {most}"
            ),
        }),
        false => Ok(()),
    }
}

/// Returns `true` if the ends of a step do not decide whether a receiver was hit: drift may carry a diffusing particle past
/// it, and a straight path may involve a wall or another image of the receiver.
fn drifts_past((receiver, time_step): (&Receiver, f64), step: &SpeciesStep, boundary: &Boundary) -> bool {
    let own = receiver.velocity.map(|v| (v * time_step) as f32);
    let drift: [f32; 3] = std::array::from_fn(|k| step.drift[k] - own[k]);
    let diffusion = step.diffusion + (receiver.diffusion * time_step) as f32;
    if diffusion > 0.0 {
        let length = drift.iter().map(|d| d * d).sum::<f32>().sqrt();
        return path_hit::is_long(length, (2.0 * diffusion).sqrt(), receiver.radius);
    }
    (0..3).filter(|&k| drift[k] != 0.0).any(|k| {
        let (center, reach) = (receiver.center[k], receiver.radius + step.drift[k].abs());
        match boundary.axes[k] {
            Axis::Open => false,
            Axis::Reflecting { .. } if step.drift[k] == 0.0 => false,
            // A moving receiver reaches a wall eventually.
            Axis::Reflecting { .. } if own[k] != 0.0 => true,
            Axis::Reflecting { low, high } => center - reach < low || center + reach > high,
            Axis::Periodic { low, high } => 2.0 * (receiver.radius + drift[k].abs()) > high - low,
        }
    })
}

impl Tables {
    /// Returns the tables of a valid model.
    pub(super) fn new(model: &Model, key: Key, max_iterations: u32) -> Self {
        let tallies = Tallies {
            species: model.species.len(),
            receivers: model.receivers.len(),
            decays: model.decays.len(),
            reactions: model.reactions.len(),
        };
        let (species_rows, event_rows) = species_and_event_rows(model, &tallies);
        Self {
            params: Params {
                max_requeries: max_requeries(&species_rows),
                ..params(model, key, max_iterations, &tallies)
            },
            species_rows,
            event_rows,
            occupancy_rows: occupancy_rows(model, &tallies),
            receptors: receptors(model),
            reflects: model.receivers.iter().any(|receiver| receiver.kind.reflects()),
            receiver_rows: max_rows(model),
            reaction_rows: reaction_rows(model),
            tallies,
        }
    }

    /// Returns the events of receptors, with species and receiver.
    pub(super) fn bound_species(&self) -> Vec<BoundSpecies> {
        let of_kind = |(species, kind): (usize, &SpeciesRow)| {
            let event_rows =
                (kind.events_begin..kind.decays_begin).map(|k| (k, &self.event_rows[k as usize]));
            let binding = event_rows.filter(|(_, event)| event.kind == EventRow::RECEPTORS);
            binding
                .map(|(event, row)| BoundSpecies { species: species as u32, receiver: row.receiver, event })
                .collect()
        };
        self.species_rows.iter().enumerate().flat_map(|kind| -> Vec<BoundSpecies> { of_kind(kind) }).collect()
    }
}

/// A species that the receptors of a receiver bind, with the index of that event. Lists are in the order of species and
/// receivers, which is the order of events.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct BoundSpecies {
    pub(super) species: u32,
    pub(super) receiver: u32,
    pub(super) event: u32,
}

fn receptors(model: &Model) -> Vec<ReceptorRow> {
    let count = |receiver: &Receiver| match receiver.kind {
        ReceiverKind::Receptors(Receptors { count, .. }) => Some(count),
        _ => None,
    };
    if model.receivers.iter().all(|receiver| count(receiver).is_none()) {
        return Vec::new();
    }
    let row = |receiver| ReceptorRow { count: count(receiver).unwrap_or(0), ..ReceptorRow::default() };
    model.receivers.iter().map(row).collect()
}

fn params(model: &Model, key: Key, max_iterations: u32, tallies: &Tallies) -> Params {
    let mut params = Params {
        key: key.0.into(),
        species: tallies.species as u32,
        tallies: tallies.len() as u32,
        first_reaction: tallies.reaction(0) as u32,
        is_open: model.boundary.is_unbounded().into(),
        max_iterations,
        lists_pairs: u32::from(!model.reactions.is_empty()),
        ..Params::default()
    };
    for (k, axis) in model.boundary.axes.into_iter().enumerate() {
        let (kind, walls) = match axis {
            // Unused, but no division by zero.
            Axis::Open => (0, [0.0, 1.0]),
            Axis::Reflecting { low, high } => (1, [low, high]),
            Axis::Periodic { low, high } => (2, [low, high]),
        };
        params.axes[k] = kind;
        [params.low[k], params.high[k]] = walls;
    }
    params
}

fn species_and_event_rows(model: &Model, tallies: &Tallies) -> (Vec<SpeciesRow>, Vec<EventRow>) {
    let motion = Propagator::new(model);
    let (mut event_rows, mut species_rows, mut listed) = (Vec::new(), Vec::new(), 0);
    for (id, species) in model.species.iter().enumerate() {
        let events_begin = event_rows.len() as u32;
        let step = motion.steps[id];
        for (place, receiver) in model.receivers.iter().enumerate().filter(|(_, r)| r.sees[id]) {
            let Some(surface) = surface(receiver, &step, model.time_step) else { continue };
            event_rows.push(EventRow {
                drift: receiver.velocity.map(|v| (v * model.time_step) as f32).into(),
                radius: receiver.radius,
                diffusion: (receiver.diffusion * model.time_step) as f32,
                receiver: place as u32,
                product: NOTHING,
                tally: tallies.arrival(place, id) as u32,
                ..surface
            });
        }
        let decays_begin = event_rows.len() as u32;
        let is_listed = decays_begin - events_begin >= MIN_LISTED_RECEIVERS;
        event_rows.extend(motion.decays.channels(id as u32).iter().map(|channel| EventRow {
            kind: EventRow::DECAY,
            threshold: channel.up_to,
            product: channel.product.unwrap_or(NOTHING),
            tally: tallies.decay(channel.decay as usize) as u32,
            ..EventRow::default()
        }));
        species_rows.push(SpeciesRow {
            drift: step.drift.into(),
            length: step.length,
            diffusion: step.diffusion,
            radius: species.radius,
            events_begin,
            decays_begin,
            events_end: event_rows.len() as u32,
            bend: step.bend,
            reach: reach(&step),
            cell_lists: if is_listed { listed } else { NOTHING },
        });
        listed += u32::from(is_listed);
    }
    (species_rows, event_rows)
}

/// Returns the distance that all but one in ten million particles stay within in a step, including the reach of receivers.
fn reach(step: &SpeciesStep) -> f32 {
    let drift = step.drift.iter().map(|d| d * d).sum::<f32>().sqrt();
    1.01 * (6.0 * step.length + drift) + step.bend
}

/// Returns the effect of a receiver's surface on a species, or `None` for a transparent one.
fn surface(receiver: &Receiver, step: &SpeciesStep, time_step: f64) -> Option<EventRow> {
    let diffusion = f64::from(step.diffusion + (receiver.diffusion * time_step) as f32);
    let length = diffusion.sqrt();
    let own = |reactivity: f64| (reactivity * time_step / length) as f32;
    let of_kind = |kind| EventRow { kind, length: length as f32, ..EventRow::default() };
    Some(match receiver.kind {
        ReceiverKind::Transparent => return None,
        ReceiverKind::Absorbing => of_kind(EventRow::ABSORBING),
        ReceiverKind::Endpoint => of_kind(EventRow::ENDPOINT),
        ReceiverKind::Reflecting => of_kind(EventRow::REFLECTING),
        ReceiverKind::Partial(Adsorption::Reactivity(reactivity)) => {
            EventRow { own: own(reactivity), ..of_kind(EventRow::PARTIAL) }
        }
        ReceiverKind::Partial(Adsorption::PerStep(probability)) => match below(probability) {
            Some(threshold) => EventRow { threshold, ..of_kind(EventRow::PER_STEP) },
            None => of_kind(EventRow::REFLECTING),
        },
        ReceiverKind::Receptors(Receptors { binding_rate, unbinding_rate, .. }) => EventRow {
            own: own(adsorption::reactivity(binding_rate, 1, receiver.radius.into())),
            unbinding: (unbinding_rate * time_step) as f32,
            ..of_kind(EventRow::RECEPTORS)
        },
    })
}

/// Returns the largest word whose number in (0, 1), converted as on the CPU, is below a probability.
fn below(probability: f64) -> Option<u32> {
    let count = (probability * 4_294_967_296.0 - 0.5).ceil().clamp(0.0, 4_294_967_296.0);
    (count >= 1.0).then_some((count - 1.0) as u32)
}

fn occupancy_rows(model: &Model, tallies: &Tallies) -> Vec<OccupancyRow> {
    let transparent = model.receivers.iter().enumerate().filter(|(_, r)| r.kind == ReceiverKind::Transparent);
    let row = |(place, receiver): (usize, &crate::Receiver), species: usize| OccupancyRow {
        receiver: place as u32,
        radius: receiver.radius,
        first: tallies.arrival(place, species) as u32,
        species: species as u32,
    };
    transparent
        .flat_map(|r| (0..tallies.species).filter(move |&s| r.1.sees[s]).map(move |s| row(r, s)))
        .collect()
}

fn reaction_rows(model: &Model) -> Vec<ReactionRow> {
    let reactions = Reactions::new(model);
    let radius = |product: Option<u32>| product.map_or(0.0, |species| model.species[species as usize].radius);
    let entry = |[a, b]: [u32; 2]| {
        // Several were rejected before.
        let Ok(Some((rule, within))) = reactions.only(a, b) else {
            return ReactionRow { first: NOTHING, ..ReactionRow::default() };
        };
        let reaction = &model.reactions[rule.reaction as usize];
        let [share, first_share] = reactions.shares_of(rule.reaction);
        let parts = reaction.unbinding_radius > 0.0 && reaction.products.iter().all(Option::is_some);
        let mut flags = u32::from(rule.consumes[0]) | u32::from(rule.consumes[1]) << 1;
        flags |= if within.is_some() { ReactionRow::NARROWER } else { 0 };
        flags |= if parts { ReactionRow::APART } else { 0 };
        ReactionRow {
            reaction: rule.reaction,
            first: rule.first,
            threshold: rule.up_to,
            flags,
            products: reaction.products.map(|product| product.unwrap_or(NOTHING)).into(),
            radii: reaction.products.map(radius).into(),
            within: within.unwrap_or(0.0),
            unbinding: reaction.unbinding_radius,
            share,
            first_share,
        }
    };
    let species = model.species.len() as u32;
    (0..species).flat_map(|a| (0..species).map(move |b| [a, b])).map(entry).collect()
}
