use super::kernel::Variant;
use super::layout::{
    ChemotaxisRow, DissociationRow, EventRow, MAX_DECAYS, NOTHING, OccupancyRow, Params, ReactionRow,
    ReceptorRow, SpeciesRow,
};
use super::ligand_rows::LigandRows;
use super::model_check::chained_decays;
use super::path_bounds::{long_path_iterations, search_distance};
use super::receiver_cells::MIN_LISTED_RECEIVERS;
use super::scene_rows::SceneRows;
use super::tally_layout::Tallies;
use crate::model::reactive_pairs::ReactivePairs;
use crate::model::receiver::{Adsorption, ReceiverKind, WallFace};
use crate::model::receptors::ReceptorType;
use crate::model::{Contact, Model, Unbinding};
use crate::motion::propagate::Propagator;
use crate::motion::species_step::SpeciesStep;
use crate::motion::tumble::TumbleStep;
use crate::motion::vessel_flow::{FlowStep, StepDrift, StepTime};
use crate::random::philox::Key;
use crate::reaction::dissociation::Dissociation;
use crate::reaction::{ReactionRule, Reactions};
use crate::{Axis, Receiver};

#[derive(Clone, Debug, PartialEq)]
pub(super) struct Tables {
    pub(super) params: Params,
    pub(super) species_rows: Vec<SpeciesRow>,
    pub(super) event_rows: Vec<EventRow>,
    pub(super) occupancy_rows: Vec<OccupancyRow>,
    pub(super) receptors: Vec<ReceptorRow>,
    pub(super) reflects: bool,
    pub(super) variant: Variant,
    pub(super) scene_rows: SceneRows,
    pub(super) reaction_rows: Vec<ReactionRow>,
    pub(super) dissociation_rows: Vec<DissociationRow>,
    pub(super) max_counts: u32,
    pub(super) tallies: Tallies,
}

/// Loop iterations of a thread near surfaces, additional ones per search, and most reflections in a step.
const REFLECTION_ITERATIONS: u32 = 60_000;
const ITERATIONS_PER_SEARCH: u32 = 1_100;
const BOUNCES: u32 = 64;

/// Bounds the searches of a particle in a step: moving surfaces may push it out of the searched region. `paths` are
/// iterations of its hits.
fn max_requeries(species_rows: &[SpeciesRow], paths: u32) -> u32 {
    let receivers = species_rows.iter().map(|kind| kind.decays_begin - kind.events_begin).max().unwrap_or(0);
    let per_search = receivers + ITERATIONS_PER_SEARCH;
    (REFLECTION_ITERATIONS.saturating_sub(per_search + paths) / per_search).clamp(1, BOUNCES)
}

impl Tables {
    pub(super) fn new(model: &Model, key: Key, max_iterations: u32) -> Self {
        let tallies = Tallies {
            species: model.species.len(),
            receivers: model.receivers.len(),
            decays: model.decays.len(),
            reactions: model.reactions.len(),
            receptors: model.receptor_types().count(),
        };
        let (mut species_rows, event_rows) = species_and_event_rows(model, &tallies);
        let mut scene_rows = SceneRows::new(model);
        scene_rows.add_membranes(model, &mut species_rows);
        let mut params = params(model, key, max_iterations, &tallies);
        let paths = long_path_iterations(model);
        params.max_requeries = max_requeries(&species_rows, paths as u32);
        scene_rows.describe_field(&mut params);
        Self {
            params,
            species_rows,
            event_rows,
            occupancy_rows: occupancy_rows(model, &tallies),
            receptors: receptor_rows(model, &tallies),
            reflects: model.receivers.iter().any(Receiver::reflects_some),
            variant: Variant { has_membranes: scene_rows.has_membranes(), has_long_paths: paths > 0 },
            scene_rows,
            reaction_rows: reaction_rows(model),
            dissociation_rows: dissociation_rows(model, &tallies),
            max_counts: if chained_decays(model).next().is_some() { MAX_DECAYS } else { 1 },
            tallies,
        }
    }

    pub(super) fn set_flow(&mut self, model: &Model, flow_fraction: f64) {
        let time = StepTime::new(model, flow_fraction);
        for (species, row) in self.species_rows.iter_mut().enumerate() {
            let drift = StepDrift::new(model, species, time);
            row.drift = drift.drift.into();
            row.drifts_at_wall = at_wall_bits(drift);
        }
        self.params.flow_duration = (flow_fraction * model.time_step) as f32;
        if let Some(flow) = FlowStep::new(model, time) {
            self.params.peak_flow = flow.fastest as f32;
        }
    }

    pub(super) fn dissociates(&self) -> bool {
        !self.dissociation_rows.is_empty()
    }
}

