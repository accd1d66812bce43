//! What a session submits, and how it comes back.

use std::ops::Range;
use std::time::{Duration, Instant};

use lazygrid_kernels::layout::Outcome;

use super::{GpuSession, SLOTS};
use crate::Error;
use crate::gpu::input::GpuSpheres;
use crate::gpu::mapping::{Mapping, Wait};
use crate::gpu::plan::Phase;
use crate::gpu::scope::scoped;
use crate::gpu::slot::{Returned, copy_back, staged_pairs};

/// Work on its way back.
#[derive(Debug)]
pub(super) struct Flight {
    pub(super) number: u64,
    device: wgpu::Device,
    submission: wgpu::SubmissionIndex,
    staging: wgpu::Buffer,
    mapping: Mapping,
    staged: u64,
    capacity: u32,
    /// The phases whose times it took.
    timed: &'static [Phase],
    /// `true` if it was answered from candidates, whose state comes back in place of times.
    pub(super) is_kept: bool,
}

/// What a submission does.
#[derive(Clone, Debug)]
pub(super) enum Work {
    /// A call, of which pairs are asked for whose smaller index is in this window.
    Call(Range<u32>),
    /// A further part of the call that was launched last.
    Rest,
}

impl Drop for Flight {
    /// Whether it landed or was given up: the staging buffer is used again.
    fn drop(&mut self) {
        // On a device that is gone there is nothing left to unmap, and nobody to be told.
        let _ = scoped(&self.device, "unmapping", 0, || self.staging.unmap());
    }
}

impl GpuSession {
    /// Records and submits a call together with its way back. Where the device has no memory for candidates, the call
    /// searches without.
    pub(super) fn launch(&mut self, number: u64, work: Work) -> Result<(), Error> {
        let keeps = self.keeps(number);
        let launched = match self.submit(number, work.clone()) {
            Err(error @ (Error::DeviceOutOfMemory { .. } | Error::LimitExceeded { .. })) if keeps => {
                log::info!("no room for candidates: {error}");
                self.pause_skin(number);
                self.submit(number, work)
            }
            launched => launched,
        };
        launched.map_err(|error| self.own.reason(error))
    }

    fn submit(&mut self, number: u64, work: Work) -> Result<(), Error> {
        let at = number as usize % SLOTS;
        let keeps = self.keeps(number);
        let Self { own, detector, skin, slots, calls, expected, .. } = self;
        let (way, split) = (calls[at].way, calls[at].split);
        let slot = &mut slots[at];
        let capacity = detector.pair_capacity();
        let staged = (*expected).min(capacity.into());
        let staging = slot.staging(own, staged)?;
        let Some(spheres) = slot.spheres.clone() else { return Ok(()) };
        let mut encoder =
            scoped(&own.device, "an encoder", 0, || own.device.create_command_encoder(&Default::default()))?;
        let skin = skin.as_mut().filter(|_| keeps).map(|skin| &mut skin.detector);
        let timed: &[Phase] = match work {
            _ if detector.ticks().is_none() || skin.is_some() => &[],
            Work::Call(_) => &Phase::ALL,
            Work::Rest => &[Phase::Search],
        };
        let is_kept = skin.is_some();
        // Whatever comes of it, nothing of an earlier call is left to go on with.
        self.launched = None;
        let (found, beside) = match (work, skin) {
            (Work::Call(window), skin) => {
                let species = slot.species.as_ref().filter(|_| detector.has_interactions());
                let input = GpuSpheres { species, window, split, ..GpuSpheres::new(&spheres, slot.count) };
                match skin {
                    Some(skin) => {
                        skin.set_pair_capacity(capacity);
                        let found = skin.encode_as(way, &mut encoder, &input)?;
                        (Some(found), skin.state())
                    }
                    None => (Some(detector.encode_as(way, &mut encoder, &input)?), detector.ticks()),
                }
            }
            (Work::Rest, _) => {
                detector.encode_rest(&mut encoder);
                (detector.output(), detector.ticks())
            }
        };
        let staged = staged.min(staged_pairs(&staging));
        if let Some(found) = found {
            copy_back(&mut encoder, [Some(&found.outcome), beside, Some(&found.pairs)], &staging, staged);
        }
        let (submission, mapping) = scoped(&own.device, "a call", 0, || {
            (own.queue.submit([encoder.finish()]), Mapping::request(&staging))
        })?;
        own.check_lost()?;
        let device = own.device.clone();
        let flight =
            Flight { number, device, submission, staging, mapping, staged, capacity, timed, is_kept };
        self.launched = Some(number);
        self.flights[at] = Some(flight);
        Ok(())
    }

    /// Waits for what was launched and appends its pairs, if all of them came back.
    pub(super) async fn land(&mut self, number: u64, wait: Wait) -> Result<Outcome, Error> {
        let flight = self.flights[number as usize % SLOTS].take().filter(|flight| flight.number == number);
        let Some(flight) = flight else {
            return Err(Error::Busy { calls: SLOTS });
        };
        let start = Instant::now();
        let waiting = flight.mapping.clone();
        let submission = flight.submission.clone();
        let finished = waiting.finished(&self.own.device, submission, self.timeout, wait).await;
        self.own.check_lost()?;
        finished?;
        self.time("wait", start.elapsed());
        let start = Instant::now();
        let view = flight.staging.slice(..).get_mapped_range();
        let view = view.map_err(|error| Error::Validation { what: "readback", reason: error.to_string() })?;
        let returned = Returned(&view);
        let outcome = returned.outcome()?;
        if outcome.found() <= flight.staged.min(flight.capacity.into()) {
            returned.append_pairs(outcome.found() as usize, &mut self.pairs)?;
        }
        let state = flight.is_kept.then(|| returned.state());
        if !flight.timed.is_empty() {
            let (period, ticks) = (f64::from(self.own.queue.get_timestamp_period()) * 1e-9, returned.ticks());
            for phase in flight.timed {
                let [begin, end] = ticks[*phase as usize];
                self.time(phase.name(), Duration::from_secs_f64(end.saturating_sub(begin) as f64 * period));
            }
        }
        drop(view);
        drop(flight);
        if let Some(state) = state {
            self.note(&state);
        }
        self.time("read", start.elapsed());
        Ok(outcome)
    }
}
