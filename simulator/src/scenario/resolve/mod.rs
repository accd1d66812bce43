mod checks;
mod chemotaxis;
mod flow_field;
mod idle;
mod network_index;
mod reactions;
mod receivers;
mod schedule;
mod space;
mod transmitters;

use std::collections::HashMap;
use std::ops::Range;
use std::path::Path;

use lazygrid_io::excerpt;
use lazygrid_scenario::{self as file, File, Finite};
use toml::Spanned;

use self::checks::{span_of, warn};
use self::schedule::single_radius;
use super::{Output, Problem, warnings};
use crate::model::decay_chain::faulty_chain;
use crate::model::membrane::{Membrane, MembraneSurface};
use crate::model::transmitter::Schedule;
use crate::model::{Contact, Model, Species};

pub(super) struct ResolvedScenario {
    pub(super) model: Model,
    pub(super) steps: u32,
    pub(super) seed: u64,
    pub(super) output: Output,
    pub(super) warnings: Vec<Problem>,
}

/// Resolves a scenario file. Files that it names are relative to `directory`.
pub(super) fn resolve(file: File, directory: &Path) -> Result<ResolvedScenario, Problem> {
    if let Some(sweep) = &file.sweep {
        let message = "the file describes several scenarios; run them with `lazygrid simulate`, or use the scenario.toml of one point";
        return Err(Problem {
            key: Some("sweep".to_owned()),
            ..Problem::at(sweep.span(), message.to_owned())
        });
    }
    let mut warnings = Vec::new();
    let dimensions = file.dimensions.as_ref().map_or(3, |dimensions| dimensions.get_ref().0);
    let mut model = Model {
        time_step: file.time_step.0,
        boundary: space::boundary(file.boundary.as_ref(), dimensions)?,
        contact: match file.contact.as_ref().map(|contact| *contact.get_ref()) {
            None | Some(file::Contact::Ignore) => Contact::Ignore,
            Some(file::Contact::Count) => Contact::Count,
            Some(file::Contact::Separate) => Contact::Separate,
            Some(file::Contact::Elastic) => Contact::Elastic,
        },
        logs_arrivals: file.output.arrivals.as_ref().is_some_and(|logs| *logs.get_ref()),
        ..Model::default()
    };
    model.flow = space::flow(file.flow.as_ref(), &model.boundary, directory)?;
    model.flow_pulse = file.flow.as_ref().map(space::flow_pulse).transpose()?.flatten();
    if let Some(flow) = &file.flow {
        warn(&mut warnings, flow.profile.span(), warnings::unresolved_flow(&model));
    }
    for one in &file.species {
        let species = species(one, &model)?;
        model.species.push(species);
    }
    chemotaxis::resolve(&file.attractants, &file.species, &mut model, &mut warnings)?;
    let names = Names::new(&model.species, &file.species)?;
    if let Some(contact) = &file.contact
        && let Some(message) = model.idle_contact()
    {
        return Err(Problem::at(contact.span(), message));
    }
    let (reactions, decays) =
        reactions::resolve(&file.reactions, &file.decays, &names, &model, &mut warnings)?;
    let mut receivers = receivers::receivers(&file.receivers, &names, &model, &mut warnings)?;
    let (mut carriers, mut has_body) = (Vec::new(), Vec::new());
    for transmitter in &file.transmitters {
        let body = receivers::body(transmitter, names.species.len())?;
        has_body.push(body.is_some());
        let moves = body.as_ref().is_some_and(crate::Receiver::moves);
        carriers.push(moves.then_some(receivers.len() as u32));
        receivers.extend(body);
    }
    let receiver_spans = checks::receiver_spans(&file, has_body.into_iter());
    let spans: Vec<_> = file.transmitters.iter().map(|one| one.name.span()).collect();
    let symbol_times: Vec<_> = file.transmitters.iter().map(|one| span_of(&one.symbol_time)).collect();
    let mut transmitters =
        transmitters::transmitters(file.transmitters, &names, &model.boundary, &mut warnings)?;
    for (transmitter, span) in transmitters.iter().zip(symbol_times) {
        if let Schedule::Message(message) = &transmitter.schedule
            && let Some(message) = message.faulty_symbol_time(&transmitter.name, model.time_step)
        {
            return Err(Problem::at(span.unwrap_or_default(), message));
        }
    }
    transmitters.iter_mut().zip(carriers).for_each(|(transmitter, carrier)| transmitter.carrier = carrier);
    transmitters.extend(transmitters::sources(&file.sources, &names, &model.boundary, &mut warnings)?);
    let membranes = file.membranes.iter().map(|one| membrane(one, &names)).collect::<Result<_, _>>()?;
    model = Model { reactions, decays, transmitters, receivers, membranes, ..model };
    if let Some((k, message)) = model.faulty_membrane() {
        return Err(Problem::at(file.membranes[k].name.span(), message));
    }
    checks::check_receivers(&model, &receiver_spans, &mut warnings)?;
    if let Some((k, message)) = faulty_chain(&model) {
        return Err(Problem::at(file.decays[k].rate.span(), message));
    }
    let of_decays = warnings::fast_decays(&model).into_iter().zip(warnings::rounded_decays(&model));
    for ((fast, rounded), from) in of_decays.zip(&file.decays) {
        warn(&mut warnings, from.rate.span(), [fast, rounded].into_iter().flatten());
    }
    for (rounded, from) in warnings::rounded_reactions(&model).into_iter().zip(&file.reactions) {
        warn(&mut warnings, from.equation.span(), rounded);
    }
    for (membrane, from) in model.membranes.iter().zip(&file.membranes) {
        let messages = [
            warnings::long_step_through(membrane, &model),
            warnings::long_step_between_membranes(membrane, &model),
            warnings::long_receiver_step_through(membrane, &model),
        ];
        warn(&mut warnings, from.name.span(), messages.into_iter().flatten());
    }
    for (index, from) in file.species.iter().enumerate() {
        let messages = [
            warnings::drift_at_curved_wall(&model, index),
            warnings::drift_at_plane_wall(&model, index),
            warnings::drift_without_diffusion(&model, index),
            warnings::rounded_steps(&model, index),
            warnings::long_step_across_flow(&model, index),
            warnings::long_step_to_absorber(&model, index),
            warnings::long_step_across_gap(&model, index),
            warnings::long_step_between_walls(&model, index),
            warnings::rounded_tumbles(&model, index),
        ];
        warn(&mut warnings, from.name.span(), messages.into_iter().flatten());
    }
    if let (Some(dimensions), Some(message)) = (&file.dimensions, model.beyond_dimensions()) {
        return Err(Problem::at(dimensions.span(), message));
    }
    if let Some(contact) = &file.contact {
        warn(&mut warnings, contact.span(), warnings::many_collisions(&model, file.steps));
    }
    let of_sources = file.sources.iter().map(|source| source.equation.span());
    for (transmitter, span) in model.transmitters.iter().zip(spans.into_iter().chain(of_sources)) {
        let messages = [
            warnings::released_inside(transmitter, &model.receivers, &model.boundary),
            warnings::misplaced_shape(transmitter, &model.boundary),
        ];
        warn(&mut warnings, span, messages.into_iter().flatten());
    }
    warnings.extend(idle::keys(&file.species, &file.attractants, &file.output, &model));
    let every = file.output.every.map_or(1, Into::into);
    let output = Output {
        every,
        frames_every: file.output.frames_every.as_ref().map_or(every, |every| (*every.get_ref()).into()),
        xyz: file.output.frames.contains(&file::FrameFormat::Xyz),
        npy: file.output.frames.contains(&file::FrameFormat::Npy),
        checkpoint_every: file.output.checkpoint_every.map(Into::into),
        arrow: false,
        animation: None,
    };
    Ok(ResolvedScenario { model, steps: file.steps, seed: file.seed, output, warnings })
}

