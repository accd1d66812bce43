//! A model as the tables that kernels read. Pure functions.

use super::journey::most_rows;
use super::layout::{Fate, Kind, NOTHING, Params, ReceptorRow, Rule, Watch};
use super::nearby::LISTED_FROM;
use crate::model::receiver::{Adsorption, ReceiverKind, Receptors};
use crate::model::{Contact, Decay, Model};
use crate::motion::propagate::{Propagator, SpeciesStep};
use crate::motion::{adsorption, path_hit};
use crate::random::philox::Key;
use crate::reaction::Reactions;
use crate::{Axis, Boundary, Error, Receiver};

/// Everything that a model says to the kernels.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Tables {
    pub(super) params: Params,
    pub(super) kinds: Vec<Kind>,
    pub(super) fates: Vec<Fate>,
    pub(super) watches: Vec<Watch>,
    /// Indexed by receiver; empty if no receiver has receptors.
    pub(super) receptors: Vec<ReceptorRow>,
    /// `true` if some surfaces turn particles back.
    pub(super) reflects: bool,
    /// Rows of the table of where receivers are, at most.
    pub(super) bodies: usize,
    pub(super) rules: Vec<Rule>,
    pub(super) tallies: Tallies,
}

/// Which tally is what: arrivals by receiver and species, then decays, then reactions.
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
const FAST_DECAY: f64 = 0.02;

/// Refuses what has no kernels.
///
/// # Errors
/// [`Error::NotOnGpu`], naming the first such thing.
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
        let is_fast = |second: &&Decay| second.rate * model.time_step > FAST_DECAY;
        if let Some(second) = first.products[0].and_then(|product| decays(product).find(is_fast)) {
            return rejected(format!(
                "'{}' behind '{}' in one step; time-step = {:.2e} would do",
                second.name,
                first.name,
                FAST_DECAY / second.rate
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

/// Receivers and species of theirs that one thread looks at in a step: software drivers end an invocation's loops after
/// 65 535 turns without a word.
const MOST_SEEN: usize = 60_000;
/// The same where surfaces turn particles back, to which it looks twice and has some turns more.
const MOST_SEEN_TURNING: usize = 25_000;
/// Loop turns of a thread that surfaces may turn back, of which it takes some besides at each look around, and at most one
/// for each bounce.
const TURNING: u32 = 60_000;
const PER_LOOK: u32 = 1_100;
const BOUNCES: u32 = 64;

/// How often a particle may look around for surfaces in a step: again where it was thrown beyond what it saw. A look goes
/// through all receivers that it sees, and so does what takes particles in.
fn looks(kinds: &[Kind]) -> u32 {
    let most = kinds.iter().map(|kind| kind.decays_begin - kind.fates_begin).max().unwrap_or(0);
    (TURNING.saturating_sub(most + PER_LOOK) / (most + PER_LOOK)).clamp(1, BOUNCES)
}

fn check_receivers(model: &Model) -> Result<(), Error> {
    let seen: usize = model.receivers.iter().map(|r| r.sees.iter().filter(|sees| **sees).count()).sum();
    let reflects = model.receivers.iter().any(|receiver| receiver.kind.reflects());
    let most = if reflects { MOST_SEEN_TURNING } else { MOST_SEEN };
    // Receptors take a workgroup for each receiver, whether it is seen or not.
    let looks = seen.max(model.receivers.len());
    match looks > most {
        true => Err(Error::NotOnGpu {
            what: format!(
                "so many receivers, at all of which each particle looks: {looks} counts of a receiver and a species, \
                 beyond {most}"
            ),
        }),
        false => Ok(()),
    }
}

/// Returns `true` if the ends of a step do not tell whether a receiver was met between them: drift may carry past what
/// diffuses, and on a straight way a wall or another image of the receiver may turn up.
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
            // Sooner or later it comes to a wall as well.
            Axis::Reflecting { .. } if own[k] != 0.0 => true,
            Axis::Reflecting { low, high } => center - reach < low || center + reach > high,
            Axis::Periodic { low, high } => 2.0 * (receiver.radius + drift[k].abs()) > high - low,
        }
    })
}