fn receptor_rows(model: &Model, tallies: &Tallies) -> Vec<ReceptorRow> {
    let row = |(k, kind): (usize, &ReceptorType)| ReceptorRow {
        count: kind.count,
        tally: tallies.requests(k) as u32,
        ..ReceptorRow::default()
    };
    model.receptor_types().enumerate().map(row).collect()
}

fn params(model: &Model, key: Key, max_iterations: u32, tallies: &Tallies) -> Params {
    let mut params = Params {
        key: key.0.into(),
        species: tallies.species as u32,
        tallies: tallies.len() as u32,
        first_reaction: tallies.reaction(0) as u32,
        is_open: model.boundary.is_unbounded().into(),
        max_iterations,
        lists_pairs: u32::from(!model.reactions.is_empty() || model.contact == Contact::Separate),
        largest_radius: model.species.iter().map(|species| species.radius).fold(0.0, f32::max),
        collides: model.contact.collides().into(),
        is_elastic: (model.contact == Contact::Elastic).into(),
        has_velocity: model.has_velocity().into(),
        logs_arrivals: model.logs_arrivals.into(),
        time_step: model.time_step as f32,
        ..Params::default()
    };
    if let Some(FlowStep { vessel, fastest }) = FlowStep::new(model, StepTime::new(model, 1.0)) {
        params.vessel_axis = 1 + vessel.along.unwrap_or(3) as u32;
        params.vessel_radius = vessel.radius;
        params.vessel_center = vessel.center.into();
        params.peak_flow = fastest as f32;
    }
    for (k, axis) in model.boundary.axes.into_iter().enumerate() {
        let (kind, walls) = match axis {
            Axis::Open => (0, [0.0, 1.0]),
            Axis::Reflecting { low, high } => (1, [low, high]),
            Axis::Periodic { low, high } => (2, [low, high]),
            Axis::Frozen => (3, [0.0, 1.0]),
        };
        params.axes[k] = kind;
        [params.low[k], params.high[k]] = walls;
    }
    params
}

fn species_and_event_rows(model: &Model, tallies: &Tallies) -> (Vec<SpeciesRow>, Vec<EventRow>) {
    let (motion, ligand_rows) = (Propagator::new(model), LigandRows::new(model, tallies));
    let (mut event_rows, mut species_rows, mut listed) = (Vec::new(), Vec::new(), 0);
    for (id, species) in model.species.iter().enumerate() {
        let events_begin = event_rows.len() as u32;
        let step = motion.steps[id];
        for (index, receiver) in model.receivers.iter().enumerate().filter(|(_, r)| r.sees[id]) {
            let Some(surface) = surface(receiver, id, &step, model.time_step) else { continue };
            event_rows.push(EventRow {
                drift: receiver.velocity.map(|v| (v * model.time_step) as f32).into(),
                radius: receiver.radius,
                diffusion: (receiver.diffusion * model.time_step) as f32,
                receiver: index as u32,
                product: NOTHING,
                tally: tallies.arrival(index, id) as u32,
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
            cumulative_fraction: channel.cumulative_fraction as f32,
            ..EventRow::default()
        }));
        let walls_begin = event_rows.len() as u32;
        let walls = model.receivers.iter().enumerate().filter(|(_, receiver)| receiver.sees[id]);
        event_rows.extend(walls.filter_map(|(index, receiver)| {
            let ReceiverKind::Wall(face) = receiver.kind else { return None };
            Some(EventRow {
                kind: EventRow::WALL + face_index(face),
                receiver: index as u32,
                tally: tallies.arrival(index, id) as u32,
                ..EventRow::default()
            })
        }));
        let events_end = event_rows.len() as u32;
        ligand_rows.append(id as u32, events_begin as usize..decays_begin as usize, &mut event_rows);
        let (tumbles, dissociation) = (TumbleStep::new(model, id), motion.decays.dissociation(id as u32));
        species_rows.push(SpeciesRow {
            drift: step.drift.drift.into(),
            drifts_at_wall: at_wall_bits(step.drift),
            length: step.length,
            diffusion: step.diffusion,
            radius: species.radius,
            events_begin,
            decays_begin,
            walls_begin,
            events_end,
            bend: step.bend,
            search_distance: search_distance(model, &motion.steps, id),
            cell_lists: if is_listed { listed } else { NOTHING },
            speed: species.speed as f32,
            thermal_speed: species.thermal_speed as f32,
            tumbles: tumbles.is_some().into(),
            tumble_threshold: tumbles.as_ref().map_or(0, |tumbles| tumbles.up_to),
            taxis: tumbles.map_or(ChemotaxisRow::default(), |tumbles| {
                ChemotaxisRow::new(model, id, tumbles.probability)
            }),
            decay_rate: (motion.decays.rate(id as u32) * model.time_step) as f32,
            dissociation_rate: dissociation.map_or(0.0, |time| time.rate as f32),
            dissociation_threshold: dissociation.map_or(0, |time| time.up_to),
            mobility: match model.contact {
                Contact::Elastic => (1.0 / species.mass) as f32,
                _ => step.diffusion,
            },
            ..SpeciesRow::default()
        });
        listed += u32::from(is_listed);
    }
    (species_rows, event_rows)
}

