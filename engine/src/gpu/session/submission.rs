use std::ops::Range;
use std::sync::Arc;
use std::time::{Duration, Instant};

use lazygrid_kernels::layout::Outcome;

use super::GpuSession;
use super::call::{CallSlot, PendingReadback, Submitted};
use super::call_buffers::{Readback, copy_to_staging};
use super::layout_reuse::LayoutReuse;
use super::skin::SkinSession;
use crate::Error;
use crate::gpu::detector::{GpuDetector, GpuOutput};
use crate::gpu::device::{GpuDevice, Mapping, Wait, with_error_scope};
use crate::gpu::plan::Plan;

/// Work of a call. A continuation and a copy need the output that the call left on the device.
#[derive(Clone, Debug)]
pub(super) enum Submission {
    Full(Range<u32>),
    Continuation(GpuOutput),
    Copy(GpuOutput),
}

struct Encoder<'a> {
    gpu: &'a GpuDevice,
    commands: wgpu::CommandEncoder,
}

#[derive(Debug)]
struct Encoded {
    submitted: Submitted,
    output: GpuOutput,
    /// The ticks, or the state of the candidate list.
    details: Option<wgpu::Buffer>,
    /// `Some` for a search.
    plan: Option<Arc<Plan>>,
}

impl GpuSession {
    pub(super) fn submit(&mut self, number: u64, work: Submission) -> Result<(), Error> {
        let is_search = matches!(work, Submission::Full(_));
        let submitted = match self.try_submit(number, work.clone()) {
            Err(error @ (Error::DeviceOutOfMemory { .. } | Error::LimitExceeded { .. }))
                if is_search && self.uses_candidates(number) =>
            {
                self.slot_mut(number).call.may_use_candidates = false;
                self.try_submit(number, work).inspect(|()| {
                    log::info!("the device cannot hold the candidates: {error}");
                    self.pause_skin(number);
                })
            }
            submitted => submitted,
        };
        submitted.map_err(|error| self.gpu.reason(error))
    }

    fn try_submit(&mut self, number: u64, work: Submission) -> Result<(), Error> {
        let Self { gpu, detector, layouts, skin, slots, .. } = self;
        let gpu = &*gpu;
        let slot = &mut slots[CallSlot::index_of(number)];
        let capacity = match &work {
            Submission::Copy(output) => output.capacity,
            Submission::Full(_) | Submission::Continuation(_) => detector.pair_capacity(),
        };
        let staged = self.expected.min(capacity.into());
        let staging = slot.buffers.staging(gpu, staged)?;
        let mut encoder = Encoder { gpu, commands: new_encoder(gpu)? };
        // After this, also after an error, no earlier call can be continued.
        self.submitted = None;
        let skin = skin.as_mut().filter(|_| slot.call.may_use_candidates);
        let Encoded { submitted, output, details, plan } = match (work, skin) {
            (Submission::Full(window), Some(skin)) => {
                slot.list.get_or_insert_with(|| self.list_calls.begin());
                slot.encode_candidate_search(&mut encoder, &window, skin, detector)?
            }
            (Submission::Full(window), None) => {
                slot.encode_search(&mut encoder, &window, detector, layouts)?
            }
            (Submission::Continuation(output), _) => slot.encode_continuation(&mut encoder, output, detector),
            (Submission::Copy(output), _) => slot.copy(output),
        };
        let staged = staged.min(output.capacity.into());
        copy_to_staging(
            &mut encoder.commands,
            [Some(&output.outcome), details.as_ref(), Some(&output.pairs)],
            &staging,
            staged,
        );
        slot.buffers.lend_staging();
        let (submission, mapping) = with_error_scope(&gpu.device, "a call", 0, || {
            (gpu.queue.submit([encoder.commands.finish()]), Mapping::request(&staging))
        })?;
        gpu.check_lost()?;
        if let Submitted::Search { .. } = submitted {
            detector.note_submitted();
        }
        let device = gpu.device.clone();
        slot.pending = Some(PendingReadback { device, submission, mapping, staged, submitted, plan });
        self.submitted = Some((number, output));
        Ok(())
    }

