use std::collections::HashMap;

use lazygrid::gpu::{DeviceLimits, GpuDevice, GpuOutput, Outcome, wgpu};

use super::detectors::DetectorOutputs;
use super::device::{buffer, encoded, filled, refused, with_error_scope};
use super::kernel::{self as k, Kernel, Variant};
use super::layout::{ControlHeader, ReceiverCellsHeader, TrajectoryHeader, WINDOW_BYTES};
use super::plan::{LOG_ROWS, Sizes, groups_for};
use super::receiver_cells::ReceiverCells;
use super::receiver_trajectory::ReceiverTrajectory;
use super::scene_rows::ROW_BYTES;
use super::tables::Tables;
use crate::Error;

mod contact;
mod motion;
use contact::{CollisionStages, separation_stages};
use motion::MotionStages;

#[derive(Debug)]
pub(super) struct RunBuffers {
    pub(super) gpu: GpuDevice,
    pub(super) limits: DeviceLimits,
    counts_inside: bool,
    reflects: bool,
    variant: Variant,
    receptors: u32,
    dissociates: bool,
    reacts: bool,
    separates: bool,
    pub(super) max_requeries: u32,
    cells_at: u64,
    buffers: HashMap<&'static str, wgpu::Buffer>,
    pipelines: HashMap<&'static str, (wgpu::ComputePipeline, wgpu::BindGroupLayout)>,
}

#[derive(Debug)]
pub(super) struct Stage {
    pipeline: wgpu::ComputePipeline,
    bindings: wgpu::BindGroup,
    groups: Groups,
}

#[derive(Clone, Copy, Debug)]
pub(super) enum Groups {
    Fixed(u32),
    Items(u32),
    Particles,
    Pairs,
    Candidates,
}

#[cfg(test)]
impl Stage {
    pub(super) fn encode(&self, encoder: &mut wgpu::CommandEncoder, groups: u32) {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.bindings, &[]);
        pass.dispatch_workgroups(groups, 1, 1);
    }
}

impl RunBuffers {
    pub(super) fn new(gpu: GpuDevice, tables: &Tables, lists: usize) -> Result<Self, Error> {
        let tallies = tables.tallies.len() as u64;
        let mut buffers = HashMap::new();
        let mut keep = |name, buffer: wgpu::Buffer| drop(buffers.insert(name, buffer));
        keep("params", filled(&gpu, "params", &tables.params)?);
        keep("species_rows", filled(&gpu, "species_rows", &tables.species_rows)?);
        keep("event_rows", filled(&gpu, "event_rows", &tables.event_rows)?);
        keep("dissociation_rows", filled(&gpu, "dissociation_rows", &tables.dissociation_rows)?);
        keep("reaction_rows", filled(&gpu, "reaction_rows", &tables.reaction_rows)?);
        keep("occupancy_rows", filled(&gpu, "occupancy_rows", &tables.occupancy_rows)?);
        keep("receptors", filled(&gpu, "receptors", &tables.receptors)?);
        let cells_at = tables.scene_rows.cells_at();
        keep("scene_rows", tables.scene_rows.create(&gpu, lists)?);
        keep("trajectory", filled(&gpu, "trajectory", &TrajectoryHeader::default())?);
        keep("round0", filled(&gpu, "round", &[0u32; 4])?);
        keep("round1", filled(&gpu, "round", &[1u32, 0, 0, 0])?);
        keep("same_order", filled(&gpu, "output_order", &[0u32; 4])?);
        keep("cell_order", filled(&gpu, "output_order", &[1u32, 0, 0, 0])?);
        keep("control", buffer(&gpu, "control", size_of::<ControlHeader>() as u64 + 8 * tallies)?);
        keep("window", buffer(&gpu, "window", WINDOW_BYTES)?);
        keep("inside", buffer(&gpu, "inside", 4 * tallies)?);
        keep("log", buffer(&gpu, "log", 8 * u64::from(LOG_ROWS))?);
        let limits = DeviceLimits::from_device(&gpu.device);
        let counts_inside = !tables.occupancy_rows.is_empty();
        if tables.reflects && limits.storage_buffers < k::SURFACE_BUFFERS {
            let (has, needed) = (limits.storage_buffers, k::SURFACE_BUFFERS);
            let what = format!(
                "surfaces that reflect particles: they need {needed} storage buffers per stage, and this device has {has}"
            );
            return Err(Error::NotOnGpu { what });
        }
        Ok(Self {
            gpu,
            limits,
            counts_inside,
            reflects: tables.reflects,
            variant: tables.variant,
            receptors: tables.receptors.len() as u32,
            dissociates: tables.dissociates(),
            reacts: tables.tallies.reactions > 0,
            separates: tables.params.collides > tables.params.is_elastic,
            max_requeries: tables.params.max_requeries,
            cells_at,
            buffers,
            pipelines: HashMap::new(),
        })
    }