impl Tables {
    /// The tables of a model that was checked.
    pub(super) fn new(model: &Model, key: Key, turns: u32) -> Self {
        let tallies = Tallies {
            species: model.species.len(),
            receivers: model.receivers.len(),
            decays: model.decays.len(),
            reactions: model.reactions.len(),
        };
        let (kinds, fates) = kinds_and_fates(model, &tallies);
        Self {
            params: Params { looks: looks(&kinds), ..params(model, key, turns, &tallies) },
            kinds,
            fates,
            watches: watches(model, &tallies),
            receptors: receptors(model),
            reflects: model.receivers.iter().any(|receiver| receiver.kind.reflects()),
            bodies: most_rows(model),
            rules: rules(model),
            tallies,
        }
    }

    /// The fates of receptors, with species and receiver.
    pub(super) fn holders(&self) -> Vec<Holder> {
        let of_kind = |(species, kind): (usize, &Kind)| {
            let fates = (kind.fates_begin..kind.decays_begin).map(|k| (k, &self.fates[k as usize]));
            let binding = fates.filter(|(_, fate)| fate.kind == Fate::RECEPTORS);
            binding
                .map(|(fate, row)| Holder { species: species as u32, receiver: row.receiver, fate })
                .collect()
        };
        self.kinds.iter().enumerate().flat_map(|kind| -> Vec<Holder> { of_kind(kind) }).collect()
    }
}

/// A species that receptors of a receiver hold, by the place of that in the table of fates. In a list they are in the order
/// of species and receivers, which is that of fates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Holder {
    pub(super) species: u32,
    pub(super) receiver: u32,
    pub(super) fate: u32,
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

fn params(model: &Model, key: Key, turns: u32, tallies: &Tallies) -> Params {
    let mut params = Params {
        key: key.0.into(),
        species: tallies.species as u32,
        tallies: tallies.len() as u32,
        first_reaction: tallies.reaction(0) as u32,
        is_open: model.boundary.is_unbounded().into(),
        turns,
        lists_pairs: u32::from(!model.reactions.is_empty()),
        ..Params::default()
    };
    for (k, axis) in model.boundary.axes.into_iter().enumerate() {
        let (kind, walls) = match axis {
            // Walls that nobody looks at, but that must not divide by zero.
            Axis::Open => (0, [0.0, 1.0]),
            Axis::Reflecting { low, high } => (1, [low, high]),
            Axis::Periodic { low, high } => (2, [low, high]),
        };
        params.axes[k] = kind;
        [params.low[k], params.high[k]] = walls;
    }
    params
}

fn kinds_and_fates(model: &Model, tallies: &Tallies) -> (Vec<Kind>, Vec<Fate>) {
    let motion = Propagator::new(model);
    let (mut fates, mut kinds, mut listed) = (Vec::new(), Vec::new(), 0);
    for (id, species) in model.species.iter().enumerate() {
        let fates_begin = fates.len() as u32;
        let step = motion.steps[id];
        for (place, receiver) in model.receivers.iter().enumerate().filter(|(_, r)| r.sees[id]) {
            let Some(surface) = surface(receiver, &step, model.time_step) else { continue };
            fates.push(Fate {
                drift: receiver.velocity.map(|v| (v * model.time_step) as f32).into(),
                radius: receiver.radius,
                diffusion: (receiver.diffusion * model.time_step) as f32,
                receiver: place as u32,
                product: NOTHING,
                tally: tallies.arrival(place, id) as u32,
                ..surface
            });
        }
        let decays_begin = fates.len() as u32;
        let is_listed = decays_begin - fates_begin >= LISTED_FROM;
        fates.extend(motion.decays.channels(id as u32).iter().map(|channel| Fate {
            kind: Fate::DECAY,
            up_to: channel.up_to,
            product: channel.product.unwrap_or(NOTHING),
            tally: tallies.decay(channel.decay as usize) as u32,
            ..Fate::default()
        }));
        kinds.push(Kind {
            drift: step.drift.into(),
            length: step.length,
            diffusion: step.diffusion,
            radius: species.radius,
            fates_begin,
            decays_begin,
            fates_end: fates.len() as u32,
            bend: step.bend,
            reach: reach(&step),
            lists: if is_listed { listed } else { NOTHING },
        });
        listed += u32::from(is_listed);
    }
    (kinds, fates)
}

