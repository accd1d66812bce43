use std::ops::{ControlFlow, Range};
use std::sync::{Arc, Weak};
use std::time::{Duration, Instant};

use lazygrid_host::Phase as Timing;
use lazygrid_kernels::layout::Outcome;
use lazygrid_kernels::{Algorithm, Pair, Spheres};

use super::GpuError;
use super::adapter::{AdapterSummary, GpuDevice};
use super::detector::GpuDetector;
use super::input::{Count, GpuSettings, GpuSpheres};
use super::mapping::{Mapping, Wait};
use super::plan::Phase;
use super::scope::scoped;
use super::slot::{Returned, Slot, copy_back, staged_pairs};

/// Calls that may be in flight at once.
const SLOTS: usize = 2;
/// Pairs that the first call brings back together with their number.
const FIRST_PAIRS: u64 = 1 << 12;

/// Host in, host out: uploads, detects, reads back, and repeats what did not fit.
///
/// Two calls may be in flight: [`begin`](Self::begin) one while the other is worked on, so that upload, detection
/// and readback overlap. The input is not checked here; spheres that are not finite pair with nothing.
#[derive(Debug)]
pub struct GpuSession {
    own: GpuDevice,
    detector: GpuDetector,
    raster_ratio: f32,
    timeout: Duration,
    slots: [Slot; SLOTS],
    begun: u64,
    flights: [Option<Flight>; SLOTS],
    tickets: [Weak<()>; SLOTS],
    expected: u64,
    pairs: Vec<Pair>,
    timings: Vec<Timing>,
    last: Outcome,
}

/// A call that was begun and is to be finished. Dropping it gives the call up and makes room for another.
#[derive(Debug, PartialEq, Eq)]
#[must_use = "the result comes with `finish`"]
pub struct Ticket {
    number: u64,
    /// Seen by the session to be gone.
    _held: Arc<()>,
}

/// Work on its way back.
#[derive(Debug)]
struct Flight {
    number: u64,
    submission: wgpu::SubmissionIndex,
    staging: wgpu::Buffer,
    mapping: Mapping,
    staged: u64,
    capacity: u32,
}

impl Drop for Flight {
    /// Whether it landed or was given up: the staging buffer is used again.
    fn drop(&mut self) {
        self.staging.unmap();
    }
}

impl GpuSession {
    /// A session on this device.
    ///
    /// # Errors
    /// As [`GpuDetector::new`].
    pub fn new(own: GpuDevice, settings: GpuSettings) -> Result<Self, GpuError> {
        Ok(Self {
            raster_ratio: settings.raster_ratio,
            detector: GpuDetector::with_pipelines(&own.device, own.pipelines.clone(), settings)?,
            own,
            timeout: Duration::from_secs(600),
            slots: Default::default(),
            begun: 0,
            flights: Default::default(),
            tickets: Default::default(),
            expected: FIRST_PAIRS,
            pairs: Vec::new(),
            timings: Vec::new(),
            last: Outcome::default(),
        })
    }

    /// How long a call may take before it is given up with [`GpuError::Timeout`]. Default: ten minutes.
    pub fn set_timeout(&mut self, timeout: Duration) {
        self.timeout = timeout;
    }

    /// What it runs on.
    pub fn adapter(&self) -> &AdapterSummary {
        &self.own.adapter
    }

    /// The algorithm of the last call; `Auto` before the first.
    pub fn algorithm(&self) -> Algorithm {
        self.detector.plan().map_or(Algorithm::Auto, |plan| plan.algorithm)
    }

    /// What the last finished call found besides its pairs.
    pub fn outcome(&self) -> &Outcome {
        &self.last
    }

    /// Times of the last finished call: GPU phases where they can be taken, and what the host waited for.
    pub fn timings(&self) -> &[Timing] {
        &self.timings
    }

    /// Bytes of device memory for calls of up to `spheres` spheres, input and way back included.
    ///
    /// # Errors
    /// [`GpuError::LimitExceeded`] where the device cannot hold it.
    pub fn memory_for(&self, spheres: u32) -> Result<u64, GpuError> {
        let input = u64::from(spheres).next_power_of_two().max(1) * 16;
        Ok(self.detector.memory_for(spheres)? + SLOTS as u64 * (input + self.expected * 8))
    }

    /// Bytes of device memory held now for input and way back.
    pub fn held_bytes(&self) -> u64 {
        self.slots.iter().map(Slot::device_bytes).sum()
    }