    pub(super) fn buffer(&self, name: &str) -> &wgpu::Buffer {
        &self.buffers[name]
    }

    pub(super) fn upload_flow(&self, tables: &Tables) -> Result<(), Error> {
        let (params, species_rows) = (encoded(&tables.params), encoded(&tables.species_rows));
        with_error_scope(&self.gpu, "the flow", 0, || {
            self.gpu.queue.write_buffer(self.buffer("params"), 0, &params);
            self.gpu.queue.write_buffer(self.buffer("species_rows"), 0, &species_rows);
        })
    }

    pub(super) fn upload_cells(&self, receiver_cells: &ReceiverCells) -> Result<(), Error> {
        let words = bytemuck::cast_slice(&receiver_cells.words);
        with_error_scope(&self.gpu, "lists of receivers", 0, || {
            self.gpu.queue.write_buffer(self.buffer("scene_rows"), self.cells_at, words);
        })
    }

    pub(super) fn upload_trajectory(
        &self,
        trajectory: &ReceiverTrajectory,
        cells: ReceiverCellsHeader,
    ) -> Result<(), Error> {
        let cells_at = (self.cells_at / ROW_BYTES) as u32;
        let head = encoded(&TrajectoryHeader { cells_at, cells, ..trajectory.head });
        let rows = encoded(&trajectory.rows);
        with_error_scope(&self.gpu, "positions of receivers", 0, || {
            self.gpu.queue.write_buffer(self.buffer("trajectory"), 0, &head);
            self.gpu.queue.write_buffer(self.buffer("scene_rows"), 0, &rows);
        })
    }

