use lazygrid::gpu::{GpuConfig, GpuDevice, GpuSpheres, SphereCount, wgpu};

use super::detectors::Detectors;
use super::dispatches::{RunBuffers, StepDispatches};
use super::layout::ReceiverCellsHeader;
use super::ligand_rows::LigandRow;
use super::model_check::check;
use super::plan::{GpuOptions, MAX_BIRTHS, MAX_LOOP_ITERATIONS, Sizes, grow, steps_per_readback};
use super::receiver_cells::{ReceiverCells, ReceiverCellsBuilder};
use super::receiver_trajectory::{ReceiverTrajectory, has_moving_receivers, max_steps};
use super::submissions::{MAX_WORK, Submissions};
use super::tables::Tables;
use crate::model::Model;
use crate::model::particles::Particles;
use crate::model::receiver::ReceiverKind;
use crate::motion::request_counts::RequestCounts;
use crate::random::philox::Key;
use crate::release::origins::{Arrival, Origins};
use crate::release::rank_slice::RankSlice;
use crate::release::{PartialEvents, ReleasedParticles};
use crate::state::RankStart;
use crate::{Error, State, Totals};

mod events;
mod flow;
mod overflow;
mod readback;
mod receivers;
mod releases;
mod shared_step;
mod tallies;
#[cfg(test)]
mod tests;
mod transfer;

use readback::Readback;
pub(crate) use shared_step::ReceptorRequests;

/// A run on a GPU. Its [`state`](Self::state) also resumes a [`Simulation`](crate::Simulation).
#[derive(Debug)]
pub struct GpuSimulation {
    model: Model,
    key: Key,
    slice: RankSlice,
    partial_events: PartialEvents,
    tables: Tables,
    /// Fraction of a step with the flow of `tables`.
    flow_fraction: f64,
    ligands: Vec<LigandRow>,
    trajectory: ReceiverTrajectory,
    cells_builder: ReceiverCellsBuilder,
    cells: ReceiverCellsHeader,
    centers: Vec<[f32; 3]>,
    buffers: RunBuffers,
    detectors: Detectors,
    cell_ratio: f32,
    options: GpuOptions,
    steps: StepDispatches,
    alive: u32,
    /// Particles not yet on the device.
    due: Particles,
    step: u32,
    next_id: u32,
    totals: Totals,
    inside: Vec<Vec<u64>>,
    pairs: Vec<u64>,
    requests: RequestCounts,
    origins: Origins,
    arrivals: Vec<Arrival>,
    /// Error after submitted steps: the device's state is later than the host's.
    failure: Option<String>,
}

struct Burst {
    step: u32,
    released: ReleasedParticles,
}

/// With random priorities, rounds grow as the logarithm of the candidates.
const MAX_ROUNDS: u32 = 512;
const MAX_SUBMITTED_STEPS: u64 = 64;
/// With collisions, steps after a halt are wasted.
const MAX_STEPS_WITH_COLLISIONS: u32 = 16;
const FIRST_WINDOW_ROUNDS: u32 = 8;

impl GpuSimulation {
    /// Begins a run on a device.
    ///
    /// # Errors
    /// [`Error::Model`] for an invalid model, [`Error::NotOnGpu`] for features without kernels, and [`Error::Detection`]
    /// if the device fails or has too little memory.
    pub fn new(model: Model, seed: u64, device: GpuDevice, options: GpuOptions) -> Result<Self, Error> {
        let state = State::new(&model, seed)?;
        Self::resume(model, seed, device, options, &state)
    }

    /// Resumes a run from a state of the same model and seed.
    ///
    /// # Errors
    /// See [`new`](Self::new).
    pub fn resume(
        model: Model,
        seed: u64,
        device: GpuDevice,
        options: GpuOptions,
        state: &State,
    ) -> Result<Self, Error> {
        Self::resume_slice(model, device, options, RankStart { seed, state, slice: RankSlice::WHOLE })
    }