    /// Uploads the spheres and starts the detection; does not wait.
    ///
    /// # Errors
    /// [`GpuError::Busy`] with two calls in flight already; otherwise as [`GpuDetector::encode`].
    pub fn begin(&mut self, spheres: Spheres<'_>) -> Result<Ticket, GpuError> {
        for (flight, ticket) in self.flights.iter_mut().zip(&self.tickets) {
            if ticket.strong_count() == 0 {
                *flight = None;
            }
        }
        let slot_of = |number: u64| number as usize % SLOTS;
        let mut numbers = self.begun..self.begun + SLOTS as u64;
        let Some(number) = numbers.find(|&number| self.flights[slot_of(number)].is_none()) else {
            return Err(GpuError::Busy { calls: SLOTS });
        };
        self.slots[slot_of(number)].upload(&self.own, spheres).map_err(|error| self.own.reason(error))?;
        self.launch(number, GpuSpheres::ALL)?;
        self.begun = number + 1;
        let held = Arc::new(());
        self.tickets[slot_of(number)] = Arc::downgrade(&held);
        Ok(Ticket { number, _held: held })
    }

    /// The pairs of a call, unordered; repeats it with more room where they did not fit. The slice lives until
    /// the next call is finished.
    ///
    /// # Errors
    /// [`GpuError::TooManyPairs`] above `limit`, with the exact number; otherwise where the device fails.
    pub fn finish(&mut self, ticket: Ticket, limit: u64) -> Result<&[Pair], GpuError> {
        pollster::block_on(self.collect(ticket, limit, Wait::Blocking))?;
        Ok(&self.pairs)
    }

    /// As [`finish`](Self::finish), without blocking the caller's thread.
    ///
    /// # Errors
    /// As [`finish`](Self::finish).
    pub async fn finish_async(&mut self, ticket: Ticket, limit: u64) -> Result<&[Pair], GpuError> {
        self.collect(ticket, limit, Wait::Async).await?;
        Ok(&self.pairs)
    }