    pub(super) fn stage(
        &mut self,
        kernel: &'static Kernel,
        groups: Groups,
        find: impl Fn(&'static str) -> wgpu::Buffer,
    ) -> Result<Stage, Error> {
        if !self.pipelines.contains_key(kernel.name) {
            let accesses = kernel.bindings.iter().map(|&(_, access)| access);
            // SAFETY: the kernel is one of this crate, and `kernels/tests/loops.rs` checks that each loop of its text
            // ends.
            let pipeline = unsafe { self.gpu.compile(kernel.name, accesses, kernel.wgsl(self.variant)) }
                .map_err(refused)?;
            self.pipelines.insert(kernel.name, pipeline);
        }
        let (pipeline, layout) = self.pipelines[kernel.name].clone();
        let buffers: Vec<_> = kernel.bindings.iter().map(|&(name, _)| find(name)).collect();
        let entries: Vec<_> = (0..)
            .zip(&buffers)
            .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
            .collect();
        let descriptor =
            wgpu::BindGroupDescriptor { label: Some(kernel.name), layout: &layout, entries: &entries };
        let bindings =
            with_error_scope(&self.gpu, kernel.name, 0, || self.gpu.device.create_bind_group(&descriptor))?;
        Ok(Stage { pipeline, bindings, groups })
    }
}

#[derive(Debug)]
pub(super) struct StepDispatches {
    pub(super) sizes: Sizes,
    limits: DeviceLimits,
    buffers: HashMap<&'static str, wgpu::Buffer>,
    begin: Vec<Stage>,
    collisions: CollisionStages,
    motion: MotionStages,
    /// Empty without a detector.
    sampling: Vec<Stage>,
    matching: Vec<Stage>,
    separation: Vec<Stage>,
    after: Vec<Stage>,
    census: Option<Stage>,
}

const SIZED_BUFFERS: [&str; 20] = [
    "born",
    "born_keys0",
    "born_keys1",
    "events",
    "spheres",
    "tags",
    "moved",
    "species",
    "ids",
    "claims",
    "sums",
    "candidates",
    "left0",
    "left1",
    "requesters",
    "movers",
    "next_events",
    "inflated",
    "neighbors",
    "pushes",
];

impl StepDispatches {
    pub(super) fn new(
        run: &mut RunBuffers,
        sizes: Sizes,
        rounds: u32,
        found: DetectorOutputs,
    ) -> Result<Self, Error> {
        let mut buffers = run.buffers.clone();
        for name in SIZED_BUFFERS {
            let sizes = if name == "requesters" && run.receptors == 0 { Sizes::default() } else { sizes };
            let bytes = sizes.bytes(name, &run.limits).map_err(refused)?;
            buffers.insert(name, buffer(&run.gpu, name, bytes)?);
        }
        let detects = found.interactions.is_some();
        let mut order = None;
        if let Some(GpuOutput { pairs, outcome, .. }) = found.candidates {
            buffers.insert("near_pairs", pairs);
            buffers.insert("near_outcome", outcome);
        }
        if let Some(GpuOutput { pairs, outcome, sorted, .. }) = found.interactions {
            buffers.insert("pairs", pairs);
            buffers.insert("outcome", outcome);
            order = sorted.map(|sorted| sorted.order);
        }
        let output_order = if order.is_some() { "cell_order" } else { "same_order" };
        buffers.insert("output_order", buffers[output_order].clone());
        buffers.insert("order", order.unwrap_or_else(|| buffers["species_rows"].clone()));
        let (limits, counts_inside) = (run.limits, run.counts_inside);
        let dissociates = run.dissociates;
        let motion = MotionStages::new(run, |name| buffers[name].clone())?;
        let mut stage =
            |kernel: &'static Kernel, groups: Groups| run.stage(kernel, groups, |name| buffers[name].clone());
        let begin = vec![stage(&k::STEP_BEGIN, Groups::Fixed(1))?];
        let mut after = vec![
            stage(&k::SURVIVORS_COUNT, Groups::Particles)?,
            stage(&k::SURVIVORS_SCAN, Groups::Fixed(1))?,
            stage(&k::SURVIVORS_PLACE, Groups::Particles)?,
        ];
        if dissociates {
            after.insert(0, stage(&k::PARTICLES_DISSOCIATE, Groups::Particles)?);
            after.push(stage(&k::BORN_SORT, Groups::Fixed(1))?);
            after.push(stage(&k::BORN_PLACE, Groups::Items(sizes.births))?);
        }
        let census = counts_inside.then(|| stage(&k::RECEIVERS_COUNT, Groups::Particles)).transpose()?;
        let (mut sampling, mut matching, mut separation) = (Vec::new(), Vec::new(), Vec::new());
        if detects {
            sampling.push(stage(&k::DETECTOR_CHECK, Groups::Fixed(1))?);
            if sizes.pairs > 0 && run.reacts {
                let first = |name| buffers[alternating(name, 0)].clone();
                sampling.push(run.stage(&k::REACTIONS_SAMPLE, Groups::Pairs, first)?);
                matching = match_stages(run, &buffers, sizes, rounds)?;
            }
            if run.separates {
                separation = separation_stages(run, |name| buffers[name].clone())?;
            }
        }
        let collisions = match sizes.near {
            0 => CollisionStages::default(),
            _ => CollisionStages::new(run, sizes, |name| buffers[name].clone())?,
        };
        Ok(Self {
            sizes,
            limits,
            buffers,
            begin,
            collisions,
            motion,
            sampling,
            matching,
            separation,
            after,
            census,
        })
    }