    pub(super) async fn wait(&mut self, number: u64, wait: Wait) -> Result<Outcome, Error> {
        let slot = &mut self.slots[CallSlot::index_of(number)];
        self.last.counts = slot.counts;
        let mut pending = slot.pending.take().ok_or(Error::ForeignTicket)?;
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
        if outcome.found() <= pending.staged {
            returned.append_pairs(outcome.found() as usize, &mut self.pairs)?;
        }
        if self.detector.ticks().is_some() {
            let period = f64::from(self.gpu.queue.get_timestamp_period()) * 1e-9;
            for &phase in pending.submitted.timed_phases() {
                let [begin, end] = returned.ticks(phase);
                self.time(phase.name(), Duration::from_secs_f64(end.saturating_sub(begin) as f64 * period));
            }
        }
        self.last.outcome = outcome;
        match pending.submitted {
            Submitted::Search { reuses_layout } => {
                self.layouts.record(reuses_layout, &outcome);
                self.last.list = None;
            }
            Submitted::CandidateSearch { skin } => self.record_state(number, skin, &returned.state()),
            Submitted::Continuation | Submitted::Copy => {}
        }
        drop(view);
        if let Some(plan) = pending.plan.take() {
            self.last.plan = Some(plan);
        }
        let staging = pending.mapping.buffer().clone();
        drop(pending);
        self.slot_mut(number).buffers.return_staging(staging);
        self.time("read", start.elapsed());
        Ok(outcome)
    }
}

impl CallSlot {
    fn encode_search(
        &mut self,
        encoder: &mut Encoder<'_>,
        window: &Range<u32>,
        detector: &mut GpuDetector,
        layouts: &LayoutReuse,
    ) -> Result<Encoded, Error> {
        let input = self.input(window, detector.has_interactions())?;
        let output = detector.bind_as(self.call.choice, &input, layouts.source(self.call.reuses_layout))?;
        let (parts, reuses_layout) = (detector.parts(), detector.reuses_layout());
        encoder.encode_parts(parts, |commands, part| detector.encode_part(commands, part))?;
        self.counts.searches += 1;
        self.counts.parts += parts;
        self.counts.reused_layouts += u32::from(reuses_layout);
        let (details, plan) = (detector.ticks().cloned(), detector.plan().cloned());
        Ok(Encoded { submitted: Submitted::Search { reuses_layout }, output, details, plan })
    }

    fn encode_candidate_search(
        &mut self,
        encoder: &mut Encoder<'_>,
        window: &Range<u32>,
        skin: &mut SkinSession,
        settings: &GpuDetector,
    ) -> Result<Encoded, Error> {
        skin.detector.set_pair_capacity(settings.pair_capacity());
        let output =
            skin.detector.bind_as(self.call.choice, &self.input(window, settings.has_interactions())?)?;
        let parts = skin.detector.parts();
        if skin.is_long_search(self.buffers.count, settings.budget()) {
            self.counts.parts += parts;
            encoder.encode_parts(parts, |commands, part| skin.detector.encode_part(commands, part))?;
        } else {
            self.counts.parts += 1;
            (0..parts).for_each(|part| skin.detector.encode_part(&mut encoder.commands, part));
        }
        self.counts.searches += 1;
        let submitted = Submitted::CandidateSearch { skin: skin.detector.skin() };
        let (details, plan) = (skin.detector.state().cloned(), skin.detector.plan().cloned());
        Ok(Encoded { submitted, output, details, plan })
    }

    fn encode_continuation(
        &mut self,
        encoder: &mut Encoder<'_>,
        output: GpuOutput,
        detector: &GpuDetector,
    ) -> Encoded {
        detector.encode_continuation(&mut encoder.commands);
        self.counts.parts += 1;
        Encoded { submitted: Submitted::Continuation, output, details: detector.ticks().cloned(), plan: None }
    }

    fn copy(&mut self, output: GpuOutput) -> Encoded {
        self.counts.copies += 1;
        Encoded { submitted: Submitted::Copy, output, details: None, plan: None }
    }
}

fn new_encoder(gpu: &GpuDevice) -> Result<wgpu::CommandEncoder, Error> {
    with_error_scope(&gpu.device, "an encoder", 0, || gpu.device.create_command_encoder(&Default::default()))
}

impl Encoder<'_> {
    /// Encodes all parts and submits all but the last, so that no submission is long.
    fn encode_parts(
        &mut self,
        parts: u32,
        encode: impl Fn(&mut wgpu::CommandEncoder, u32),
    ) -> Result<(), Error> {
        let gpu = self.gpu;
        for part in 0..parts {
            if part > 0 {
                let full = std::mem::replace(&mut self.commands, new_encoder(gpu)?);
                with_error_scope(&gpu.device, "a part of a call", 0, || gpu.queue.submit([full.finish()]))?;
            }
            encode(&mut self.commands, part);
        }
        Ok(())
    }
}