    /// Releases only the particles of `slice`, from a [`State::into_rank_state`].
    pub(crate) fn resume_slice(
        model: Model,
        device: GpuDevice,
        options: GpuOptions,
        RankStart { seed, state, slice }: RankStart<'_>,
    ) -> Result<Self, Error> {
        model.check()?;
        check(&model)?;
        if !state.belongs_to(&model) {
            return Err(Error::Model("the state is one of another model".to_owned()));
        }
        let key = Key::new(seed);
        let tables = Tables::new(&model, key, options.max_iterations.min(MAX_LOOP_ITERATIONS));
        let mut cells_builder =
            ReceiverCellsBuilder::new(&tables.species_rows, &tables.event_rows, model.boundary);
        let mut buffers = RunBuffers::new(device, &tables, cells_builder.max_words())?;
        let alive = (state.particles.len() + state.bound.len()) as u32;
        let lists = tables.params.lists_pairs != 0;
        let collides = tables.params.collides != 0;
        let sizes = Sizes {
            particles: grow(alive),
            pairs: if lists { options.pair_capacity.max(1) } else { 0 },
            births: if tables.dissociates() { options.birth_capacity.clamp(1, MAX_BIRTHS) } else { 0 },
            events: if model.logs_arrivals { options.event_capacity.max(1) } else { 0 },
            has_velocity: model.has_velocity(),
            near: if collides { options.pair_capacity.max(1) } else { 0 },
            windows: u32::from(collides),
            window_rounds: FIRST_WINDOW_ROUNDS,
            speed_doublings: 0,
        };
        let mut detectors = Detectors::new(&buffers.gpu, &model, sizes)?;
        let steps = StepDispatches::new(&mut buffers, sizes, options.rounds, detectors.reserve(sizes)?)?;
        let receiver_cells = match has_moving_receivers(&model) {
            true => ReceiverCells::default(),
            false => cells_builder.build(&state.centers, &[], 0.0)?,
        };
        buffers.upload_cells(&receiver_cells)?;
        let mut simulation = Self {
            key,
            slice,
            partial_events: PartialEvents::new(&model),
            ligands: tables.ligands(),
            tables,
            flow_fraction: 1.0,
            trajectory: ReceiverTrajectory::new(&model, key, &state.centers, state.step, 0),
            cells: receiver_cells.head,
            cells_builder,
            centers: state.centers.clone(),
            buffers,
            detectors,
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
            requests: RequestCounts::default(),
            origins: state.restored_origins(&model, key),
            arrivals: Vec::new(),
            failure: None,
            model,
        };
        simulation.buffers.upload_trajectory(&simulation.trajectory, simulation.cells)?;
        simulation.upload(state)?;
        let read = simulation.read(simulation.encoder(), alive)?;
        simulation.record(read, &[], None)?;
        Ok(simulation)
    }

    pub fn model(&self) -> &Model {
        &self.model
    }

    pub fn step_count(&self) -> u32 {
        self.step
    }

    pub fn time(&self) -> f64 {
        f64::from(self.step) * self.model.time_step
    }

    pub fn seed(&self) -> u64 {
        self.key.seed()
    }

    pub fn totals(&self) -> &Totals {
        &self.totals
    }

    pub(crate) fn requests(&self) -> &RequestCounts {
        &self.requests
    }

    /// Pairs in each step of the last [`run`](Self::run).
    pub fn pairs_by_step(&self) -> &[u64] {
        &self.pairs
    }

    /// Arrivals of the last [`run`](Self::run) by step and id, in a model that logs them.
    pub fn arrivals(&self) -> &[Arrival] {
        &self.arrivals
    }

    /// Counts by receiver and species: arrivals so far, or the number inside.
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

    /// Runs `steps` steps, with a readback at their end and at least every 1,024 steps.
    ///
    /// # Errors
    /// [`Error::OutOfIds`], [`Error::NotFinite`], and [`Error::Step`] if pairs or particles exceed the device's
    /// capacity. The run is then at the beginning of the failed step. After an error of the device with steps submitted,
    /// this and [`state`](Self::state) return [`Error::UnknownState`].
    pub fn run(&mut self, steps: u32) -> Result<(), Error> {
        self.check_state()?;
        self.pairs.clear();
        self.arrivals.clear();
        let end = self.step.saturating_add(steps);
        while self.step < end {
            let step = self.step;
            let (read, bursts) = self.run_batch(end - step)?;
            let head = read.head;
            self.record(read, &bursts, None)?;
            if self.step > step {
                self.reset_top_speed()?;
            }
            let recovered = self.recover(head);
            recovered.map_err(|error| error_at(self.step, error))?;
        }
        Ok(())
    }

