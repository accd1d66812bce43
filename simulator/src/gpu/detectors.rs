use lazygrid::gpu::{Crossover, GpuConfig, GpuDetector, GpuDevice, GpuOutput};

use crate::Error;
use crate::gpu::device::refused;
use crate::gpu::kernel as k;
use crate::gpu::plan::Sizes;
use crate::model::Model;
use crate::reaction::{collision_interactions, interactions};

#[derive(Debug)]
pub(super) struct Detectors {
    pub(super) interactions: Option<GpuDetector>,
    pub(super) candidates: Option<GpuDetector>,
}

#[derive(Clone, Debug, Default)]
pub(super) struct DetectorOutputs {
    pub(super) interactions: Option<GpuOutput>,
    pub(super) candidates: Option<GpuOutput>,
}

impl Detectors {
    pub(super) fn new(gpu: &GpuDevice, model: &Model, sizes: Sizes) -> Result<Self, Error> {
        // Software drivers have few threads, so the cell list is faster at fewer particles.
        let crossover = Crossover::assumed(gpu.adapter.is_hardware);
        let config = GpuConfig::default()
            .crossover(crossover)
            .space(model.boundary.space()?)
            .consumer_workgroup_size(k::WORKGROUP_SIZE);
        let new = |config| GpuDetector::new(&gpu.device, config).map_err(refused);
        let table = interactions(model)?;
        let with_table =
            |table| new(config.clone().interactions(Some(table)).pair_capacity(sizes.pairs.max(1)));
        let of_collisions =
            || new(config.clone().interactions(collision_interactions(model)?).pair_capacity(sizes.near));
        let candidates = (sizes.near > 0).then(of_collisions);
        Ok(Self { interactions: table.map(with_table).transpose()?, candidates: candidates.transpose()? })
    }

    pub(super) fn all(&mut self) -> impl Iterator<Item = &mut GpuDetector> {
        self.interactions.iter_mut().chain(&mut self.candidates)
    }

    pub(super) fn reserve(&mut self, sizes: Sizes) -> Result<DetectorOutputs, Error> {
        let reserve = |detector: &mut Option<GpuDetector>, pairs: u32| {
            let reserve = |detector: &mut GpuDetector| {
                detector.set_pair_capacity(pairs.max(1));
                detector.reserve(sizes.particles).map_err(refused)
            };
            detector.as_mut().map(reserve).transpose()
        };
        Ok(DetectorOutputs {
            interactions: reserve(&mut self.interactions, sizes.pairs)?,
            candidates: reserve(&mut self.candidates, sizes.near)?,
        })
    }
}
