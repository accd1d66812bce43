use lazygrid::gpu::wgpu;

use super::{Groups, RunBuffers, Stage, StepDispatches};
use crate::Error;
use crate::gpu::kernel as k;

#[derive(Debug)]
pub(super) struct MotionStages {
    counting: Vec<Stage>,
    moving: Vec<Stage>,
    selection: Option<Stage>,
}

impl MotionStages {
    pub(super) fn new(
        run: &mut RunBuffers,
        find: impl Fn(&'static str) -> wgpu::Buffer,
    ) -> Result<Self, Error> {
        let (reflects, receptors) = (run.reflects, run.receptors);
        let mut stage = |kernel, groups| run.stage(kernel, groups, &find);
        let moving = if reflects { &k::PARTICLES_MOVE_REFLECTING } else { &k::PARTICLES_MOVE };
        let moving = stage(moving, Groups::Particles)?;
        if receptors == 0 {
            return Ok(Self { counting: Vec::new(), moving: vec![moving], selection: None });
        }
        let counting = vec![
            stage(&k::RECEPTORS_RESET, Groups::Fixed(1))?,
            stage(&k::RECEPTORS_COUNT_BOUND, Groups::Particles)?,
        ];
        let moving = vec![
            moving,
            stage(&k::RECEPTORS_SCAN_REQUESTS, Groups::Fixed(1))?,
            stage(&k::RECEPTORS_GROUP_REQUESTS, Groups::Particles)?,
        ];
        let selection = Some(stage(&k::RECEPTORS_SELECT, Groups::Fixed(receptors))?);
        Ok(Self { counting, moving, selection })
    }
}

impl StepDispatches {
    pub(in crate::gpu) fn encode_motion(&self, encoder: &mut wgpu::CommandEncoder, particles: u32) {
        let MotionStages { counting, moving, selection } = &self.motion;
        let stages = self.collisions.land.iter().chain(counting).chain(moving).chain(selection);
        self.encode(encoder, stages, particles);
    }

    pub(in crate::gpu) fn encode_requests(&self, encoder: &mut wgpu::CommandEncoder, particles: u32) {
        self.encode(encoder, &self.motion.moving, particles);
    }

    pub(in crate::gpu) fn encode_selection(&self, encoder: &mut wgpu::CommandEncoder, particles: u32) {
        self.encode(encoder, &self.motion.selection, particles);
    }
}