fn face_index(face: WallFace) -> u32 {
    match face {
        WallFace::Low(axis) => 2 * axis as u32,
        WallFace::High(axis) => 2 * axis as u32 + 1,
        WallFace::Side => 6,
    }
}

fn at_wall_bits(drift: StepDrift) -> u32 {
    (0..3).map(|k| u32::from(drift.at_wall[k]) << k).sum()
}

fn surface(receiver: &Receiver, species: usize, step: &SpeciesStep, time_step: f64) -> Option<EventRow> {
    let diffusion = f64::from(step.diffusion + (receiver.diffusion * time_step) as f32);
    let length = diffusion.sqrt();
    let scaled_reactivity = |reactivity: f64| (reactivity * time_step / length) as f32;
    let of_kind = |kind| EventRow { kind, length: length as f32, ..EventRow::default() };
    Some(match receiver.kind {
        ReceiverKind::Transparent | ReceiverKind::Wall(_) => return None,
        ReceiverKind::Absorbing => of_kind(EventRow::ABSORBING),
        ReceiverKind::Endpoint => of_kind(EventRow::ENDPOINT),
        ReceiverKind::Reflecting => of_kind(EventRow::REFLECTING),
        ReceiverKind::Partial(Adsorption::Reactivity(reactivity)) => {
            EventRow { scaled_reactivity: scaled_reactivity(reactivity), ..of_kind(EventRow::PARTIAL) }
        }
        ReceiverKind::Partial(Adsorption::PerStep(probability)) => match below(probability) {
            Some(threshold) => EventRow { threshold, ..of_kind(EventRow::PER_STEP) },
            None => of_kind(EventRow::REFLECTING),
        },
        ReceiverKind::Receptors(_) if receiver.binds(species) => of_kind(EventRow::RECEPTORS),
        ReceiverKind::Receptors(_) => of_kind(EventRow::REFLECTING),
    })
}

/// Equals the CPU's threshold for probabilities in (0, 1).
fn below(probability: f64) -> Option<u32> {
    let count = (probability * 4_294_967_296.0 - 0.5).ceil().clamp(0.0, 4_294_967_296.0);
    (count >= 1.0).then_some((count - 1.0) as u32)
}

fn occupancy_rows(model: &Model, tallies: &Tallies) -> Vec<OccupancyRow> {
    let transparent = model.receivers.iter().enumerate().filter(|(_, r)| r.kind == ReceiverKind::Transparent);
    let row = |(index, receiver): (usize, &crate::Receiver), species: usize| OccupancyRow {
        receiver: index as u32,
        radius: receiver.radius,
        first: tallies.arrival(index, species) as u32,
        species: species as u32,
    };
    transparent
        .flat_map(|r| (0..tallies.species).filter(move |&s| r.1.sees[s]).map(move |s| row(r, s)))
        .collect()
}

fn reaction_rows(model: &Model) -> Vec<ReactionRow> {
    let reactions = Reactions::new(model);
    let species = model.species.len() as u32;
    let pairs = || (0..species).flat_map(|a| (0..species).map(move |b| [a, b]));
    let fraction = |pair| model.first_fraction(pair);
    let idle =
        |pair| ReactionRow { first: NOTHING, first_fraction: fraction(pair), ..ReactionRow::default() };
    let mut rows: Vec<_> = pairs().map(idle).collect();
    for [a, b] in pairs() {
        let head = (a * species + b) as usize;
        let shells = reactions.shells(a, b).iter().enumerate();
        let all: Vec<_> =
            shells.flat_map(|(k, shell)| shell.rules().map(move |rule| (k, rule, shell.within))).collect();
        let begin = rows.len();
        let index = |i: usize| if i == 0 { head as u32 } else { (begin + i - 1) as u32 };
        for (i, &(k, rule, within)) in all.iter().enumerate() {
            let next = all.get(i + 1).filter(|next| next.0 == k).map_or(NOTHING, |_| index(i + 1));
            let next_shell = all.iter().position(|other| other.0 == k + 1).map_or(NOTHING, index);
            let row = ReactionRow { next, next_shell, ..reaction_row(model, &reactions, rule, within) };
            match i {
                0 => rows[head] = row,
                _ => rows.push(row),
            }
        }
    }
    let reactive = ReactivePairs::new(model);
    for (pair, row) in pairs().zip(&mut rows).filter(|(pair, _)| reactive.contain(pair[0], pair[1])) {
        row.flags |= ReactionRow::REACTS;
        describe_dissociation(&reactions, pair, row);
    }
    rows
}

