mod call;
mod call_buffers;
mod layout_reuse;
mod retry;
mod skin;
mod submission;

use std::ops::{ControlFlow, Range};
use std::sync::Arc;
use std::time::Duration;

use lazygrid_host::{CandidateListStats, PhaseTime};
use lazygrid_kernels::layout::Outcome;
use lazygrid_kernels::{Algorithm, Interactions, Pair, Space, Spheres};

use super::config::{GpuConfig, check_algorithm};
use super::detector::{AlgorithmChoice, GpuDetector, GpuOutput};
use super::device::{AdapterSummary, GpuDevice, Wait};
use super::plan::{CallCost, DeviceLimits, Plan, most_spheres};
use crate::Error;
use call::CallSlot;
use layout_reuse::LayoutReuse;
use skin::{ListCalls, SkinSession};
use submission::Submission;

pub(crate) use call::QueuedCall;
pub use call::{SubmissionCounts, Ticket};

const MAX_IN_FLIGHT: usize = 2;
/// Pairs in the first readback of a session.
const FIRST_PAIRS: u64 = 1 << 12;

/// Uploads spheres, reads their pairs back, and retries if a capacity was too small.
///
/// Two calls may be in flight to overlap transfers and detection. Invalid spheres never pair.
#[derive(Debug)]
pub struct GpuSession {
    gpu: GpuDevice,
    detector: GpuDetector,
    layouts: LayoutReuse,
    skin: Option<SkinSession>,
    list_calls: ListCalls,
    requested: AlgorithmChoice,
    timeout: Duration,
    slots: [CallSlot; MAX_IN_FLIGHT],
    next_number: u64,
    /// The call whose result is in these buffers of a detector.
    submitted: Option<(u64, GpuOutput)>,
    /// Pairs in the first readback of a call.
    expected: u64,
    pairs: Vec<Pair>,
    gathered: Vec<Pair>,
    last: LastCall,
}

/// The report of the last finished call.
#[derive(Debug, Default)]
struct LastCall {
    plan: Option<Arc<Plan>>,
    outcome: Outcome,
    counts: SubmissionCounts,
    timings: Vec<PhaseTime>,
    list: Option<CandidateListStats>,
    /// Age and displacement fraction of the list before the call.
    previous_list: (u32, f32),
}

impl GpuSession {
    pub(crate) fn subgroup_refusal(&self) -> Option<&str> {
        self.gpu.subgroup_refusal()
    }

    /// Creates a session.
    ///
    /// # Errors
    /// See [`GpuDetector::new`]; also [`Error::DeviceLost`].
    pub fn new(gpu: GpuDevice, settings: GpuConfig) -> Result<Self, Error> {
        gpu.probe()?;
        // The session hides the cell order, and uploads rows.
        let settings = settings.pairs_in_cell_order(false).columns(None);
        let detector = GpuDetector::with_pipelines(&gpu.device, gpu.pipelines.clone(), settings)
            .map_err(|error| gpu.reason(error))?;
        let requested = detector.algorithm_choice();
        Ok(Self {
            requested,
            detector,
            layouts: LayoutReuse::default(),
            skin: None,
            list_calls: ListCalls::default(),
            gpu,
            timeout: Duration::from_secs(600),
            slots: [(); MAX_IN_FLIGHT].map(|()| CallSlot::new(requested)),
            next_number: 0,
            submitted: None,
            expected: FIRST_PAIRS,
            pairs: Vec::new(),
            gathered: Vec::new(),
            last: LastCall::default(),
        })
    }

    pub(crate) fn with_interactions(
        &self,
        interactions: Option<Interactions>,
        most_frequent: Option<u32>,
    ) -> Result<Self, Error> {
        let settings = self.detector.settings().clone().interactions(interactions);
        let settings = GpuConfig { most_frequent, ..settings };
        let mut session = Self::new(self.gpu.clone(), settings)?;
        session.detector.restore_capacities(self.detector.capacities());
        (session.timeout, session.expected) = (self.timeout, self.expected);
        Ok(session)
    }

    /// Changes the space, which must keep its periodic axes, and discards candidates. No call may be in flight, since
    /// its retry would search the new space.
    pub(crate) fn set_space(&mut self, space: Space) -> Result<(), Error> {
        debug_assert!(self.slots.iter().all(CallSlot::is_abandoned));
        if self.detector.settings().space != space {
            // After an error no skin is left in the old space.
            let distance = self.skin.take().map(|skin| skin.detector.skin());
            self.detector.set_space(space);
            self.set_skin(distance)?;
        }
        Ok(())
    }

    /// Sets the time limit of a submission ([`Error::Timeout`]). Default: ten minutes.
    pub fn set_timeout(&mut self, timeout: Duration) {
        self.timeout = timeout;
    }

    /// Returns the adapter.
    pub fn adapter(&self) -> &AdapterSummary {
        &self.gpu.adapter
    }

