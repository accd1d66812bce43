//! A run on the device, step by step.

use lazygrid::gpu::{Crossover, GpuConfig, GpuDetector, GpuDevice, GpuSpheres, SphereCount, wgpu};

use super::device::{filled, read, refused, with_error_scope};
use super::journey::{Itinerary, most_steps};
use super::kernel as k;
use super::layout::{Head, Lists};
use super::nearby::{Listing, Nearby};
use super::plan::{GpuOptions, MAX_TURNS, Sizes, grown, steps_between_looks};
use super::stages::{Base, Groups, Stage, Steps};
use super::tables::{Holder, Tables, Tallies, check};
use crate::model::Model;
use crate::model::particles::Particles;
use crate::model::receiver::ReceiverKind;
use crate::random::philox::Key;
use crate::reaction::decay::Decays;
use crate::reaction::interactions;
use crate::release::Released;
use crate::{Error, State, Totals};

mod receivers;
mod room;
mod rows;
use room::prepare;
use rows::columns;

/// A run whose particles live on a GPU: a model, a seed, and what has become of it.
///
/// Its [`state`](Self::state) is that of a [`Simulation`](crate::Simulation), so that either can go on where the other
/// stopped.
#[derive(Debug)]
pub struct GpuSimulation {
    model: Model,
    key: Key,
    decays: Decays,
    tallies: Tallies,
    /// The capacities of receptors.
    holders: Vec<Holder>,
    /// The positions of receivers in the steps that were recorded last.
    itinerary: Itinerary,
    /// Their lists by cells.
    listing: Listing,
    /// The cells of the lists that are on the device.
    lists: Lists,
    centers: Vec<[f32; 3]>,
    base: Base,
    detector: Option<GpuDetector>,
    cell_ratio: f32,
    options: GpuOptions,
    steps: Steps,
    /// Particles at the last look.
    alive: u32,
    /// The particles that were released since then and are not on the device yet.
    due: Particles,
    step: u32,
    next_id: u32,
    totals: Totals,
    inside: Vec<Vec<u64>>,
    pairs: Vec<u64>,
}

/// The particles that appear before a step.
struct Burst {
    step: u32,
    released: Released,
}

/// Rounds of a matching by the whole device, at most. With random priorities their number grows as the logarithm of
/// that of the candidates.
const MAX_ROUNDS: u32 = 512;
/// Work, in particles moved, that one submission may have: far below what watchdogs allow.
const SUBMISSION: u32 = 1 << 24;
/// Steps that one submission may have, however few particles there are.
const STEPS: u32 = 64;

impl GpuSimulation {
    /// The beginning of a run on a device.
    ///
    /// # Errors
    /// [`Error::Model`] where the model makes no sense, [`Error::NotOnGpu`] for a part of it that has no kernels, and
    /// [`Error::Detection`] where the device refuses or has no room.
    pub fn new(model: Model, seed: u64, device: GpuDevice, options: GpuOptions) -> Result<Self, Error> {
        let state = State::new(&model, seed)?;
        Self::resume(model, seed, device, options, &state)
    }

