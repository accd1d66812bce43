use std::mem::offset_of;

use lazygrid::gpu::wgpu;

use super::events::Entry;
use super::{Burst, GpuSimulation};
use crate::Error;
use crate::gpu::device::{read, with_error_scope};
use crate::gpu::layout::ControlHeader;
use crate::gpu::plan::LOG_ROWS;

pub(super) struct Readback {
    pub(super) head: ControlHeader,
    pub(super) entries: Vec<Entry>,
    counts: Vec<u32>,
    inside: Vec<u32>,
    /// Indexed by step.
    pairs: Vec<u64>,
}

impl GpuSimulation {
    pub(super) fn read(&self, mut encoder: wgpu::CommandEncoder, particles: u32) -> Result<Readback, Error> {
        self.steps.encode_census(&mut encoder, particles);
        let tallies = self.tables.tallies.len();
        let head_bytes = size_of::<ControlHeader>();
        let sources = [
            (self.buffers.buffer("control"), (head_bytes + 8 * tallies) as u64),
            (self.buffers.buffer("inside"), 4 * tallies as u64),
            (self.buffers.buffer("log"), 8 * u64::from(LOG_ROWS)),
        ];
        let read = read(&self.buffers.gpu, encoder, &sources)?;
        let head: ControlHeader = bytemuck::pod_read_unaligned(&read[0][..head_bytes]);
        let counts = bytemuck::pod_collect_to_vec(&read[0][head_bytes + 4 * tallies..]);
        let inside = bytemuck::pod_collect_to_vec(&read[1]);
        let pairs = bytemuck::pod_collect_to_vec(&read[2][..8 * head.logged as usize]);
        let entries = self.read_events(head.committed_events)?;
        Ok(Readback { head, entries, counts, inside, pairs })
    }

    /// Records a batch. If ranks assign ids together, it has one step, and `parents` are those of all ranks.
    pub(super) fn record(
        &mut self,
        read: Readback,
        bursts: &[Burst],
        parents: Option<&[u32]>,
    ) -> Result<(), Error> {
        let recorded = self.record_batch(read, bursts, parents);
        self.or_fail(recorded)
    }

    fn record_batch(
        &mut self,
        read: Readback,
        bursts: &[Burst],
        parents: Option<&[u32]>,
    ) -> Result<(), Error> {
        let Readback { head, entries, counts, inside, pairs } = read;
        self.alive = head.alive;
        self.centers = self.trajectory.centers_at(head.done).to_vec();
        match parents {
            Some(parents) => self.record_shared_step(bursts, parents, &entries)?,
            None => self.record_steps(bursts, head, &entries)?,
        }
        self.add_tallies(&counts);
        self.inside = inside
            .chunks(self.tables.tallies.species.max(1))
            .take(self.tables.tallies.receivers)
            .map(|row| row.iter().map(|&count| count.into()).collect())
            .collect();
        self.totals.pairs = pairs.last().copied().unwrap_or(self.totals.pairs);
        if self.steps.sizes.near > 0 {
            self.totals.contacts = head.committed_contacts.into();
        }
        self.pairs.extend(pairs);
        self.reset_control()
    }

    fn reset_control(&self) -> Result<(), Error> {
        let control = self.buffers.buffer("control");
        let tallies = self.tables.tallies.len();
        let zeros = vec![0u32; tallies];
        let queue = &self.buffers.gpu.queue;
        with_error_scope(&self.buffers.gpu, "counts", 0, || {
            for (at, word) in [
                (offset_of!(ControlHeader, logged), 0),
                (offset_of!(ControlHeader, committed_events), 0),
                (offset_of!(ControlHeader, next_id), self.next_id),
            ] {
                queue.write_buffer(control, at as u64, &u32::to_le_bytes(word));
            }
            let counts = (size_of::<ControlHeader>() + 4 * tallies) as u64;
            queue.write_buffer(control, counts, bytemuck::cast_slice(&zeros));
        })
    }
}