    pub(super) fn buffer(&self, name: &str) -> &wgpu::Buffer {
        &self.buffers[name]
    }

    pub(super) fn are_bound_to(&self, found: &DetectorOutputs) -> bool {
        let is_bound = |found: &GpuOutput| {
            let order = found.sorted.as_ref().is_none_or(|sorted| sorted.order == *self.buffer("order"));
            order && found.outcome == *self.buffer("outcome")
        };
        found.interactions.as_ref().is_none_or(is_bound)
            && found.candidates.as_ref().is_none_or(|found| found.outcome == *self.buffer("near_outcome"))
    }

    pub(super) fn encode_begin(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        burst: Option<&Stage>,
        particles: u32,
    ) {
        self.encode(encoder, burst.into_iter().chain(&self.begin), particles);
    }

    pub(super) fn encode_after(&self, encoder: &mut wgpu::CommandEncoder, particles: u32) {
        let stages = self.sampling.iter().chain(&self.matching).chain(&self.separation).chain(&self.after);
        self.encode(encoder, stages, particles);
    }

    #[cfg(test)]
    pub(super) fn encode_matching(&self, encoder: &mut wgpu::CommandEncoder) {
        self.encode(encoder, &self.matching, self.sizes.particles);
    }

    pub(super) fn encode_census(&self, encoder: &mut wgpu::CommandEncoder, particles: u32) {
        encoder.clear_buffer(self.buffer("inside"), 0, None);
        self.encode(encoder, &self.census, particles);
    }

    fn encode<'a>(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        stages: impl IntoIterator<Item = &'a Stage>,
        particles: u32,
    ) {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        for stage in stages {
            pass.set_pipeline(&stage.pipeline);
            pass.set_bind_group(0, &stage.bindings, &[]);
            let items = match stage.groups {
                Groups::Fixed(groups) => {
                    pass.dispatch_workgroups(groups, 1, 1);
                    continue;
                }
                Groups::Pairs => {
                    pass.dispatch_workgroups_indirect(self.buffer("outcome"), Outcome::DISPATCH_OFFSET);
                    continue;
                }
                Groups::Candidates => {
                    pass.dispatch_workgroups_indirect(self.buffer("near_outcome"), Outcome::DISPATCH_OFFSET);
                    continue;
                }
                Groups::Items(items) => items,
                Groups::Particles => particles,
            };
            let [x, y] = groups_for(items, &self.limits);
            pass.dispatch_workgroups(x, y, 1);
        }
    }
}

fn alternating(name: &'static str, source: u32) -> &'static str {
    match (name, source) {
        ("round", 0) => "round0",
        ("round", _) => "round1",
        ("left", 0) | ("left_next", 1) => "left0",
        ("left" | "left_next", _) => "left1",
        (other, _) => other,
    }
}

fn match_stages(
    run: &mut RunBuffers,
    buffers: &HashMap<&'static str, wgpu::Buffer>,
    sizes: Sizes,
    rounds: u32,
) -> Result<Vec<Stage>, Error> {
    let mut stages = Vec::new();
    let groups = Groups::Fixed(sizes.round_groups());
    for round in 0..rounds {
        for kernel in
            [&k::MATCHING_COMPACT, &k::MATCHING_PROPOSE, &k::MATCHING_BREAK_TIES, &k::MATCHING_APPLY]
        {
            stages.push(run.stage(kernel, groups, |name| buffers[alternating(name, round % 2)].clone())?);
        }
    }
    let rest = |name| buffers[alternating(name, rounds % 2)].clone();
    stages.push(run.stage(&k::MATCHING_FINISH, Groups::Fixed(1), rest)?);
    Ok(stages)
}