    /// A run that goes on from a state of the same model and seed.
    ///
    /// # Errors
    /// The same as [`new`](Self::new).
    pub fn resume(
        model: Model,
        seed: u64,
        device: GpuDevice,
        options: GpuOptions,
        state: &State,
    ) -> Result<Self, Error> {
        model.check()?;
        check(&model)?;
        if !state.belongs_to(&model) {
            return Err(Error::Model("the state is one of another model".to_owned()));
        }
        let key = Key::new(seed);
        let tables = Tables::new(&model, key, options.turns.min(MAX_TURNS));
        let mut listing = Listing::new(&tables.kinds, &tables.fates, model.boundary);
        let mut base = Base::new(device, &tables, listing.most_words())?;
        let alive = (state.particles.len() + state.bound.len()) as u32;
        let lists = !model.reactions.is_empty();
        let sizes =
            Sizes { particles: grown(alive), pairs: if lists { options.pair_capacity.max(1) } else { 0 } };
        let mut detector = detector(&base, &model, sizes)?;
        let steps = prepare(&mut base, sizes, options.rounds, detector.as_mut())?;
        // Moving receivers are listed for each of their paths.
        let moves = model.receivers.iter().any(crate::Receiver::moves);
        let nearby = if moves { Nearby::default() } else { listing.of(&state.centers, &[], 0.0)? };
        base.list(&nearby)?;
        let mut simulation = Self {
            key,
            decays: Decays::new(&model),
            tallies: tables.tallies,
            holders: tables.holders(),
            itinerary: Itinerary::new(&model, key, &state.centers, state.step, 0),
            lists: nearby.head,
            listing,
            centers: state.centers.clone(),
            base,
            detector,
            cell_ratio: GpuConfig::CELL_RATIO,
            options,
            steps,
            alive,
            due: Particles::default(),
            step: state.step,
            next_id: state.next_id,
            totals: state.totals.clone(),
            inside: Vec::new(),
            pairs: Vec::new(),
            model,
        };
        simulation.base.take_up(&simulation.itinerary, simulation.lists)?;
        simulation.upload(state)?;
        simulation.look(simulation.encoder(), alive, &[])?;
        Ok(simulation)
    }

    /// The model.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// The number of steps done.
    pub fn step_count(&self) -> u32 {
        self.step
    }

    /// The time that has passed, in s.
    pub fn time(&self) -> f64 {
        f64::from(self.step) * self.model.time_step
    }

    /// The counts.
    pub fn totals(&self) -> &Totals {
        &self.totals
    }

    /// The pairs that the detector found in each step of the last [`run`](Self::run).
    pub fn pairs_by_step(&self) -> &[u64] {
        &self.pairs
    }

    /// The counts of each receiver by species: arrivals so far, or the number inside a transparent receiver.
    pub fn received(&self) -> Vec<Vec<u64>> {
        let says = |(k, receiver): (usize, &crate::Receiver)| match receiver.kind {
            ReceiverKind::Transparent => {
                let due = receiver.inside(self.centers[k], &self.model.boundary, &self.due);
                self.inside[k].iter().zip(due).map(|(inside, due)| inside + due).collect()
            }
            _ => self.totals.arrived[k].clone(),
        };
        self.model.receivers.iter().enumerate().map(says).collect()
    }

    /// Does so many steps. The host looks once at their end, or every thousand steps or so.
    ///
    /// # Errors
    /// [`Error::OutOfIds`], [`Error::NotFinite`], and [`Error::Step`] if there are more pairs or particles than the
    /// device has room for. The run then stands before the step that could not be done.
    pub fn run(&mut self, steps: u32) -> Result<(), Error> {
        self.pairs.clear();
        let end = self.step.saturating_add(steps);
        while self.step < end {
            let most = (end - self.step).min(most_steps(&self.model));
            let bursts = self.bursts(most.min(steps_between_looks(self.steps.sizes.particles)))?;
            let added =
                bursts.iter().map(|burst| burst.released.particles.len()).sum::<usize>() + self.due.len();
            let step = self.step;
            let at_step = |error| match error {
                Error::Detection(source) => Error::Step { step, source },
                other => other,
            };
            self.make_room(self.alive.saturating_add(added as u32)).map_err(at_step)?;
            let head = self.submit(most.min(steps_between_looks(self.steps.sizes.particles)), &bursts)?;
            self.thaw(head).map_err(at_step)?;
        }
        Ok(())
    }

