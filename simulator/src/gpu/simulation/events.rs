use super::{Burst, GpuSimulation};
use crate::Error;
use crate::gpu::device::read;
use crate::gpu::layout::{ControlHeader, EVENT_BYTES, NOTHING};
use crate::model::particles::Particles;
use crate::release::ReleaseStep;
use crate::release::origins::{Arrival, Origin};

/// Step, then receiver, species and id of an arrival, or [`NOTHING`], rank and parent's id of a second product.
pub(super) type Entry = [u32; 4];

impl GpuSimulation {
    /// Sorted by step; second products by rank, then arrivals by id.
    pub(super) fn read_events(&self, count: u32) -> Result<Vec<Entry>, Error> {
        if count == 0 {
            return Ok(Vec::new());
        }
        let sources = [(self.steps.buffer("events"), EVENT_BYTES * u64::from(count))];
        let read = read(&self.buffers.gpu, self.encoder(), &sources)?;
        let mut entries: Vec<Entry> = bytemuck::pod_collect_to_vec(&read[0]);
        entries.sort_unstable_by_key(|&[step, receiver, rank, id]| {
            let is_birth = receiver == NOTHING;
            (step, !is_birth, if is_birth { rank } else { id })
        });
        Ok(entries)
    }

    pub(super) fn record_steps(
        &mut self,
        bursts: &[Burst],
        head: ControlHeader,
        entries: &[Entry],
    ) -> Result<(), Error> {
        let last = head.done;
        if last > self.step {
            self.due = Particles::default();
        }
        let (mut entries, mut bursts) = (entries.iter().peekable(), bursts.iter().peekable());
        for step in self.step + 1..=last {
            while let Some(&[_, _, _, parent]) =
                entries.next_if(|&&[at, receiver, ..]| at + 1 == step && receiver == NOTHING)
            {
                self.record_birth(parent);
            }
            if self.tables.dissociates() && step == last {
                // Without a log of arrivals, births have no entries.
                self.next_id = head.next_id;
            }
            let burst = bursts.next_if(|burst| burst.step == step);
            let released = self.record_release(burst, step, step == last)?;
            while let Some(entry) = entries.next_if(|entry| entry[0] + 1 == step) {
                self.record_arrival(entry);
            }
            if self.model.logs_arrivals {
                self.arrivals.extend(released);
            }
        }
        self.step = last;
        Ok(())
    }

    /// Records the next step, with the ascending ids of all ranks' `parents`.
    pub(super) fn record_shared_step(
        &mut self,
        bursts: &[Burst],
        parents: &[u32],
        entries: &[Entry],
    ) -> Result<(), Error> {
        self.due = Particles::default();
        parents.iter().for_each(|&parent| self.record_birth(parent));
        let step = self.step + 1;
        let burst = bursts.iter().find(|burst| burst.step == step);
        let released = self.record_release(burst, step, true)?;
        entries.iter().filter(|entry| entry[1] != NOTHING).for_each(|entry| self.record_arrival(entry));
        if self.model.logs_arrivals {
            self.arrivals.extend(released);
        }
        self.step = step;
        Ok(())
    }

    fn record_birth(&mut self, parent: u32) {
        if self.model.logs_arrivals {
            self.origins.insert(self.next_id, self.origins.origin_of(parent));
        }
        self.next_id += 1;
    }

    fn record_arrival(&mut self, &[step, receiver, species, id]: &Entry) {
        let origin = self.origins.origin_of(id);
        self.arrivals.push(Arrival { receiver, species, id, step: step + 1, origin });
    }

    /// Arrivals since the release. Releases after the last step are not on the device yet.
    fn record_release(
        &mut self,
        burst: Option<&Burst>,
        step: u32,
        is_last: bool,
    ) -> Result<Vec<Arrival>, Error> {
        if self.model.logs_arrivals {
            let mut first = self.next_id;
            for (transmitter, _, count) in self.model.releases(step, self.key) {
                self.origins.insert(first, Some(Origin { transmitter, step }));
                first += count;
            }
        }
        let Some(burst) = burst else { return Ok(Vec::new()) };
        let mut released = burst.released.clone();
        if self.tables.dissociates() {
            let receiver_moves = &self.trajectory.receiver_moves_at(step);
            let (events, key, next_id) = (&self.partial_events, self.key, self.next_id);
            let at = ReleaseStep { events, key, step, next_id, receiver_moves };
            released = self.model.release(at, self.slice)?;
        }
        self.next_id = released.next_id;
        self.totals.add_released(&released);
        if is_last {
            self.due = released.particles;
        }
        Ok(released.arrivals)
    }
}