fn species(one: &file::Species, model: &Model) -> Result<Species, Problem> {
    let species = Species {
        name: one.name.get_ref().0.clone(),
        radius: one.radius.as_ref().map_or(Ok(0.0), |r| single_radius(r.get_ref().0, r.span()))?,
        diffusion: one.diffusion.0,
        drift: one.drift.map(|Finite(v)| v),
        mass: one.mass.as_ref().map_or(1.0, |mass| mass.get_ref().0),
        thermal_speed: one.thermal_speed.0,
        speed: one.speed.as_ref().map_or(0.0, |speed| speed.get_ref().0),
        tumble_rate: one.tumble_rate.as_ref().map_or(0.0, |rate| rate.get_ref().0),
        chemotaxis: None,
    };
    if let (Some(speed), true) = (&one.speed, species.speed > 0.0 && species.thermal_speed > 0.0) {
        let message = "a swimmer has a speed, and a particle of a gas a thermal-speed; remove one".to_owned();
        return Err(Problem::at(speed.span(), message));
    }
    if let (Some(rate), true) = (&one.tumble_rate, species.tumble_rate > 0.0 && one.speed.is_none()) {
        let message = "only swimmers tumble; give the species a speed, or remove the tumble-rate".to_owned();
        return Err(Problem::at(rate.span(), message));
    }
    match (model.misfit(&species), &one.radius) {
        (Some(message), Some(radius)) => Err(Problem::at(radius.span(), message)),
        (Some(message), None) => Err(Problem::at(one.name.span(), message)),
        (None, _) => Ok(species),
    }
}

