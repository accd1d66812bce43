//! One table of receivers, membranes, a flow field and receiver lists: portable devices bind eight buffers in a stage.

use std::sync::Arc;

use lazygrid::gpu::{DeviceLimits, GpuDevice, wgpu};

use super::device::{buffer, refused, with_error_scope};
use super::layout::{Params, SpeciesRow};
use super::membrane_rows::{MembraneRow, MembraneRows};
use super::receiver_trajectory::max_rows;
use crate::Error;
use crate::model::Model;
use crate::model::flow_field::FlowField;

pub(super) const ROW_BYTES: u64 = 16;
/// Center and displacement.
const RECEIVER_ROWS: usize = 2;
/// Grid points in an upload.
const POINTS_PER_UPLOAD: usize = 1 << 16;
const CHUNKS_PER_SUBMISSION: usize = 16;

#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct SceneRows {
    receivers: usize,
    membranes: Vec<MembraneRow>,
    field: Option<Arc<FlowField>>,
}

impl SceneRows {
    pub(super) fn new(model: &Model) -> Self {
        let (membranes, field) = (Vec::new(), model.flow_field().cloned());
        // An upload of no receivers is padded to one.
        Self { receivers: RECEIVER_ROWS * max_rows(model).max(1), membranes, field }
    }

    pub(super) fn add_membranes(&mut self, model: &Model, species_rows: &mut [SpeciesRow]) {
        for (species, kind) in species_rows.iter_mut().enumerate() {
            let rows = MembraneRows::new(model, species);
            [kind.membrane_planes, kind.membrane_spheres] = rows.ranges(self.field_at());
            self.membranes.extend(rows.planes.into_iter().chain(rows.spheres));
        }
    }

    pub(super) fn has_membranes(&self) -> bool {
        !self.membranes.is_empty()
    }

    fn field_at(&self) -> usize {
        self.receivers + self.membranes.len()
    }

    pub(super) fn describe_field(&self, params: &mut Params) {
        let Some(field) = &self.field else { return };
        let ([origin, spacing], points) = field.grid();
        params.field_at = self.field_at() as u32;
        params.field_points = points.map(|n| n as u32).into();
        params.field_origin = origin.map(|x| x as f32).into();
        params.field_spacing = spacing.map(|h| h as f32).into();
        params.flow_duration = params.time_step;
    }

    /// Returns the offset of receiver lists, in bytes.
    pub(super) fn cells_at(&self) -> u64 {
        let points = self.field.as_ref().map_or(0, |field| field.velocities().len());
        ROW_BYTES * (self.field_at() + points) as u64
    }

    /// Reserves `words` for receiver lists.
    pub(super) fn create(&self, gpu: &GpuDevice, words: usize) -> Result<wgpu::Buffer, Error> {
        let needed = self.cells_at() + 4 * words as u64;
        let limits = DeviceLimits::from_device(&gpu.device);
        let limit = limits.storage_binding.min(limits.buffer);
        if needed > limit {
            let what = "the table of receivers, membranes and velocities";
            let remedy = "use a coarser flow field, or fewer receivers or membranes, or choose the CPU";
            return Err(refused(lazygrid::Error::LimitExceeded { what, needed, limit, remedy }));
        }
        let rows_buffer = buffer(gpu, "scene_rows", needed)?;
        let velocities = self.field.iter().flat_map(|field| field.velocities().chunks(POINTS_PER_UPLOAD));
        let mut at = ROW_BYTES * self.receivers as u64;
        with_error_scope(gpu, "membranes", 0, || {
            gpu.queue.write_buffer(&rows_buffer, at, bytemuck::cast_slice(&self.membranes));
        })?;
        at += ROW_BYTES * self.membranes.len() as u64;
        for (number, chunk) in velocities.enumerate() {
            if number % CHUNKS_PER_SUBMISSION == 0 {
                // Frees the copies that the queue holds until a submission.
                gpu.queue.submit([]);
            }
            let rows: Vec<[f32; 4]> = chunk.iter().map(|&[u, v, w]| [u, v, w, 0.0]).collect();
            with_error_scope(gpu, "the flow field", 0, || {
                gpu.queue.write_buffer(&rows_buffer, at, bytemuck::cast_slice(&rows));
            })?;
            at += ROW_BYTES * rows.len() as u64;
        }
        Ok(rows_buffer)
    }
}