/// The distance within which all but one particle of ten million stay in a step and may meet receivers.
fn reach(step: &SpeciesStep) -> f32 {
    let drift = step.drift.iter().map(|d| d * d).sum::<f32>().sqrt();
    1.01 * (6.0 * step.length + drift) + step.bend
}

/// The effect of a receiver's surface on a species; none if the surface is transparent.
fn surface(receiver: &Receiver, step: &SpeciesStep, time_step: f64) -> Option<Fate> {
    let diffusion = f64::from(step.diffusion + (receiver.diffusion * time_step) as f32);
    let length = diffusion.sqrt();
    let own = |reactivity: f64| (reactivity * time_step / length) as f32;
    let of_kind = |kind| Fate { kind, length: length as f32, ..Fate::default() };
    Some(match receiver.kind {
        ReceiverKind::Transparent => return None,
        ReceiverKind::Absorbing => of_kind(Fate::ABSORBING),
        ReceiverKind::Endpoint => of_kind(Fate::ENDPOINT),
        ReceiverKind::Reflecting => of_kind(Fate::REFLECTING),
        ReceiverKind::Partial(Adsorption::Reactivity(reactivity)) => {
            Fate { own: own(reactivity), ..of_kind(Fate::PARTIAL) }
        }
        ReceiverKind::Partial(Adsorption::PerStep(probability)) => match below(probability) {
            Some(up_to) => Fate { up_to, ..of_kind(Fate::PER_STEP) },
            None => of_kind(Fate::REFLECTING),
        },
        ReceiverKind::Receptors(Receptors { binding_rate, unbinding_rate, .. }) => Fate {
            own: own(adsorption::reactivity(binding_rate, 1, receiver.radius.into())),
            unbinding: (unbinding_rate * time_step) as f32,
            ..of_kind(Fate::RECEPTORS)
        },
    })
}

/// The largest word whose number in (0, 1), as the CPU makes it of a word, is below a probability.
fn below(probability: f64) -> Option<u32> {
    let count = (probability * 4_294_967_296.0 - 0.5).ceil().clamp(0.0, 4_294_967_296.0);
    (count >= 1.0).then_some((count - 1.0) as u32)
}

fn watches(model: &Model, tallies: &Tallies) -> Vec<Watch> {
    let transparent = model.receivers.iter().enumerate().filter(|(_, r)| r.kind == ReceiverKind::Transparent);
    let watch = |(place, receiver): (usize, &crate::Receiver), species: usize| Watch {
        receiver: place as u32,
        radius: receiver.radius,
        first: tallies.arrival(place, species) as u32,
        species: species as u32,
    };
    transparent
        .flat_map(|r| (0..tallies.species).filter(move |&s| r.1.sees[s]).map(move |s| watch(r, s)))
        .collect()
}

fn rules(model: &Model) -> Vec<Rule> {
    let reactions = Reactions::new(model);
    let radius = |product: Option<u32>| product.map_or(0.0, |species| model.species[species as usize].radius);
    let entry = |[a, b]: [u32; 2]| {
        // Several were rejected before.
        let Ok(Some((rule, within))) = reactions.only(a, b) else {
            return Rule { first: NOTHING, ..Rule::default() };
        };
        let reaction = &model.reactions[rule.reaction as usize];
        let [share, first_share] = reactions.shares_of(rule.reaction);
        let parts = reaction.unbinding_radius > 0.0 && reaction.products.iter().all(Option::is_some);
        let mut flags = u32::from(rule.consumes[0]) | u32::from(rule.consumes[1]) << 1;
        flags |= if within.is_some() { Rule::NARROWER } else { 0 };
        flags |= if parts { Rule::APART } else { 0 };
        Rule {
            reaction: rule.reaction,
            first: rule.first,
            up_to: rule.up_to,
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