fn membrane(one: &file::Membrane, names: &Names<'_>) -> Result<Membrane, Problem> {
    let surface = match (&one.axis, &one.position, &one.center, &one.radius) {
        (Some(axis), Some(position), None, None) => {
            let (axis, position) = (space::number(*axis.get_ref()), position.get_ref().0 as f32);
            MembraneSurface::Plane { axis, position }
        }
        (None, None, Some(center), Some(radius)) => {
            let (center, radius) = (schedule::to_f32(*center.get_ref()), radius.get_ref().0 as f32);
            MembraneSurface::Sphere { center, radius }
        }
        _ => {
            let message = "a membrane has either axis and position, or center and radius";
            return Err(Problem::at(one.name.span(), message.to_owned()));
        }
    };
    Ok(Membrane {
        name: one.name.get_ref().0.clone(),
        surface,
        permeability: one.permeability.0,
        sees: names.seen(one.species.as_ref())?,
    })
}

struct Names<'a> {
    species: &'a [Species],
    indices: HashMap<&'a str, u32>,
}

/// Columns of every series.
const COLUMNS: [&str; 4] = ["step", "time", "pairs", "contacts"];

impl<'a> Names<'a> {
    fn new(species: &'a [Species], file: &[file::Species]) -> Result<Self, Problem> {
        let mut indices = HashMap::with_capacity(species.len());
        for ((index, one), from) in (0..).zip(species).zip(file) {
            if COLUMNS.contains(&one.name.as_str()) {
                let message = format!("'{}' is another column of the series; rename the species", one.name);
                return Err(Problem::at(from.name.span(), message));
            }
            if one.name == "0" {
                let message = "'0' stands for no product in equations; rename the species".to_owned();
                return Err(Problem::at(from.name.span(), message));
            }
            if indices.insert(one.name.as_str(), index).is_some() {
                let message = format!("there are two species '{}'; rename one", one.name);
                return Err(Problem::at(from.name.span(), message));
            }
        }
        Ok(Self { species, indices })
    }

    fn find(&self, name: &str, span: Range<usize>) -> Result<u32, Problem> {
        self.indices.get(name).copied().ok_or_else(|| {
            let known = self.species.iter().take(60).map(|species| species.name.as_str());
            let known = known.collect::<Vec<_>>().join(", ");
            let (name, known) = (excerpt(name.as_bytes()), excerpt(known.as_bytes()));
            Problem::at(span, format!("there is no species '{name}'; there are {known}"))
        })
    }

    /// Returns flags by species; all are `true` if the list is absent.
    fn seen(&self, named: Option<&Spanned<Vec<Spanned<String>>>>) -> Result<Vec<bool>, Problem> {
        let Some(named) = named else { return Ok(vec![true; self.species.len()]) };
        if named.get_ref().is_empty() {
            let message =
                "the list is empty, so that no species is seen; name some species, or remove the key for all";
            return Err(Problem::at(named.span(), message.to_owned()));
        }
        let mut sees = vec![false; self.species.len()];
        for name in named.get_ref() {
            sees[self.get(name)? as usize] = true;
        }
        Ok(sees)
    }

    fn get(&self, name: &Spanned<String>) -> Result<u32, Problem> {
        self.find(name.get_ref(), name.span())
    }

    fn equation(&self, equation: &Spanned<String>) -> Result<[Vec<u32>; 2], Problem> {
        let (text, span) = (equation.get_ref(), equation.span());
        let shown = excerpt(text.as_bytes());
        if let Some((left, right)) = text.split_once("<->") {
            let [left, right] = [left, right].map(|side| excerpt(side.trim().as_bytes()));
            let message = format!(
                "'{shown}' goes both ways; write a reaction for each: '{left} -> {right}' and '{right} -> {left}'"
            );
            return Err(Problem::at(span, message));
        }
        let Some((left, right)) = text.split_once("->") else {
            return Err(Problem::at(span, format!("'{shown}' has no '->'; write it as in 'A + B -> C'")));
        };
        let side = |side: &str| -> Result<Vec<u32>, Problem> {
            let names = side.split('+').map(str::trim).filter(|name| !name.is_empty() && *name != "0");
            names.map(|name| self.find(name, equation.span())).collect()
        };
        Ok([side(left)?, side(right)?])
    }
}

fn equation_name(equation: &Spanned<String>) -> String {
    equation.get_ref().split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Numbers equal names, as in `-> A (2)`, because files tell them apart by name.
fn number_equal_names<'a>(names: impl Iterator<Item = &'a mut String>) {
    let mut counts: HashMap<String, u32> = HashMap::new();
    for name in names {
        let count = counts.entry(name.clone()).or_default();
        *count += 1;
        if *count > 1 {
            *name = format!("{name} ({count})");
        }
    }
}