    /// How many pairs a call found, however many that are.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn finish_count(&mut self, ticket: Ticket) -> Result<u64, GpuError> {
        self.pairs.clear();
        pollster::block_on(self.settle(ticket.number, GpuSpheres::ALL, Wait::Blocking))
            .map(|outcome| outcome.found())
    }

    /// Hands the pairs of a call over in parts whose smaller indices ascend from part to part; within a part they
    /// are unordered. Memory stays bounded by the output's capacity.
    ///
    /// # Errors
    /// Where the device fails, or where the pairs of a single sphere do not fit the output.
    pub fn finish_in_parts(
        &mut self,
        ticket: Ticket,
        mut consume: impl FnMut(&mut Vec<Pair>) -> ControlFlow<()>,
    ) -> Result<(), GpuError> {
        self.pairs.clear();
        let outcome = pollster::block_on(self.settle(ticket.number, GpuSpheres::ALL, Wait::Blocking))?;
        if outcome.found() == self.pairs.len() as u64 {
            let _ = consume(&mut self.pairs);
            return Ok(());
        }
        pollster::block_on(
            self.windows(ticket.number, outcome.found(), Wait::Blocking, |pairs| consume(pairs)),
        )
    }

    async fn collect(&mut self, ticket: Ticket, limit: u64, wait: Wait) -> Result<(), GpuError> {
        self.pairs.clear();
        let number = ticket.number;
        let found = self.settle(number, GpuSpheres::ALL, wait).await?.found();
        if found > limit {
            self.pairs.clear();
            return Err(GpuError::TooManyPairs { found, limit });
        }
        if found == self.pairs.len() as u64 {
            return Ok(());
        }
        self.expected = found.next_power_of_two();
        if found > u64::from(self.capacity()) {
            self.detector.set_pair_capacity(self.largest_capacity().min(found.next_power_of_two()) as u32);
        }
        if found <= u64::from(self.capacity()) {
            self.pairs.clear();
            self.launch(number, GpuSpheres::ALL)?;
            self.settle(number, GpuSpheres::ALL, wait).await?;
            return Ok(());
        }
        let mut all = Vec::new();
        self.windows(number, found, wait, |pairs| {
            all.append(pairs);
            ControlFlow::Continue(())
        })
        .await?;
        self.pairs = all;
        Ok(())
    }

    /// Waits for a call and appends the pairs that came back; repeats it with more room for entries, or
    /// with a coarser raster, where they found none.
    async fn settle(&mut self, number: u64, window: Range<u32>, wait: Wait) -> Result<Outcome, GpuError> {
        self.timings.clear();
        let mut ratio = self.raster_ratio;
        loop {
            let outcome = self.land(number, wait).await?;
            self.last = outcome;
            if outcome.overflow & Outcome::ENTRIES == 0 {
                return Ok(outcome);
            }
            self.pairs.clear();
            if self.detector.set_entry_capacity(outcome.entries()) {
                log::info!("{} entries do not fit: repeating with room for them", outcome.entries());
                self.launch(number, window.clone())?;
                continue;
            }
            ratio *= 2.0;
            if ratio > GpuSettings::MAX_RASTER_RATIO {
                let limit = self.detector.plan().map_or(0, |plan| plan.entries.into());
                let (what, remedy) = ("the number of (cell, object) entries", "split the spheres");
                return Err(GpuError::LimitExceeded { what, needed: outcome.entries(), limit, remedy });
            }
            log::info!("{} entries do not fit: repeating with raster ratio {ratio}", outcome.entries());
            let relaunched =
                self.detector.set_raster_ratio(ratio).and_then(|()| self.launch(number, window.clone()));
            self.detector.set_raster_ratio(self.raster_ratio)?;
            relaunched?;
        }
    }

    /// Repeats a call for one window of smaller indices after another, each as large as the output holds.
    async fn windows(
        &mut self,
        number: u64,
        found: u64,
        wait: Wait,
        mut consume: impl FnMut(&mut Vec<Pair>) -> ControlFlow<()>,
    ) -> Result<(), GpuError> {
        let count = self.slots[number as usize % SLOTS].count;
        let capacity = u64::from(self.capacity());
        self.expected = capacity;
        let mut width = (u64::from(count) * capacity / found.max(1)).clamp(1, u64::from(count)) as u32;
        let mut begin = 0;
        while begin < count {
            let end = begin.saturating_add(width).min(count);
            self.pairs.clear();
            self.launch(number, begin..end)?;
            let outcome = self.settle(number, begin..end, wait).await?;
            if outcome.found() > capacity {
                if width == 1 {
                    let (needed, limit) = (outcome.found() * 8, capacity * 8);
                    let (what, remedy) = ("the pairs of one sphere", "raise the pair capacity");
                    return Err(GpuError::LimitExceeded { what, needed, limit, remedy });
                }
                width = width.div_ceil(2);
                continue;
            }
            if outcome.found() < capacity / 2 {
                width = width.saturating_mul(2);
            }
            begin = end;
            if consume(&mut self.pairs).is_break() {
                break;
            }
        }
        Ok(())
    }

    fn capacity(&self) -> u32 {
        self.detector.pair_capacity()
    }

    /// The most pairs that the device can bind, and read back in one piece.
    fn largest_capacity(&self) -> u64 {
        let limits = self.own.device.limits();
        (limits.max_storage_buffer_binding_size.min(limits.max_buffer_size / 2) / 8).min(1 << 31)
    }

    /// Records and submits a call together with its way back.
    fn launch(&mut self, number: u64, window: Range<u32>) -> Result<(), GpuError> {
        self.submit(number, window).map_err(|error| self.own.reason(error))
    }

    fn submit(&mut self, number: u64, window: Range<u32>) -> Result<(), GpuError> {
        let Self { own, detector, slots, expected, .. } = self;
        let slot = &mut slots[number as usize % SLOTS];
        let capacity = detector.pair_capacity();
        let staged = (*expected).min(capacity.into());
        let staging = slot.staging(own, staged)?;
        let Some(spheres) = slot.spheres.clone() else { return Ok(()) };
        let mut encoder = own.device.create_command_encoder(&Default::default());
        let species = slot.species.as_ref().filter(|_| detector.has_interactions());
        let input = GpuSpheres { spheres: &spheres, count: Count::Host(slot.count), species, window };
        detector.encode(&mut encoder, &input)?;
        let staged = staged.min(staged_pairs(&staging));
        copy_back(&mut encoder, [detector.outcome(), detector.ticks(), detector.pairs()], &staging, staged);
        let submission = scoped(&own.device, "a call", 0, || own.queue.submit([encoder.finish()]))?;
        own.check_lost()?;
        let mapping = Mapping::request(&staging);
        let flight = Flight { number, submission, staging, mapping, staged, capacity };
        self.flights[number as usize % SLOTS] = Some(flight);
        Ok(())
    }

    /// Waits for what was launched and appends its pairs, if all of them came back.
    async fn land(&mut self, number: u64, wait: Wait) -> Result<Outcome, GpuError> {
        let flight = self.flights[number as usize % SLOTS].take().filter(|flight| flight.number == number);
        let Some(flight) = flight else {
            return Err(GpuError::Busy { calls: SLOTS });
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
        let view =
            view.map_err(|error| GpuError::Validation { what: "readback", reason: error.to_string() })?;
        let returned = Returned(&view);
        let outcome = returned.outcome()?;
        if outcome.found() <= flight.staged.min(flight.capacity.into()) {
            returned.append_pairs(outcome.found() as usize, &mut self.pairs);
        }
        if self.detector.ticks().is_some() {
            let period = f64::from(self.own.queue.get_timestamp_period()) * 1e-9;
            for (phase, [begin, end]) in Phase::ALL.into_iter().zip(returned.ticks()) {
                self.time(phase.name(), Duration::from_secs_f64(end.saturating_sub(begin) as f64 * period));
            }
        }
        drop(view);
        drop(flight);
        self.time("read", start.elapsed());
        Ok(outcome)
    }

    fn time(&mut self, name: &'static str, time: Duration) {
        match self.timings.iter_mut().find(|timing| timing.name == name) {
            Some(timing) => timing.time += time,
            None => self.timings.push(Timing { name, time }),
        }
    }

    /// Moves the pairs of the last call out, and a list in whose memory the next call may use.
    pub fn swap_pairs(&mut self, pairs: &mut Vec<Pair>) {
        std::mem::swap(&mut self.pairs, pairs);
    }
}
