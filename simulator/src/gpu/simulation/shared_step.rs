//! Steps that ranks do together: they stop for requests for receptors, of which the lowest keys of all ranks are
//! accepted, and for ids of second products, in the order of all ranks' parents.

use std::mem;

use super::readback::Readback;
use super::{Burst, GpuSimulation, error_at};
use crate::Error;
use crate::gpu::device::{buffer, read, with_error_scope};

mod requests;
pub(crate) use requests::ReceptorRequests;

/// A step whose second products have no ids yet.
pub(crate) struct SharedStep {
    /// This rank's parents of second products; ascending ids.
    pub(crate) parents: Vec<u32>,
    read: Readback,
    bursts: Vec<Burst>,
    /// Species and preliminary ids, in the order of `parents`.
    tags: Vec<[u32; 2]>,
}

impl GpuSimulation {
    pub(crate) fn has_shared_steps(&self) -> bool {
        self.assigns_ids() || !self.tables.receptors.is_empty()
    }

    /// Returns `true` if a step may have second products.
    pub(crate) fn assigns_ids(&self) -> bool {
        self.tables.dissociates()
    }

    /// Continues after [`request_receptors`](Self::request_receptors). `accepted` counts this rank's accepted
    /// requests by receptor type.
    ///
    /// # Errors
    /// See [`run`](Self::run).
    pub(crate) fn begin_shared_step(
        &mut self,
        mut requests: ReceptorRequests,
        accepted: &[u32],
    ) -> Result<SharedStep, Error> {
        let (read, bursts) = loop {
            let step = self.step;
            let (read, bursts) = match accepted {
                [] => self.run_batch(1)?,
                accepted => (self.bind_accepted(&requests, accepted)?, mem::take(&mut requests.bursts)),
            };
            if read.head.done > step {
                break (read, bursts);
            }
            let head = read.head;
            self.record(read, &bursts, None)?;
            self.recover(head).map_err(|error| error_at(step, error))?;
            requests = self.request_receptors(&requests.occupied)?;
        };
        let born = self.read_born(&read);
        self.failure = Some("a step of this rank was not concluded".to_owned());
        let (parents, tags) = born?;
        Ok(SharedStep { parents, read, bursts, tags })
    }

    fn read_born(&self, read_back: &Readback) -> Result<(Vec<u32>, Vec<[u32; 2]>), Error> {
        let (born, at) = (u64::from(read_back.head.born), u64::from(read_back.head.born_at));
        if born == 0 {
            return Ok((Vec::new(), Vec::new()));
        }
        let gpu = &self.buffers.gpu;
        let copy = buffer(gpu, "born_tags", 8 * born)?;
        let mut encoder = self.encoder();
        encoder.copy_buffer_to_buffer(self.steps.buffer("tags"), 8 * at, &copy, 0, 8 * born);
        let read = read(gpu, encoder, &[(&copy, 8 * born), (self.steps.buffer("born_keys0"), 8 * born)])?;
        let keys: Vec<[u32; 2]> = bytemuck::pod_collect_to_vec(&read[1]);
        Ok((keys.iter().map(|key| key[0]).collect(), bytemuck::pod_collect_to_vec(&read[0])))
    }

    /// Assigns ids by the ascending `parents` of all ranks, and does the releases of the step.
    ///
    /// # Errors
    /// [`Error::OutOfIds`], and [`Error::Detection`] if the device fails.
    pub(crate) fn conclude_shared_step(&mut self, step: SharedStep, parents: &[u32]) -> Result<(), Error> {
        let SharedStep { parents: own_parents, read, bursts, mut tags } = step;
        let released = u64::from(self.next_id) + parents.len() as u64;
        if released > lazygrid::MAX_SPHERES {
            return Err(Error::OutOfIds { released });
        }
        for (tag, parent) in tags.iter_mut().zip(own_parents) {
            tag[1] = self.next_id + parents.partition_point(|&other| other < parent) as u32;
        }
        if !tags.is_empty() {
            let at = 8 * u64::from(read.head.born_at);
            let queue = &self.buffers.gpu.queue;
            with_error_scope(&self.buffers.gpu, "ids", 0, || {
                queue.write_buffer(self.steps.buffer("tags"), at, bytemuck::cast_slice(&tags));
            })?;
        }
        self.record(read, &bursts, Some(parents))?;
        self.failure = None;
        Ok(())
    }
}