    /// Sets [`GpuConfig::algorithm`] for later calls.
    ///
    /// # Errors
    /// [`Error::NotOnBackend`] for an algorithm without kernels.
    pub fn set_algorithm(&mut self, algorithm: Algorithm) -> Result<(), Error> {
        check_algorithm(algorithm)?;
        self.requested.algorithm = algorithm;
        Ok(())
    }

    /// Returns the algorithm of the last finished call: ArrayGrid if the entries of several levels did not fit; `Auto`
    /// before the first call.
    pub fn algorithm(&self) -> Algorithm {
        self.last.plan.as_ref().map_or(Algorithm::Auto, |plan| plan.algorithm)
    }

    /// Returns the planned cost of the last finished call; `None` if a candidate list answered it.
    pub fn cost(&self) -> Option<CallCost> {
        let is_search = self.last.list.is_none_or(|stats| stats.rebuilt.is_some());
        self.last.plan.as_ref().filter(|_| is_search).map(|plan| plan.cost())
    }

    /// Returns the submissions of the last finished call.
    pub fn submissions(&self) -> SubmissionCounts {
        self.last.counts
    }

    /// Returns the outcome of the last finished call.
    pub fn outcome(&self) -> &Outcome {
        &self.last.outcome
    }

    /// Returns the times of the last finished call, summed over its submissions: GPU phases if available, and host
    /// waits.
    pub fn timings(&self) -> &[PhaseTime] {
        &self.last.timings
    }

    /// Returns the bytes of device memory for calls of up to `spheres` spheres, with input and readback.
    ///
    /// # Errors
    /// [`Error::LimitExceeded`] if the device cannot hold it.
    pub fn memory_for(&self, spheres: u32) -> Result<u64, Error> {
        let working = match &self.skin {
            None => self.detector.memory_for(spheres)?,
            Some(skin) => skin.detector.memory_for(spheres)?,
        };
        Ok(working + self.io_memory(spheres))
    }

    fn io_memory(&self, spheres: u32) -> u64 {
        let per_sphere = if self.detector.has_interactions() { 20 } else { 16 };
        let input = u64::from(spheres).next_power_of_two().max(1) * per_sphere;
        MAX_IN_FLIGHT as u64 * (input + self.expected * 8)
    }

    /// Returns the most spheres of a call. No buffer of a grid's plan must have more bytes per sphere than the input.
    pub(crate) fn most_spheres(&self) -> u64 {
        most_spheres(&DeviceLimits::from_device(&self.gpu.device))
    }

    /// Returns the bytes of input and staging buffers.
    pub fn held_bytes(&self) -> u64 {
        let pending = self.slots.iter().filter_map(|slot| slot.pending.as_ref());
        let staging = pending.map(|pending| pending.mapping.buffer().size());
        self.slots.iter().map(|slot| slot.buffers.device_bytes()).chain(staging).sum()
    }

    /// Uploads the spheres and starts the detection, without waiting.
    ///
    /// # Errors
    /// [`Error::TooManyInFlight`] with two calls in flight; [`Error::InvalidSetting`] for `f64` spheres and spheres
    /// with groups, which only [`Detector`](crate::Detector) supports; otherwise as [`GpuDetector::encode`].
    pub fn begin(&mut self, spheres: Spheres<'_>) -> Result<Ticket, Error> {
        if spheres.is_f64() {
            let range = "a session searches f32 numbers: use `Detector`, or convert the spheres";
            return Err(Error::InvalidSetting { name: "spheres", value: "f64".into(), range });
        }
        if spheres.groups().is_some() {
            let range =
                "a session reports all pairs that touch: use `Detector`, or filter the pairs after readback";
            return Err(Error::InvalidSetting { name: "groups", value: "given".into(), range });
        }
        self.begin_as(self.call(self.requested.algorithm), spheres)
    }

    pub(crate) fn call(&self, algorithm: Algorithm) -> QueuedCall {
        QueuedCall::new(AlgorithmChoice { algorithm, ..self.requested })
    }

    pub(crate) fn begin_as(&mut self, call: QueuedCall, spheres: Spheres<'_>) -> Result<Ticket, Error> {
        for slot in self.slots.iter_mut().filter(|slot| slot.is_abandoned()) {
            slot.pending = None;
        }
        let mut numbers = self.next_number..self.next_number + MAX_IN_FLIGHT as u64;
        let Some(number) = numbers.find(|&number| self.slot(number).pending.is_none()) else {
            return Err(Error::TooManyInFlight { calls: MAX_IN_FLIGHT });
        };
        let window = call.window.clone();
        let may_use_candidates = call.may_use_candidates && self.has_skin(number);
        let slot = &mut self.slots[CallSlot::index_of(number)];
        slot.buffers.upload(&self.gpu, spheres).map_err(|error| self.gpu.reason(error))?;
        slot.set_call(QueuedCall { may_use_candidates, ..call });
        self.submit(number, Submission::Full(window))?;
        self.next_number = number + 1;
        Ok(self.slot_mut(number).new_ticket(number))
    }

