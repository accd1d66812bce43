//! The dispatches of a step, with everything bound.

use std::collections::HashMap;

use encase::ShaderType;
use lazygrid::gpu::{DeviceLimits, GpuDevice, GpuOutput, Outcome, wgpu};

use super::device::{buffer, encoded, filled, refused, with_error_scope};
use super::journey::Itinerary;
use super::kernel::{self as k, Kernel};
use super::layout::{Body, Head, Journey, Lists};
use super::nearby::Nearby;
use super::plan::{LOG_ROWS, Sizes, groups_for};
use super::tables::Tables;
use crate::Error;

/// The buffers of fixed size, and the kernels compiled so far.
#[derive(Debug)]
pub(super) struct Base {
    pub(super) own: GpuDevice,
    pub(super) limits: DeviceLimits,
    /// `true` if there are transparent receivers.
    watches: bool,
    /// `true` if some surfaces turn particles back.
    reflects: bool,
    /// Receivers, where some have receptors.
    receptors: u32,
    /// Bytes in front of the lists of receivers.
    lists_at: u64,
    buffers: HashMap<&'static str, wgpu::Buffer>,
    pipelines: HashMap<&'static str, (wgpu::ComputePipeline, wgpu::BindGroupLayout)>,
}

/// One dispatch.
#[derive(Debug)]
pub(super) struct Stage {
    pipeline: wgpu::ComputePipeline,
    bindings: wgpu::BindGroup,
    groups: Groups,
}

/// The number of workgroups of a stage.
#[derive(Clone, Copy, Debug)]
pub(super) enum Groups {
    /// These.
    Fixed(u32),
    /// For a thread for each of so many items.
    Items(u32),
    /// For a thread for each particle.
    Particles,
    /// For a thread for each pair, as the detector says.
    Pairs,
}

#[cfg(test)]
impl Stage {
    /// Records this dispatch alone, with so many workgroups.
    pub(super) fn encode(&self, encoder: &mut wgpu::CommandEncoder, groups: u32) {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.bindings, &[]);
        pass.dispatch_workgroups(groups, 1, 1);
    }
}

impl Base {
    /// With room for so many words of lists of receivers.
    pub(super) fn new(own: GpuDevice, tables: &Tables, lists: usize) -> Result<Self, Error> {
        let tallies = tables.tallies.len() as u64;
        let mut buffers = HashMap::new();
        let mut keep = |name, made: wgpu::Buffer| drop(buffers.insert(name, made));
        keep("params", filled(&own, "params", &tables.params)?);
        keep("kinds", filled(&own, "kinds", &tables.kinds)?);
        keep("fates", filled(&own, "fates", &tables.fates)?);
        keep("rules", filled(&own, "rules", &tables.rules)?);
        keep("watches", filled(&own, "watches", &tables.watches)?);
        keep("receptors", filled(&own, "receptors", &tables.receptors)?);
        let lists_at = tables.bodies as u64 * Body::min_size().get();
        keep("bodies", buffer(&own, "bodies", lists_at + 4 * lists as u64)?);
        keep("journey", filled(&own, "journey", &Journey::default())?);
        keep("round0", filled(&own, "round", &[0u32; 4])?);
        keep("round1", filled(&own, "round", &[1u32, 0, 0, 0])?);
        keep("unlisted", filled(&own, "listing", &[0u32; 4])?);
        keep("listed", filled(&own, "listing", &[1u32, 0, 0, 0])?);
        keep("control", buffer(&own, "control", size_of::<Head>() as u64 + 8 * tallies)?);
        keep("inside", buffer(&own, "inside", 4 * tallies)?);
        keep("log", buffer(&own, "log", 8 * u64::from(LOG_ROWS))?);
        let limits = DeviceLimits::of(&own.device);
        let watches = !tables.watches.is_empty();
        if tables.reflects && limits.storage_buffers < k::SURFACE_BUFFERS {
            let (has, needed) = (limits.storage_buffers, k::SURFACE_BUFFERS);
            let what = format!(
                "surfaces that turn particles back on this device, which binds {has} storage buffers in a stage and \
                 would need {needed}"
            );
            return Err(Error::NotOnGpu { what });
        }
        Ok(Self {
            own,
            limits,
            watches,
            reflects: tables.reflects,
            receptors: tables.receptors.len() as u32,
            lists_at,
            buffers,
            pipelines: HashMap::new(),
        })
    }

