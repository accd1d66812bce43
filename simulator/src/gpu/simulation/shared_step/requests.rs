//! Requests for the receptors of all ranks.
//!
//! Kernels accept as many of a rank's requests as receptors are free. Binding and unbinding depend on all ranks'
//! occupied receptors, which the host sets before the motion. Before the selection, it leaves as many free as this rank
//! has accepted requests. These have the lowest keys on all ranks, and so on this one.

use lazygrid::gpu::wgpu;

use super::super::readback::Readback;
use super::super::{Burst, GpuSimulation, error_at};
use crate::Error;
use crate::gpu::device::{read, with_error_scope};
use crate::gpu::layout::{CLAIM_BYTES, ControlHeader, ReceptorRow};
use crate::gpu::submissions::Submissions;
use crate::motion::binding::BindingRequest;

pub(crate) struct ReceptorRequests {
    /// Indexed by type; counts of all ranks at the beginning of the step.
    pub(super) occupied: Vec<u64>,
    pub(super) bursts: Vec<Burst>,
    rows: Vec<ReceptorRow>,
}

impl ReceptorRequests {
    pub(crate) fn counts(&self) -> Vec<u32> {
        self.rows.iter().map(|row| row.requests).collect()
    }
}

impl GpuSimulation {
    /// Does the next step up to the requests, or nothing without receptors. `occupied` counts all ranks' receptors.
    ///
    /// # Errors
    /// See [`run`](Self::run). The run is then at the beginning of the step.
    pub(crate) fn request_receptors(&mut self, occupied: &[u64]) -> Result<ReceptorRequests, Error> {
        self.check_state()?;
        self.pairs.clear();
        self.arrivals.clear();
        let occupied = occupied.to_vec();
        if self.tables.receptors.is_empty() {
            return Ok(ReceptorRequests { occupied, bursts: Vec::new(), rows: Vec::new() });
        }
        loop {
            let step = self.step;
            let bursts = self.bursts(1)?;
            self.reserve_for(&bursts)?;
            self.prepare_receivers(1)?;
            self.prepare_flow()?;
            let bound = occupied.iter().map(|&count| count.try_into().unwrap_or(u32::MAX));
            let rows = self.tables.receptors.iter().zip(bound);
            self.write_receptors(rows.map(|(row, bound)| ReceptorRow { bound, ..*row }).collect())?;
            let encoder = self.encode_requests()?;
            let (head, rows) = self.read_requests(encoder)?;
            if head.halted == 0 {
                return Ok(ReceptorRequests { occupied, bursts, rows });
            }
            self.recover(head).map_err(|error| error_at(step, error))?;
        }
    }

    fn encode_requests(&mut self) -> Result<wgpu::CommandEncoder, Error> {
        let due = self.due.clone();
        let particles = self.particles_of_step();
        let burst = Some(&due).filter(|due| !due.is_empty()).map(|due| self.append(due)).transpose()?;
        let mut encoder = self.encoder();
        self.steps.encode_begin(&mut encoder, burst.as_ref(), particles);
        self.steps.encode_requests(&mut encoder, particles);
        Ok(encoder)
    }

    fn read_requests(
        &self,
        encoder: wgpu::CommandEncoder,
    ) -> Result<(ControlHeader, Vec<ReceptorRow>), Error> {
        let sources = [
            (self.buffers.buffer("control"), size_of::<ControlHeader>() as u64),
            (self.buffers.buffer("receptors"), size_of_val(&self.tables.receptors[..]) as u64),
        ];
        let read = read(&self.buffers.gpu, encoder, &sources)?;
        Ok((bytemuck::pod_read_unaligned(&read[0]), bytemuck::pod_collect_to_vec(&read[1])))
    }

    fn particles_of_step(&self) -> u32 {
        self.alive + self.due.len() as u32
    }

    /// # Errors
    /// [`Error::Detection`] if the device fails.
    pub(crate) fn requests_by_key(&self, requests: &ReceptorRequests) -> Result<Vec<BindingRequest>, Error> {
        let rows = &requests.rows;
        let requests: u64 = rows.iter().map(|row| u64::from(row.requests)).sum();
        if requests == 0 {
            return Ok(Vec::new());
        }
        let particles = u64::from(self.particles_of_step());
        let sources = [
            (self.steps.buffer("requesters"), 4 * requests),
            (self.steps.buffer("claims"), CLAIM_BYTES * particles),
            (self.steps.buffer("tags"), 8 * particles),
        ];
        let read = read(&self.buffers.gpu, self.encoder(), &sources)?;
        let requesters: Vec<u32> = bytemuck::pod_collect_to_vec(&read[0]);
        let claims: Vec<[u32; CLAIM_BYTES as usize / 4]> = bytemuck::pod_collect_to_vec(&read[1]);
        let tags: Vec<[u32; 2]> = bytemuck::pod_collect_to_vec(&read[2]);
        let of_type = |(receptor, row): (u32, &ReceptorRow)| {
            let requesters_of_receptor = &requesters[row.first as usize..(row.first + row.requests) as usize];
            let key = |&at: &u32| (claims[at as usize][0], tags[at as usize][1]);
            let request = move |(rank, id)| BindingRequest::new(receptor, rank, id);
            requesters_of_receptor.iter().map(key).map(request).collect::<Vec<_>>()
        };
        Ok((0..).zip(rows).flat_map(of_type).collect())
    }

    pub(super) fn bind_accepted(
        &mut self,
        requests: &ReceptorRequests,
        accepted: &[u32],
    ) -> Result<Readback, Error> {
        let leave_free = |(row, &accepted): (&ReceptorRow, &u32)| ReceptorRow {
            bound: row.count.saturating_sub(accepted),
            ..*row
        };
        self.write_receptors(requests.rows.iter().zip(accepted).map(leave_free).collect())?;
        let particles = self.particles_of_step();
        let particles = if self.tables.dissociates() { self.steps.sizes.particles } else { particles };
        let mut submissions = Submissions::new(self.buffers.gpu.clone());
        self.steps.encode_selection(submissions.encoder(), particles);
        self.steps.encode_after(submissions.encoder(), particles);
        let read = self.read(submissions.finish(), particles);
        self.or_fail(read)
    }

    fn write_receptors(&self, rows: Vec<ReceptorRow>) -> Result<(), Error> {
        with_error_scope(&self.buffers.gpu, "receptors", 0, || {
            let bytes = bytemuck::cast_slice(&rows);
            self.buffers.gpu.queue.write_buffer(self.buffers.buffer("receptors"), 0, bytes);
        })
    }
}