    /// Reads back, but does not record the results.
    fn run_batch(&mut self, step_limit: u32) -> Result<(Readback, Vec<Burst>), Error> {
        let step_limit = step_limit.min(max_steps(&self.model)).min(self.steps_per_readback());
        let step_limit = if self.steps.sizes.speed_doublings > 0 { 1 } else { step_limit };
        let step_limit = self.steps_of_flow(step_limit);
        let bursts = self.bursts(step_limit)?;
        // A dissociation may change the ids of the release.
        let step_limit = match bursts.first() {
            Some(burst) if self.tables.dissociates() => burst.step - self.step,
            _ => step_limit,
        };
        self.reserve_for(&bursts)?;
        // More capacity leaves fewer steps until a tally may overflow.
        let read = self.submit(step_limit.min(self.steps_per_readback()), &bursts)?;
        Ok((read, bursts))
    }

    fn reserve_for(&mut self, bursts: &[Burst]) -> Result<(), Error> {
        let added = bursts.iter().map(|burst| burst.released.particles.len()).sum::<usize>() + self.due.len();
        let reserved = self.reserve(self.alive.saturating_add(added as u32));
        reserved.map_err(|error| error_at(self.step, error))
    }

    pub(super) fn check_state(&self) -> Result<(), Error> {
        self.failure.clone().map_or(Ok(()), |reason| Err(Error::UnknownState { reason }))
    }

    fn encoder(&self) -> wgpu::CommandEncoder {
        self.buffers.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default())
    }

    fn steps_per_readback(&self) -> u32 {
        let step_limit = steps_per_readback(self.steps.sizes.particles, self.tables.max_counts);
        if self.steps.sizes.near > 0 { step_limit.min(MAX_STEPS_WITH_COLLISIONS) } else { step_limit }
    }

    fn submit(&mut self, steps: u32, bursts: &[Burst]) -> Result<Readback, Error> {
        self.prepare_receivers(steps)?;
        self.prepare_flow()?;
        let mut submissions = Submissions::new(self.buffers.gpu.clone());
        let recorded = self.encode_steps(&mut submissions, steps, bursts);
        let is_ahead = recorded.is_ok() || submissions.has_submitted();
        let read = recorded.and_then(|particles| self.read(submissions.finish(), particles));
        if is_ahead { self.or_fail(read) } else { read }
    }

    fn or_fail<T>(&mut self, result: Result<T, Error>) -> Result<T, Error> {
        if let Err(error) = &result {
            self.failure = Some(error.to_string());
        }
        result
    }

    /// Bounds the final number of particles.
    fn encode_steps(
        &mut self,
        submissions: &mut Submissions,
        steps: u32,
        bursts: &[Burst],
    ) -> Result<u32, Error> {
        // A repeated step needs the same particles.
        let due = self.due.clone();
        let mut bursts_left = bursts.iter().peekable();
        let mut particles = self.alive;
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
            if self.tables.dissociates() {
                particles = self.steps.sizes.particles;
            }
            self.steps.encode_begin(submissions.encoder(), burst.as_ref(), particles);
            self.encode_collisions(submissions, particles)?;
            self.steps.encode_motion(submissions.encoder(), particles);
            let Sizes { particles: at_most, pairs, .. } = self.steps.sizes;
            if let Some(detector) = &mut self.detectors.interactions {
                let count = SphereCount::Buffer { buffer: self.buffers.buffer("control"), at_most };
                let input = GpuSpheres::new(self.steps.buffer("moved"), count)
                    .with_species(self.steps.buffer("species"));
                submissions.encode_search(detector, &input)?;
            }
            self.steps.encode_after(submissions.encoder(), particles);
            let work = u64::from(particles) + u64::from(pairs);
            submissions.add_work(work.max(MAX_WORK / MAX_SUBMITTED_STEPS))?;
        }
        Ok(particles)
    }

    fn encode_collisions(&mut self, submissions: &mut Submissions, particles: u32) -> Result<(), Error> {
        let Some(detector) = &mut self.detectors.candidates else { return Ok(()) };
        self.steps.encode_collisions(submissions.encoder(), particles);
        let Sizes { windows, particles: at_most, .. } = self.steps.sizes;
        for _ in 0..windows {
            self.steps.encode_window(submissions.encoder(), particles);
            let count = SphereCount::Buffer { buffer: self.buffers.buffer("window"), at_most };
            let mut input = GpuSpheres::new(self.steps.buffer("inflated"), count);
            if detector.has_interactions() {
                input = input.with_species(self.steps.buffer("species"));
            }
            submissions.encode_search(detector, &input)?;
            self.steps.encode_rounds(submissions, particles)?;
        }
        Ok(())
    }
}

fn error_at(step: u32, error: Error) -> Error {
    match error {
        Error::Detection(source) => Error::Step { step, source },
        other => other,
    }
}