    pub(super) fn buffer(&self, name: &str) -> &wgpu::Buffer {
        &self.buffers[name]
    }

    /// Hands over which receivers are near each cell.
    pub(super) fn list(&self, nearby: &Nearby) -> Result<(), Error> {
        let words = bytemuck::cast_slice(&nearby.words);
        with_error_scope(&self.own, "which receivers are near", 0, || {
            self.own.queue.write_buffer(self.buffer("bodies"), self.lists_at, words);
        })
    }

    /// Hands over where receivers are, and by which cells they are listed.
    pub(super) fn take_up(&self, itinerary: &Itinerary, lists: Lists) -> Result<(), Error> {
        let lists_at = (self.lists_at / 16) as u32;
        let head = encoded(&Journey { lists_at, lists, ..itinerary.head });
        let rows = encoded(&itinerary.rows);
        with_error_scope(&self.own, "where receivers are", 0, || {
            self.own.queue.write_buffer(self.buffer("journey"), 0, &head);
            self.own.queue.write_buffer(self.buffer("bodies"), 0, &rows);
        })
    }

    /// A kernel with its buffers, which `find` knows by name.
    pub(super) fn stage(
        &mut self,
        kernel: &'static Kernel,
        groups: Groups,
        find: impl Fn(&'static str) -> wgpu::Buffer,
    ) -> Result<Stage, Error> {
        if !self.pipelines.contains_key(kernel.name) {
            let accesses = kernel.bindings.iter().map(|&(_, access)| access);
            let made = self.own.compile(kernel.name, accesses, kernel.wgsl()).map_err(refused)?;
            self.pipelines.insert(kernel.name, made);
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
            with_error_scope(&self.own, kernel.name, 0, || self.own.device.create_bind_group(&descriptor))?;
        Ok(Stage { pipeline, bindings, groups })
    }
}

/// The dispatches of a step for certain sizes.
#[derive(Debug)]
pub(super) struct Steps {
    pub(super) sizes: Sizes,
    limits: DeviceLimits,
    buffers: HashMap<&'static str, wgpu::Buffer>,
    /// The stages before the detection.
    before: Vec<Stage>,
    /// From pairs to candidates; nothing where nothing is detected.
    drawing: Vec<Stage>,
    matching: Vec<Stage>,
    /// The stages at the end of a step.
    after: Vec<Stage>,
    /// Counts what is inside transparent receivers, if there are any.
    census: Option<Stage>,
}

/// Buffers that depend on the sizes.
const SIZED: [&str; 11] = [
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
    "bidders",
];

impl Steps {
    /// Allocates and binds. The detector has its buffers for these sizes already.
    pub(super) fn new(
        base: &mut Base,
        sizes: Sizes,
        rounds: u32,
        found: Option<GpuOutput>,
    ) -> Result<Self, Error> {
        let mut buffers = base.buffers.clone();
        for name in SIZED {
            // Nobody is to bind if there are no receptors.
            let sizes = if name == "bidders" && base.receptors == 0 { Sizes::default() } else { sizes };
            let bytes = sizes.bytes(name, &base.limits).map_err(refused)?;
            buffers.insert(name, buffer(&base.own, name, bytes)?);
        }
        let detects = found.is_some();
        let mut order = None;
        if let Some(GpuOutput { pairs, outcome, sorted, .. }) = found {
            buffers.insert("pairs", pairs);
            buffers.insert("outcome", outcome);
            order = sorted.map(|sorted| sorted.order);
        }
        let listing = if order.is_some() { "listed" } else { "unlisted" };
        buffers.insert("listing", buffers[listing].clone());
        // If there is no order nobody reads it.
        buffers.insert("order", order.unwrap_or_else(|| buffers["kinds"].clone()));
        let (limits, watches) = (base.limits, base.watches);
        let (reflects, receptors) = (base.reflects, base.receptors);
        let mut stage = |kernel: &'static Kernel, groups: Groups| {
            base.stage(kernel, groups, |name| buffers[name].clone())
        };
        let mut before = vec![stage(&k::STEP_BEGIN, Groups::Fixed(1))?];
        if receptors > 0 {
            before.push(stage(&k::RECEPTORS_BEGIN, Groups::Fixed(1))?);
            before.push(stage(&k::RECEPTORS_HOLD, Groups::Particles)?);
        }
        let moving = if reflects { &k::PARTICLES_TURN } else { &k::PARTICLES_MOVE };
        before.push(stage(moving, Groups::Particles)?);
        if receptors > 0 {
            before.push(stage(&k::RECEPTORS_SCAN, Groups::Fixed(1))?);
            before.push(stage(&k::RECEPTORS_GROUP, Groups::Particles)?);
            before.push(stage(&k::RECEPTORS_CHOOSE, Groups::Fixed(receptors))?);
        }
        let after = vec![
            stage(&k::SURVIVORS_COUNT, Groups::Particles)?,
            stage(&k::SURVIVORS_SCAN, Groups::Fixed(1))?,
            stage(&k::SURVIVORS_PLACE, Groups::Particles)?,
        ];
        let census = watches.then(|| stage(&k::RECEIVERS_COUNT, Groups::Particles)).transpose()?;
        let (mut drawing, mut matching) = (Vec::new(), Vec::new());
        if detects {
            drawing.push(stage(&k::PAIRS_CHECK, Groups::Fixed(1))?);
            if sizes.pairs > 0 {
                let left = |name| buffers[listed(name, 0)].clone();
                drawing.push(base.stage(&k::CANDIDATES_DRAW, Groups::Pairs, left)?);
                matching = match_stages(base, &buffers, sizes, rounds)?;
            }
        }
        Ok(Self { sizes, limits, buffers, before, drawing, matching, after, census })
    }

    pub(super) fn buffer(&self, name: &str) -> &wgpu::Buffer {
        &self.buffers[name]
    }

    /// Returns `true` if they read what a detector leaves there.
    pub(super) fn are_bound_to(&self, found: &GpuOutput) -> bool {
        let order = found.sorted.as_ref().is_none_or(|sorted| sorted.order == *self.buffer("order"));
        order && found.outcome == *self.buffer("outcome")
    }

    /// Records what comes before the detection, with room for up to `particles` particles.
    pub(super) fn encode_before(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        burst: Option<&Stage>,
        particles: u32,
    ) {
        self.encode(encoder, burst.into_iter().chain(&self.before), particles);
    }

    /// Records what comes behind the detection.
    pub(super) fn encode_after(&self, encoder: &mut wgpu::CommandEncoder, particles: u32) {
        let stages = self.drawing.iter().chain(&self.matching).chain(&self.after);
        self.encode(encoder, stages, particles);
    }

    /// Records the matching alone.
    #[cfg(test)]
    pub(super) fn encode_matching(&self, encoder: &mut wgpu::CommandEncoder) {
        self.encode(encoder, &self.matching, self.sizes.particles);
    }

    /// Records the count of what is inside transparent receivers.
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
                Groups::Items(items) => items,
                Groups::Particles => particles,
            };
            let [x, y] = groups_for(items, &self.limits);
            pass.dispatch_workgroups(x, y, 1);
        }
    }
}

/// The buffer that a binding of the matching means: its two lists change places from round to round.
fn listed(name: &'static str, source: u32) -> &'static str {
    match (name, source) {
        ("round", 0) => "round0",
        ("round", _) => "round1",
        ("left", 0) | ("left_next", 1) => "left0",
        ("left" | "left_next", _) => "left1",
        (other, _) => other,
    }
}

/// Rounds of the whole device, and what one workgroup does about the rest.
fn match_stages(
    base: &mut Base,
    buffers: &HashMap<&'static str, wgpu::Buffer>,
    sizes: Sizes,
    rounds: u32,
) -> Result<Vec<Stage>, Error> {
    let mut stages = Vec::new();
    let groups = Groups::Fixed(sizes.round_groups());
    for round in 0..rounds {
        for kernel in [&k::MATCHING_OPEN, &k::MATCHING_PROPOSE, &k::MATCHING_TIE, &k::MATCHING_SETTLE] {
            stages.push(base.stage(kernel, groups, |name| buffers[listed(name, round % 2)].clone())?);
        }
    }
    let rest = |name| buffers[listed(name, rounds % 2)].clone();
    stages.push(base.stage(&k::MATCHING_FINISH, Groups::Fixed(1), rest)?);
    Ok(stages)
}