fn describe_dissociation(reactions: &Reactions, pair: [u32; 2], row: &mut ReactionRow) {
    let times = pair.map(|species| reactions.dissociation_of(species));
    let flags = times.iter().zip(ReactionRow::DISSOCIATES).filter(|(time, _)| time.is_some());
    row.flags |= flags.map(|(_, flag)| flag).sum::<u32>();
    row.dissociation_thresholds = times.map(|time| time.map_or(0, |time| time.up_to)).into();
}

fn reaction_row(
    model: &Model,
    reactions: &Reactions,
    rule: &ReactionRule,
    within: Option<f32>,
) -> ReactionRow {
    let product_species = |product: Option<u32>| product.map(|species| &model.species[species as usize]);
    let radius = |product: Option<u32>| product_species(product).map_or(0.0, |species| species.radius);
    let speed = |product: Option<u32>| product_species(product).map_or(0.0, |species| species.speed as f32);
    let thermal = |one: Option<u32>| product_species(one).map_or(0.0, |species| species.thermal_speed as f32);
    let reaction = &model.reactions[rule.reaction as usize];
    let [first_fraction, first_product_fraction] = reactions.first_fractions_of(rule.reaction);
    let mut flags = u32::from(rule.consumes[0]) | u32::from(rule.consumes[1]) << 1;
    flags |= if within.is_some() { ReactionRow::NARROWER } else { 0 };
    flags |= if reaction.separates() { ReactionRow::APART } else { 0 };
    flags |= if rule.draws_order { ReactionRow::DRAWS_ORDER } else { 0 };
    ReactionRow {
        reaction: rule.reaction,
        next: NOTHING,
        next_shell: NOTHING,
        first: rule.first,
        threshold: rule.up_to,
        flags,
        products: reaction.products.map(|product| product.unwrap_or(NOTHING)).into(),
        radii: reaction.products.map(radius).into(),
        within: within.unwrap_or(0.0),
        unbinding: reaction.unbinding_radius,
        first_fraction,
        first_product_fraction,
        speeds: reaction.reactants.map(|species| speed(Some(species))).into(),
        thermal_speeds: reaction.reactants.map(|species| thermal(Some(species))).into(),
        product_speeds: reaction.products.map(speed).into(),
        product_thermal_speeds: reaction.products.map(thermal).into(),
        ..ReactionRow::default()
    }
}

fn dissociation_rows(model: &Model, tallies: &Tallies) -> Vec<DissociationRow> {
    let dissociation = Dissociation::new(model);
    if dissociation.is_empty() {
        return Vec::new();
    }
    let species = model.species.len();
    let mut rows = vec![DissociationRow { tally: NOTHING, ..DissociationRow::default() }; species];
    let kind = |species: u32| &model.species[species as usize];
    for reactant in 0..species {
        let channels = dissociation.channels(reactant as u32);
        for (k, &(threshold, ref channel)) in channels.iter().enumerate() {
            let next = if k + 1 < channels.len() { rows.len() as u32 + u32::from(k > 0) } else { NOTHING };
            let products = channel.products;
            let speed_of = |species: u32| kind(species).speed as f32;
            let thermal_speed_of = |species: u32| kind(species).thermal_speed as f32;
            let (is_within, unbinding) = match channel.unbinding {
                Unbinding::Apart(radius) => (0, radius),
                Unbinding::Within(radius) => (1, radius),
            };
            let row = DissociationRow {
                threshold,
                next,
                tally: tallies.decay(channel.decay as usize) as u32,
                is_within,
                unbinding,
                first_fraction: channel.first_fraction,
                products: products.map(|one| one.map_or(NOTHING, |one| one.species)).into(),
                radii: products.map(|one| one.map_or(0.0, |one| one.radius)).into(),
                product_speeds: products.map(|one| one.map_or(0.0, |one| speed_of(one.species))).into(),
                product_thermal_speeds: products
                    .map(|one| one.map_or(0.0, |one| thermal_speed_of(one.species)))
                    .into(),
                speed: speed_of(reactant as u32),
                thermal_speed: thermal_speed_of(reactant as u32),
            };
            match k {
                0 => rows[reactant] = row,
                _ => rows.push(row),
            }
        }
    }
    rows
}
