//! A model as the tables that kernels read. Pure functions.

use super::layout::{Fate, Kind, NOTHING, Params, Rule, Watch};
use crate::model::{Contact, Decay, Model};
use crate::motion::{Motion, Step};
use crate::philox::Key;
use crate::reactions::Reactions;
use crate::receiver::Kind as Counting;
use crate::{Axis, Boundary, Error, crossing};

/// Everything that a model says to the kernels.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Tables {
    pub(super) params: Params,
    pub(super) kinds: Vec<Kind>,
    pub(super) fates: Vec<Fate>,
    pub(super) watches: Vec<Watch>,
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
    let refused = |what: String| Err(Error::NotOnGpu { what });
    match model.contact {
        Contact::Separate => return refused("contact by separating overlaps".to_owned()),
        Contact::Elastic => return refused("elastic contact".to_owned()),
        Contact::Ignore | Contact::Count => {}
    }
    if let Some(species) = model.species.iter().find(|species| species.thermal_speed > 0.0) {
        return refused(format!("velocities, which species {} has", species.name));
    }
    if let Some(species) = model.species.iter().find(|species| species.speed > 0.0) {
        return refused(format!("swimmers, such as {}", species.name));
    }
    if model.logs_arrivals {
        return refused("a log of arrivals, of which it has the counts only".to_owned());
    }
    if model.boundary.vessel.is_some() {
        return refused("a cylinder".to_owned());
    }
    if let Some(decay) = model.decays.iter().find(|decay| decay.splits()) {
        return refused(format!("'{}', where one particle becomes two", decay.name));
    }
    let decays = |species: u32| model.decays.iter().filter(move |decay| decay.reactant == species);
    for first in &model.decays {
        // Short steps notice what decays twice in the next one.
        let is_fast = |second: &&Decay| second.rate * model.time_step > FAST_DECAY;
        if let Some(second) = first.products[0].and_then(|product| decays(product).find(is_fast)) {
            return refused(format!(
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
            return refused(format!("several reactions of the same reactants ({})", names.join("; ")));
        }
    }
    check_receivers(model)?;
    let steps = Motion::new(model).steps;
    for receiver in model.receivers.iter().filter(|receiver| receiver.kind == Counting::Absorbing) {
        let seen = (0..steps.len()).filter(|&species| receiver.sees[species]);
        if let Some(species) = seen.into_iter().find(|&s| drifts_past(receiver, &steps[s], &model.boundary)) {
            return refused(format!(
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

fn check_receivers(model: &Model) -> Result<(), Error> {
    let refused = |what: String| Err(Error::NotOnGpu { what });
    for receiver in &model.receivers {
        let name = &receiver.name;
        match receiver.kind {
            Counting::Reflecting => return refused(format!("the reflecting sphere {name}")),
            Counting::Partial(_) => return refused(format!("the partially absorbing receiver {name}")),
            Counting::Receptors(_) => return refused(format!("the receptors of {name}")),
            Counting::Absorbing | Counting::Endpoint | Counting::Transparent => {}
        }
        if receiver.moves() {
            return refused(format!("receiver {name}, which moves"));
        }
    }
    let seen: usize = model.receivers.iter().map(|r| r.sees.iter().filter(|sees| **sees).count()).sum();
    match seen > MOST_SEEN {
        true => refused(format!(
            "so many receivers, at all of which each particle looks: {seen} counts of a receiver and a species, beyond \
             {MOST_SEEN}"
        )),
        false => Ok(()),
    }
}

/// Whether the ends of a step do not tell whether a receiver was met between them: drift may carry past what diffuses,
/// and on a straight way a wall or another image of the receiver may turn up.
fn drifts_past(receiver: &crate::Receiver, step: &Step, boundary: &Boundary) -> bool {
    if step.length > 0.0 {
        let drift = step.drift.iter().map(|d| d * d).sum::<f32>().sqrt();
        return crossing::is_long(drift, step.length, receiver.radius);
    }
    (0..3).filter(|&k| step.drift[k] != 0.0).any(|k| {
        let (center, reach) = (receiver.center[k], receiver.radius + step.drift[k].abs());
        match boundary.axes[k] {
            Axis::Open => false,
            Axis::Reflecting { low, high } => center - reach < low || center + reach > high,
            Axis::Periodic { low, high } => 2.0 * reach > high - low,
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
            params: params(model, key, turns, &tallies),
            kinds,
            fates,
            watches: watches(model, &tallies),
            rules: rules(model),
            tallies,
        }
    }
}

fn params(model: &Model, key: Key, turns: u32, tallies: &Tallies) -> Params {
    let mut params = Params {
        key: key.0.into(),
        species: tallies.species as u32,
        tallies: tallies.len() as u32,
        first_reaction: tallies.reaction(0) as u32,
        is_open: model.boundary.is_open().into(),
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
    let motion = Motion::new(model);
    let mut fates = Vec::new();
    let mut kinds = Vec::new();
    for (id, species) in model.species.iter().enumerate() {
        let fates_begin = fates.len() as u32;
        for (place, receiver) in model.receivers.iter().enumerate() {
            let kind = match receiver.kind {
                Counting::Absorbing => Fate::ABSORBING,
                Counting::Endpoint => Fate::ENDPOINT,
                // Others were refused before.
                _ => continue,
            };
            if receiver.sees[id] {
                fates.push(Fate {
                    center: receiver.center.into(),
                    radius: receiver.radius,
                    kind,
                    receiver: place as u32,
                    product: NOTHING,
                    tally: tallies.arrival(place, id) as u32,
                    ..Fate::default()
                });
            }
        }
        fates.extend(motion.decays.channels(id as u32).iter().map(|channel| Fate {
            kind: Fate::DECAY,
            up_to: channel.up_to,
            product: channel.product.unwrap_or(NOTHING),
            tally: tallies.decay(channel.decay as usize) as u32,
            ..Fate::default()
        }));
        let step = motion.steps[id];
        kinds.push(Kind {
            drift: step.drift.into(),
            length: step.length,
            diffusion: step.diffusion,
            radius: species.radius,
            fates_begin,
            fates_end: fates.len() as u32,
        });
    }
    (kinds, fates)
}

fn watches(model: &Model, tallies: &Tallies) -> Vec<Watch> {
    let transparent = model.receivers.iter().enumerate().filter(|(_, r)| r.kind == Counting::Transparent);
    let watch = |(place, receiver): (usize, &crate::Receiver), species: usize| Watch {
        center: receiver.center.into(),
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
        // Several were refused before.
        let Ok(Some((rule, within))) = reactions.only(a, b) else {
            return Rule { first: NOTHING, ..Rule::default() };
        };
        let reaction = &model.reactions[rule.reaction as usize];
        let [share, first_share] = reactions.shares_of(rule.reaction);
        let parts = reaction.unbinding_radius > 0.0 && reaction.products.iter().all(Option::is_some);
        let mut flags = u32::from(rule.claims[0]) | u32::from(rule.claims[1]) << 1;
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