    fn encoder(&self) -> wgpu::CommandEncoder {
        self.base.own.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default())
    }

    /// The particles that appear after each of the next steps.
    fn bursts(&self, steps: u32) -> Result<Vec<Burst>, Error> {
        let mut next_id = self.next_id;
        let mut bursts = Vec::new();
        for step in self.step + 1..=self.step + steps {
            let released = self.model.release(&self.decays, self.key, step, next_id)?;
            if released.next_id > next_id {
                next_id = released.next_id;
                bursts.push(Burst { step, released });
            }
        }
        Ok(bursts)
    }

    /// Records and submits steps, and looks.
    fn submit(&mut self, steps: u32, bursts: &[Burst]) -> Result<Head, Error> {
        self.foresee(steps)?;
        // Particles that a stopped step did not take remain for its repetition.
        let due = self.due.clone();
        let mut bursts_left = bursts.iter().peekable();
        let mut particles = self.alive;
        let mut encoder = self.encoder();
        let mut work = 0;
        for step in self.step..self.step + steps {
            let burst = match step == self.step {
                true => Some(&due),
                false => {
                    bursts_left.next_if(|burst| burst.step == step).map(|burst| &burst.released.particles)
                }
            };
            let burst = burst.filter(|particles| !particles.is_empty());
            particles += burst.map_or(0, Particles::len) as u32;
            let burst = burst.map(|burst| self.append(burst)).transpose()?;
            self.steps.encode_before(&mut encoder, burst.as_ref(), particles);
            if let Some(detector) = &mut self.detector {
                let at_most = self.steps.sizes.particles;
                let count = SphereCount::Buffer { buffer: self.base.buffer("control"), at_most };
                let input = GpuSpheres::new(self.steps.buffer("moved"), count)
                    .with_species(self.steps.buffer("species"));
                detector.encode(&mut encoder, &input).map_err(refused)?;
            }
            self.steps.encode_after(&mut encoder, particles);
            work += particles.max(SUBMISSION / STEPS);
            if work >= SUBMISSION {
                work = 0;
                let full = std::mem::replace(&mut encoder, self.encoder());
                with_error_scope(&self.base.own, "steps", 0, || self.base.own.queue.submit([full.finish()]))?;
            }
        }
        self.look(encoder, particles, bursts)
    }

    /// The stage that puts a burst behind the other particles.
    fn append(&mut self, particles: &Particles) -> Result<Stage, Error> {
        let (spheres, tags) = columns(particles);
        let count = spheres.len() as u32;
        let burst = filled(&self.base.own, "burst", &[count, 0, 0, 0])?;
        let spheres = filled(&self.base.own, "burst_spheres", &spheres)?;
        let tags = filled(&self.base.own, "burst_tags", &tags)?;
        let (steps, control) = (&self.steps, self.base.buffer("control").clone());
        self.base.stage(&k::BURST_APPEND, Groups::Items(count), |name| match name {
            "burst" => burst.clone(),
            "burst_spheres" => spheres.clone(),
            "burst_tags" => tags.clone(),
            "control" => control.clone(),
            other => steps.buffer(other).clone(),
        })
    }

    /// Reads what was counted since the last look, and enters it.
    fn look(
        &mut self,
        mut encoder: wgpu::CommandEncoder,
        particles: u32,
        bursts: &[Burst],
    ) -> Result<Head, Error> {
        self.steps.encode_census(&mut encoder, particles);
        let tallies = self.tallies.len();
        let head_bytes = size_of::<Head>();
        let parts = [
            (self.base.buffer("control"), (head_bytes + 8 * tallies) as u64),
            (self.base.buffer("inside"), 4 * tallies as u64),
            (self.base.buffer("log"), 8 * u64::from(super::plan::LOG_ROWS)),
        ];
        let read = read(&self.base.own, encoder, &parts)?;
        let head: Head = bytemuck::pod_read_unaligned(&read[0][..head_bytes]);
        let counts: Vec<u32> = bytemuck::pod_collect_to_vec(&read[0][head_bytes + 4 * tallies..]);
        let inside: Vec<u32> = bytemuck::pod_collect_to_vec(&read[1]);
        let log: Vec<u64> = bytemuck::pod_collect_to_vec(&read[2]);
        self.alive = head.alive;
        self.centers = self.itinerary.centers_at(head.done).to_vec();
        self.enter_bursts(bursts, head.done);
        self.enter(&counts);
        self.inside = inside
            .chunks(self.tallies.species.max(1))
            .take(self.tallies.receivers)
            .map(|row| row.iter().map(|&count| count.into()).collect())
            .collect();
        let pairs = &log[..head.logged as usize];
        self.totals.pairs = pairs.last().copied().unwrap_or(self.totals.pairs);
        self.pairs.extend_from_slice(pairs);
        // For the next look: nothing is logged, and nothing counted but what was read.
        let control = self.base.buffer("control");
        let zeros = vec![0u32; tallies];
        let queue = &self.base.own.queue;
        with_error_scope(&self.base.own, "counts", 0, || {
            queue.write_buffer(control, std::mem::offset_of!(Head, logged) as u64, &[0; 4]);
            queue.write_buffer(control, (head_bytes + 4 * tallies) as u64, bytemuck::cast_slice(&zeros));
        })?;
        Ok(head)
    }

    /// Adds tallies to the totals, and with them what is present.
    fn enter(&mut self, counts: &[u32]) {
        let Self { model, tallies, totals, .. } = self;
        let count = |at: usize| u64::from(counts[at]);
        // One kind may come and go between two looks, in any order; only the end is known not to be negative.
        let present = &mut totals.present;
        let mut turn = |from: u32, to: Option<u32>, count: u64| {
            present[from as usize] = present[from as usize].wrapping_sub(count);
            if let Some(to) = to {
                present[to as usize] = present[to as usize].wrapping_add(count);
            }
        };
        for (k, decay) in model.decays.iter().enumerate() {
            let count = count(tallies.decay(k));
            totals.decayed[k] += count;
            turn(decay.reactant, decay.products[0], count);
        }
        for (k, reaction) in model.reactions.iter().enumerate() {
            let count = count(tallies.reaction(k));
            totals.reacted[k] += count;
            for (from, to) in reaction.reactants.into_iter().zip(reaction.products) {
                turn(from, to, count);
            }
        }
        for receiver in 0..tallies.receivers {
            let holds = matches!(model.receivers[receiver].kind, ReceiverKind::Receptors(_));
            for species in 0..tallies.species {
                let word = counts[tallies.arrival(receiver, species)];
                // The number of bound particles may decrease.
                let count = if holds { i64::from(word as i32) as u64 } else { word.into() };
                let arrived = &mut totals.arrived[receiver][species];
                *arrived = arrived.wrapping_add(count);
                turn(species as u32, None, count);
            }
        }
    }

    /// Enters that the first `done` steps of the run are done, and what appeared until then.
    fn enter_bursts(&mut self, bursts: &[Burst], done: u32) {
        if done > self.step {
            self.due = Particles::default();
        }
        for burst in bursts.iter().take_while(|burst| burst.step <= done) {
            self.next_id = burst.released.next_id;
            self.totals.enter(&burst.released);
            if burst.step == done {
                self.due = burst.released.particles.clone();
            }
        }
        self.step = done;
    }
}

/// The detector, if the model has pairs.
fn detector(base: &Base, model: &Model, sizes: Sizes) -> Result<Option<GpuDetector>, Error> {
    let Some(table) = interactions(model)? else { return Ok(None) };
    // A software driver has few threads, so that lists pay much sooner.
    let crossover = Crossover::assumed(base.own.adapter.is_hardware);
    let settings = GpuConfig::default()
        .crossover(crossover)
        .interactions(Some(table))
        .space(model.boundary.space()?)
        .pair_capacity(sizes.pairs.max(1))
        .consumer_workgroup_size(k::GROUP);
    GpuDetector::new(&base.own.device, settings).map(Some).map_err(refused)
}
