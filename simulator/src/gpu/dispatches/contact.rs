use lazygrid::gpu::wgpu;

use super::{Groups, RunBuffers, Stage, StepDispatches};
use crate::Error;
use crate::gpu::kernel as k;
use crate::gpu::kernel::Kernel;
use crate::gpu::plan::Sizes;
use crate::gpu::submissions::{MAX_WORK, Submissions};
use crate::motion::contact::PASSES;

/// Empty if particles pass through each other.
#[derive(Debug, Default)]
pub(super) struct CollisionStages {
    pub(super) begin: Vec<Stage>,
    pub(super) before_candidates: Vec<Stage>,
    pub(super) window: Vec<Stage>,
    pub(super) land: Vec<Stage>,
}

impl CollisionStages {
    pub(super) fn new(
        run: &mut RunBuffers,
        sizes: Sizes,
        find: impl Fn(&'static str) -> wgpu::Buffer,
    ) -> Result<Self, Error> {
        let mut stage = |kernel: &'static Kernel, groups: Groups, round: u32| {
            let rounds = ["round0", "round1"];
            run.stage(kernel, groups, |name| {
                find(if name == "round" { rounds[round as usize % 2] } else { name })
            })
        };
        let before_candidates = vec![
            stage(&k::WINDOW_BEGIN, Groups::Fixed(1), 0)?,
            stage(&k::WINDOW_SPHERES, Groups::Particles, 0)?,
        ];
        let mut window = vec![
            stage(&k::CANDIDATES_CHECK, Groups::Fixed(1), 0)?,
            stage(&k::NEIGHBORS_COUNT, Groups::Candidates, 0)?,
            stage(&k::NEIGHBORS_RESERVE, Groups::Particles, 0)?,
            stage(&k::NEIGHBORS_LIST, Groups::Candidates, 0)?,
        ];
        for round in 0..sizes.window_rounds {
            for kernel in [&k::COLLISIONS_PREDICT, &k::COLLISIONS_CHOOSE, &k::COLLISIONS_APPLY] {
                window.push(stage(kernel, Groups::Particles, round)?);
            }
        }
        window.push(stage(&k::WINDOW_END, Groups::Particles, sizes.window_rounds + 1)?);
        Ok(Self {
            begin: vec![stage(&k::COLLISIONS_BEGIN, Groups::Particles, 0)?],
            before_candidates,
            window,
            land: vec![stage(&k::COLLISIONS_LAND, Groups::Particles, 0)?],
        })
    }
}

impl StepDispatches {
    pub(in crate::gpu) fn encode_collisions(&self, encoder: &mut wgpu::CommandEncoder, particles: u32) {
        encoder.clear_buffer(self.buffer("window"), 0, None);
        self.encode(encoder, &self.collisions.begin, particles);
    }

    pub(in crate::gpu) fn encode_window(&self, encoder: &mut wgpu::CommandEncoder, particles: u32) {
        self.encode(encoder, &self.collisions.before_candidates, particles);
    }

    pub(in crate::gpu) fn encode_rounds(
        &self,
        submissions: &mut Submissions,
        particles: u32,
    ) -> Result<(), Error> {
        submissions.add_work(self.sizes.near.into())?;
        let at_once = (MAX_WORK / u64::from(particles.max(1))).max(1);
        for stages in self.collisions.window.chunks(at_once as usize) {
            self.encode(submissions.encoder(), stages, particles);
            submissions.add_work(u64::from(particles) * stages.len() as u64)?;
        }
        Ok(())
    }
}

pub(super) fn separation_stages(
    run: &mut RunBuffers,
    find: impl Fn(&'static str) -> wgpu::Buffer,
) -> Result<Vec<Stage>, Error> {
    let mut stages = Vec::new();
    for pass in 0..PASSES {
        let round = if pass == 0 { "round0" } else { "round1" };
        let find = |name| find(if name == "round" { round } else { name });
        stages.push(run.stage(&k::SEPARATION_PUSH, Groups::Pairs, find)?);
        stages.push(run.stage(&k::SEPARATION_MOVE, Groups::Particles, find)?);
    }
    Ok(stages)
}