    fn slot(&self, number: u64) -> &CallSlot {
        &self.slots[CallSlot::index_of(number)]
    }

    fn slot_mut(&mut self, number: u64) -> &mut CallSlot {
        &mut self.slots[CallSlot::index_of(number)]
    }

    /// Waits for a call and returns its pairs, unordered.
    ///
    /// # Errors
    /// [`Error::TooManyPairs`] above `limit`, with the exact number; [`Error::ForeignTicket`]; an error of the device.
    pub fn finish(&mut self, ticket: Ticket, limit: u64) -> Result<&[Pair], Error> {
        pollster::block_on(self.collect(ticket, limit, Wait::Blocking))?;
        Ok(&self.pairs)
    }

    /// Works like [`finish`](Self::finish) without blocking the thread.
    ///
    /// # Errors
    /// See [`finish`](Self::finish).
    pub async fn finish_async(&mut self, ticket: Ticket, limit: u64) -> Result<&[Pair], Error> {
        self.collect(ticket, limit, Wait::Async).await?;
        Ok(&self.pairs)
    }

    /// Waits for a call and returns its number of pairs.
    ///
    /// # Errors
    /// [`Error::ForeignTicket`], or an error of the device.
    pub fn finish_count(&mut self, ticket: Ticket) -> Result<u64, Error> {
        let window = self.begin_finish(&ticket)?;
        pollster::block_on(self.finish_with_retries(ticket.number, window, Wait::Blocking))
            .map(|outcome| outcome.found())
    }

    /// Returns the window of the call, and begins its report.
    fn begin_finish(&mut self, ticket: &Ticket) -> Result<Range<u32>, Error> {
        let slot = self.slot(ticket.number);
        if !slot.has_ticket(ticket) {
            return Err(Error::ForeignTicket);
        }
        let window = slot.call.window.clone();
        self.pairs.clear();
        let mut timings = std::mem::take(&mut self.last.timings);
        timings.clear();
        self.last = LastCall { timings, ..LastCall::default() };
        Ok(window)
    }

    /// Passes the pairs of a call to `consume` in parts by ascending smaller index, unordered within a part. The output
    /// grows only if a sphere has more pairs than its capacity.
    ///
    /// # Errors
    /// [`Error::ForeignTicket`], or an error of the device, which may be unable to hold the pairs of a single sphere.
    pub fn finish_in_parts(
        &mut self,
        ticket: Ticket,
        mut consume: impl FnMut(&mut Vec<Pair>) -> ControlFlow<()>,
    ) -> Result<(), Error> {
        let window = self.begin_finish(&ticket)?;
        let outcome = pollster::block_on(self.finish_with_retries(ticket.number, window, Wait::Blocking))?;
        let found = outcome.found();
        let is_read = found == self.pairs.len() as u64
            || pollster::block_on(self.copy_pairs(ticket.number, found, Wait::Blocking))?;
        if is_read {
            let _ = consume(&mut self.pairs);
            return Ok(());
        }
        pollster::block_on(self.read_windows(ticket.number, found, Wait::Blocking, |pairs| consume(pairs)))
    }

    async fn collect(&mut self, ticket: Ticket, limit: u64, wait: Wait) -> Result<(), Error> {
        let (number, window) = (ticket.number, self.begin_finish(&ticket)?);
        let mut found = self.finish_with_retries(number, window.clone(), wait).await?.found();
        if found > limit {
            self.pairs.clear();
            return Err(Error::TooManyPairs { found, limit });
        }
        if found == self.pairs.len() as u64 || self.copy_pairs(number, found, wait).await? {
            return Ok(());
        }
        if found <= self.largest_capacity().max(self.capacity().into()) {
            self.pairs.clear();
            self.retry_for_pairs(number, window.clone(), found)?;
            found = self.finish_with_retries(number, window, wait).await?.found();
            // Another kernel may round tangent pairs differently and find more.
            if found == self.pairs.len() as u64 {
                return Ok(());
            }
            self.pairs.clear();
        }
        let before = self.detector.capacities();
        let is_grown = self.grow_for_windows(found);
        match self.gather_windows(number, found, wait).await {
            Err(Error::DeviceOutOfMemory { .. }) if is_grown => {
                self.detector.restore_capacities(before);
                self.gather_windows(number, found, wait).await
            }
            gathered => gathered,
        }
    }

    fn capacity(&self) -> u32 {
        self.detector.pair_capacity()
    }

    fn largest_capacity(&self) -> u64 {
        let limits = self.gpu.device.limits();
        (limits.max_storage_buffer_binding_size.min(limits.max_buffer_size / 2) / 8).min(1 << 31)
    }

    fn time(&mut self, name: &'static str, time: Duration) {
        PhaseTime::add(&mut self.last.timings, name, time);
    }

    pub(crate) fn pairs_mut(&mut self) -> &mut Vec<Pair> {
        &mut self.pairs
    }
}

#[cfg(test)]
mod in_flight_tests;
#[cfg(test)]
mod random_tests;
#[cfg(test)]
mod tests;
