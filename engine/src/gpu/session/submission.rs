use std::ops::Range;
use std::time::{Duration, Instant};

use lazygrid_kernels::layout::Outcome;

use super::call_buffers::{Readback, copy_to_staging, staged_pairs};
use super::{GpuSession, MAX_IN_FLIGHT};
use crate::Error;
use crate::gpu::detector::GpuSpheres;
use crate::gpu::device::{GpuDevice, Mapping, Wait, with_error_scope};
use crate::gpu::plan::GpuPhase;

/// Numbers of submissions of a call.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct SubmissionCounts {
    /// Searches, including retries.
    pub searches: u32,
    /// Searches that reused an earlier call's cells.
    pub reused_layouts: u32,
    /// Command buffers of searches and continuations.
    pub parts: u32,
    /// Copies of pairs that a search left on the device.
    pub copies: u32,
}

#[derive(Debug)]
pub(super) struct PendingReadback {
    pub(super) number: u64,
    device: wgpu::Device,
    pub(super) submission: wgpu::SubmissionIndex,
    pub(super) staging: wgpu::Buffer,
    mapping: Mapping,
    staged: u64,
    capacity: u32,
    timed: &'static [GpuPhase],
    /// If `true`, the list's state replaces the ticks.
    pub(super) uses_candidates: bool,
    has_reused: Option<bool>,
}

#[derive(Clone, Debug)]
pub(super) enum Submission {
    Full(Range<u32>),
    Continuation,
    Copy,
}

impl Drop for PendingReadback {
    fn drop(&mut self) {
        // A lost device has nothing to unmap.
        let _ = with_error_scope(&self.device, "unmapping", 0, || self.staging.unmap());
    }
}

impl GpuSession {
    pub(super) fn submit(&mut self, number: u64, work: Submission) -> Result<(), Error> {
        let uses_candidates = self.uses_candidates(number);
        let submitted = match self.try_submit(number, work.clone()) {
            Err(error @ (Error::DeviceOutOfMemory { .. } | Error::LimitExceeded { .. }))
                if uses_candidates =>
            {
                log::info!("the device cannot hold the candidates: {error}");
                self.pause_skin(number);
                self.try_submit(number, work)
            }
            submitted => submitted,
        };
        submitted.map_err(|error| self.gpu.reason(error))
    }

    fn try_submit(&mut self, number: u64, work: Submission) -> Result<(), Error> {
        let at = number as usize % MAX_IN_FLIGHT;
        let may_use_candidates = self.uses_candidates(number);
        let is_long_search = self.is_long_search();
        let Self { gpu, detector, layouts, skin, call_buffers, calls, expected, counts, .. } = self;
        let count = &mut counts[at];
        let (choice, split, may_reuse) = (calls[at].choice, calls[at].split, calls[at].reuses_layout);
        let buffers = &mut call_buffers[at];
        let capacity = detector.pair_capacity();
        let staged = (*expected).min(capacity.into());
        let staging = buffers.staging(gpu, staged)?;
        let Some(spheres) = buffers.spheres.clone() else { return Ok(()) };
        let mut encoder = new_encoder(gpu)?;
        let skin = skin.as_mut().filter(|_| may_use_candidates).map(|skin| &mut skin.detector);
        let timed: &[GpuPhase] = match work {
            _ if detector.ticks().is_none() || skin.is_some() => &[],
            Submission::Full(_) => GpuPhase::ALL,
            Submission::Continuation => &[GpuPhase::Search],
            Submission::Copy => &[],
        };
        let uses_candidates = skin.is_some() && !matches!(work, Submission::Copy);
        let searches = skin.is_none() && matches!(work, Submission::Full(_));
        // After this, also after an error, no earlier call can be continued.
        let before = self.submitted.take();
        let (found, details) = match (work, skin) {
            (Submission::Full(window), skin) => {
                let species = buffers.species().filter(|_| detector.has_interactions()).map(Into::into);
                let mut input = GpuSpheres::new(&spheres, buffers.count).in_window(window);
                input.species = species;
                input = if split > 0 { input.across(split) } else { input };
                count.searches += 1;
                match skin {
                    Some(skin) => {
                        skin.set_pair_capacity(capacity);
                        let found = skin.bind_as(choice, &input)?;
                        let parts = skin.parts();
                        if is_long_search {
                            count.parts += parts;
                            encode_parts(gpu, &mut encoder, parts, |encoder, part| {
                                skin.encode_part(encoder, part)
                            })?;
                        } else {
                            count.parts += 1;
                            (0..parts).for_each(|part| skin.encode_part(&mut encoder, part));
                        }
                        (Some(found), skin.state())
                    }
                    None => {
                        let found = detector.bind_as(choice, &input, layouts.source(may_reuse))?;
                        count.reused_layouts += u32::from(detector.reuses_layout());
                        count.parts += detector.parts();
                        encode_parts(gpu, &mut encoder, detector.parts(), |encoder, part| {
                            detector.encode_part(encoder, part)
                        })?;
                        (Some(found), detector.ticks())
                    }
                }
            }
            (Submission::Continuation, _) => {
                detector.encode_continuation(&mut encoder);
                count.parts += 1;
                (detector.output(), detector.ticks())
            }
            (Submission::Copy, _) => {
                count.copies += 1;
                (before.map(|(_, output)| output), None)
            }
        };
        let staged = staged.min(staged_pairs(&staging));
        if let Some(found) = &found {
            copy_to_staging(
                &mut encoder,
                [Some(&found.outcome), details, Some(&found.pairs)],
                &staging,
                staged,
            );
        }
        buffers.lend_staging();
        let (submission, mapping) = with_error_scope(&gpu.device, "a call", 0, || {
            (gpu.queue.submit([encoder.finish()]), Mapping::request(&staging))
        })?;
        gpu.check_lost()?;
        if searches {
            detector.note_submitted();
        }
        let device = gpu.device.clone();
        let pending = PendingReadback {
            number,
            device,
            submission,
            staging,
            mapping,
            staged,
            capacity,
            timed,
            uses_candidates,
            has_reused: searches.then(|| detector.reuses_layout()),
        };
        self.submitted = found.map(|found| (number, found));
        self.pending[at] = Some(pending);
        Ok(())
    }

    pub(super) async fn wait(&mut self, number: u64, wait: Wait) -> Result<Outcome, Error> {
        let pending = self.pending[number as usize % MAX_IN_FLIGHT].take();
        let Some(pending) = pending.filter(|pending| pending.number == number) else {
            return Err(Error::TooManyInFlight { calls: MAX_IN_FLIGHT });
        };
        let start = Instant::now();
        let submission = Some(pending.submission.clone());
        let finished = pending.mapping.finished(&self.gpu.device, submission, self.timeout, wait).await;
        self.gpu.check_lost()?;
        finished?;
        self.time("wait", start.elapsed());
        let start = Instant::now();
        let view = pending.mapping.view()?;
        let returned = Readback(&view);
        let outcome = returned.outcome()?;
        if outcome.found() <= pending.staged.min(pending.capacity.into()) {
            returned.append_pairs(outcome.found() as usize, &mut self.pairs)?;
        }
        let state = pending.uses_candidates.then(|| returned.state());
        if !pending.timed.is_empty() {
            let (period, ticks) = (f64::from(self.gpu.queue.get_timestamp_period()) * 1e-9, returned.ticks());
            for phase in pending.timed {
                let [begin, end] = ticks[*phase as usize];
                self.time(phase.name(), Duration::from_secs_f64(end.saturating_sub(begin) as f64 * period));
            }
        }
        if let Some(has_reused) = pending.has_reused {
            self.layouts.record(has_reused, &outcome);
        }
        drop(view);
        let staging = pending.staging.clone();
        drop(pending);
        self.call_buffers[number as usize % MAX_IN_FLIGHT].return_staging(staging);
        if let Some(state) = state {
            self.record_state(&state);
        }
        self.time("read", start.elapsed());
        Ok(outcome)
    }
}

fn new_encoder(gpu: &GpuDevice) -> Result<wgpu::CommandEncoder, Error> {
    with_error_scope(&gpu.device, "an encoder", 0, || gpu.device.create_command_encoder(&Default::default()))
}

/// Encodes all parts and submits all but the last, so that no submission is long.
fn encode_parts(
    gpu: &GpuDevice,
    encoder: &mut wgpu::CommandEncoder,
    parts: u32,
    encode: impl Fn(&mut wgpu::CommandEncoder, u32),
) -> Result<(), Error> {
    for part in 0..parts {
        if part > 0 {
            let full = std::mem::replace(encoder, new_encoder(gpu)?);
            with_error_scope(&gpu.device, "a part of a call", 0, || gpu.queue.submit([full.finish()]))?;
        }
        encode(encoder, part);
    }
    Ok(())
}
