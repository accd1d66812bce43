use std::ops::{ControlFlow, Range};

use lazygrid_kernels::layout::Outcome;
use lazygrid_kernels::{Algorithm, Pair, try_reserve};

use super::GpuSession;
use super::call::Submitted;
use super::skin::PAUSE;
use super::submission::Submission;
use crate::Error;
use crate::gpu::config::GpuConfig;
use crate::gpu::detector::{AlgorithmChoice, CapacitySnapshot, GpuOutput};
use crate::gpu::device::Wait;

/// Parts of a candidate search in crowded cells above which a list has too many candidates to be worthwhile.
const MAX_DEFERRED_PARTS: u32 = 4096;

impl AlgorithmChoice {
    /// Returns a coarser grid; after the coarsest a single level at the `configured` cell ratio, for coincident
    /// spheres.
    fn with_fewer_entries(self, ran: Algorithm, configured: f32) -> Option<Self> {
        if self.cell_ratio < GpuConfig::MAX_CELL_RATIO {
            let cell_ratio = (self.cell_ratio * 2.0).min(GpuConfig::MAX_CELL_RATIO);
            return Some(Self { cell_ratio, ..self });
        }
        let one_level = Self { algorithm: Algorithm::ArrayGrid, cell_ratio: configured };
        matches!(ran, Algorithm::EagerGrid | Algorithm::LazyGrid).then_some(one_level)
    }
}

impl GpuSession {
    pub(super) async fn finish_with_retries(
        &mut self,
        number: u64,
        window: Range<u32>,
        wait: Wait,
    ) -> Result<Outcome, Error> {
        loop {
            let submitted = self.slot(number).pending.as_ref().map(|pending| pending.submitted);
            let outcome = self.wait(number, wait).await.map_err(|error| self.gpu.reason(error))?;
            let overflow = outcome.overflow & !Outcome::OVERFLOW_PAIRS;
            if let Some(Submitted::CandidateSearch { skin }) = submitted
                && overflow != 0
            {
                self.pairs.clear();
                self.retry_for_candidates(number, window.clone(), skin, &outcome)?;
            } else if overflow & Outcome::OVERFLOW_LAYOUT != 0 {
                log::debug!("the cells of an earlier call do not suit the spheres: retrying with new cells");
                self.pairs.clear();
                self.slot_mut(number).call.reuses_layout = false;
                self.submit(number, Submission::Full(window.clone()))?;
            } else if overflow & Outcome::OVERFLOW_ENTRIES != 0 {
                self.pairs.clear();
                self.retry_for_entries(number, window.clone(), outcome.entries_needed())?;
            } else if !outcome.has_remaining_work() {
                return Ok(outcome);
            } else {
                // The last part delivers all pairs.
                self.pairs.clear();
                let work = match self.output_of(number) {
                    Some(output) => Submission::Continuation(output),
                    None => Submission::Full(window.clone()),
                };
                self.submit(number, work)?;
            }
        }
    }

    /// Returns the output of the call, unless a later submission may have overwritten it.
    fn output_of(&self, number: u64) -> Option<GpuOutput> {
        let (submitted, output) = self.submitted.as_ref()?;
        (*submitted == number).then(|| output.clone())
    }

    /// Returns `false` if no output holds all pairs.
    pub(super) async fn copy_pairs(&mut self, number: u64, found: u64, wait: Wait) -> Result<bool, Error> {
        let Some(output) = self.output_of(number).filter(|output| found <= output.capacity.into()) else {
            return Ok(false);
        };
        self.pairs.clear();
        let expected = std::mem::replace(&mut self.expected, found.next_power_of_two());
        self.submit(number, Submission::Copy(output)).inspect_err(|_| self.expected = expected)?;
        self.wait(number, wait).await.map_err(|error| self.gpu.reason(error))?;
        Ok(true)
    }

    /// Retries a search with a candidate list of skin `used`.
    fn retry_for_candidates(
        &mut self,
        number: u64,
        window: Range<u32>,
        used: f32,
        outcome: &Outcome,
    ) -> Result<(), Error> {
        let (largest, needed) = (self.largest_capacity(), outcome.candidates_needed());
        let parts = self.last.plan.as_ref().map_or(1, |plan| plan.deferred_parts_for(outcome)).max(1);
        // The list of an earlier skin does not affect that of the current one.
        let skin = self.skin.as_mut().map(|skin| &mut skin.detector).filter(|skin| skin.skin() == used);
        let Some(skin) = skin else { return self.submit(number, Submission::Full(window)) };
        if outcome.overflow & Outcome::OVERFLOW_WORK != 0 && parts <= MAX_DEFERRED_PARTS {
            log::info!("the search for candidates exceeds a dispatch: retrying in {parts} parts");
            skin.set_deferred_parts(parts.max(skin.deferred_parts()));
            return self.submit(number, Submission::Full(window));
        }
        let before = skin.candidate_capacity();
        if outcome.overflow & !Outcome::OVERFLOW_PAIRS == Outcome::OVERFLOW_CANDIDATES && needed <= largest {
            skin.set_candidate_capacity(before.max((needed + needed / 8).min(largest) as u32));
            log::info!("{needed} candidates do not fit: retrying with more capacity");
            let submitted = self.submit(number, Submission::Full(window));
            if !self.uses_candidates(number)
                && let Some(skin) = &mut self.skin
            {
                skin.detector.set_candidate_capacity(before);
            }
            return submitted;
        }
        log::info!("{needed} candidates do not fit: searching without a list for {PAUSE} calls");
        self.pause_skin(number);
        self.submit(number, Submission::Full(window))
    }

    fn retry_for_entries(&mut self, number: u64, window: Range<u32>, entries: u64) -> Result<(), Error> {
        let (before, spheres) = (self.detector.capacities(), self.slot(number).buffers.count);
        if self.detector.raise_entry_capacity(entries, spheres) {
            log::info!("{entries} entries do not fit: retrying with more capacity");
            return self.submit_with_capacity(number, window, before);
        }
        let choice = self.slot(number).call.choice;
        let (ran, _) = self.detector.settings().chosen(choice.algorithm, spheres);
        let Some(choice) = choice.with_fewer_entries(ran, self.requested.cell_ratio) else {
            let limit = self.detector.most_entries();
            let (what, remedy) = ("the number of (cell, object) entries", "split the spheres");
            return Err(Error::LimitExceeded { what, needed: entries, limit, remedy });
        };
        let AlgorithmChoice { algorithm, cell_ratio } = choice;
        log::info!("{entries} entries do not fit: retrying as {algorithm} with cell ratio {cell_ratio}");
        self.slot_mut(number).call.choice = choice;
        self.submit(number, Submission::Full(window))
    }

    pub(super) fn retry_for_pairs(
        &mut self,
        number: u64,
        window: Range<u32>,
        found: u64,
    ) -> Result<(), Error> {
        let before = self.detector.capacities();
        if found > u64::from(self.capacity()) {
            self.detector.set_pair_capacity(self.largest_capacity().min(found.next_power_of_two()) as u32);
        }
        let expected = std::mem::replace(&mut self.expected, found.next_power_of_two());
        self.submit_with_capacity(number, window, before).inspect_err(|_| self.expected = expected)
    }

    fn submit_with_capacity(
        &mut self,
        number: u64,
        window: Range<u32>,
        before: CapacitySnapshot,
    ) -> Result<(), Error> {
        self.submit(number, Submission::Full(window))
            .inspect_err(|_| self.detector.restore_capacities(before))
    }

    /// Grows the output until about four windows cover `found` pairs, because each window costs a search.
    pub(super) fn grow_for_windows(&mut self, found: u64) -> bool {
        let wanted = (found / 4).next_power_of_two().min(self.largest_capacity());
        let is_larger = wanted > self.capacity().into();
        if is_larger {
            self.detector.set_pair_capacity(wanted as u32);
        }
        is_larger
    }

    pub(super) async fn gather_windows(&mut self, number: u64, found: u64, wait: Wait) -> Result<(), Error> {
        let mut all = std::mem::take(&mut self.gathered);
        all.clear();
        try_reserve(&mut all, found as usize, "pairs")?;
        let gathered = self.read_windows(number, found, wait, |pairs| {
            all.append(pairs);
            ControlFlow::Continue(())
        });
        let result = gathered.await;
        self.gathered = std::mem::replace(&mut self.pairs, all);
        result
    }

    /// Passes the pairs of each window, which fits the output's capacity, to `consume`.
    pub(super) async fn read_windows(
        &mut self,
        number: u64,
        found: u64,
        wait: Wait,
        mut consume: impl FnMut(&mut Vec<Pair>) -> ControlFlow<()>,
    ) -> Result<(), Error> {
        let (slot, whole) = (self.slot(number), self.last.outcome);
        let Range { start, end: last } = slot.call.window;
        let count = last.min(slot.buffers.count);
        let mut capacity = u64::from(self.capacity());
        self.expected = capacity;
        let mut width = (u64::from(count) * capacity / found.max(1)).clamp(1, u64::from(count)) as u32;
        let mut begin = start;
        while begin < count {
            let end = begin.saturating_add(width).min(count);
            self.pairs.clear();
            self.submit(number, Submission::Full(begin..end))?;
            let mut found = self.finish_with_retries(number, begin..end, wait).await?.found();
            if found > capacity && end - begin == 1 {
                let largest = self.largest_capacity();
                if found > largest {
                    let (needed, limit) = (found * 8, largest * 8);
                    let (what, remedy) = ("the pairs of one sphere", "take a device with a larger limit");
                    return Err(Error::LimitExceeded { what, needed, limit, remedy });
                }
                self.pairs.clear();
                self.retry_for_pairs(number, begin..end, found)?;
                found = self.finish_with_retries(number, begin..end, wait).await?.found();
                capacity = u64::from(self.capacity());
                self.expected = capacity;
            }
            if found > capacity {
                width = (end - begin).div_ceil(2);
                continue;
            }
            if found < capacity / 2 {
                width = width.saturating_mul(2);
            }
            begin = end;
            if consume(&mut self.pairs).is_break() {
                break;
            }
        }
        self.last.outcome = whole;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use Algorithm::{ArrayGrid, LazyGrid};
    use lazygrid_kernels::{Sphere, Spheres};

    use super::*;
    use crate::gpu::detector::GpuSpheres;
    use crate::gpu::device::device_or_skip;

    #[test]
    fn times_of_all_submissions_are_summed() {
        const BEFORE: Duration = Duration::from_secs(1 << 30);
        let Some(gpu) = device_or_skip() else { return };
        let settings =
            GpuConfig::default().algorithm(ArrayGrid).timestamps(true).max_tests_per_dispatch(1 << 18);
        let mut session = GpuSession::new(gpu, settings).expect("made");
        let spheres = vec![Sphere::new([1.0; 3], 0.5); 1500];
        let search = |session: &GpuSession| {
            session.timings().iter().find(|timing| timing.name == "search").map_or(Duration::ZERO, |t| t.time)
        };
        let ticket = session.begin(Spheres::from(&spheres)).expect("begun");
        session.time("search", BEFORE);
        let whole = session.finish_with_retries(ticket.number, GpuSpheres::ALL, Wait::Blocking);
        let outcome = pollster::block_on(whole).expect("finished");
        assert!(outcome.deferred_begin > 0, "one part only: {outcome:?}");
        assert!(search(&session) >= BEFORE, "{:?}", session.timings());
        let windows = session
            .read_windows(ticket.number, outcome.found(), Wait::Blocking, |_| ControlFlow::Continue(()));
        pollster::block_on(windows).expect("found");
        assert!(search(&session) >= BEFORE, "{:?}", session.timings());
        drop(ticket);
        let next = session.begin(Spheres::from(&spheres)).expect("begun");
        assert_eq!(session.finish_count(next), Ok(outcome.found()));
        assert!(search(&session) < BEFORE, "a call has the times of the one before: {:?}", session.timings());
    }

    #[test]
    fn a_call_becomes_coarser_and_at_last_has_one_level() {
        for (algorithm, ratio, expected) in [
            (LazyGrid, 2.0, Some((LazyGrid, 4.0))),
            (LazyGrid, 12.0, Some((LazyGrid, 16.0))),
            (LazyGrid, 16.0, Some((ArrayGrid, 3.0))),
            (Algorithm::EagerGrid, 16.0, Some((ArrayGrid, 3.0))),
            (ArrayGrid, 3.0, Some((ArrayGrid, 6.0))),
            (ArrayGrid, 16.0, None),
        ] {
            let choice = AlgorithmChoice { algorithm, cell_ratio: ratio };
            let expected = expected.map(|(algorithm, cell_ratio)| AlgorithmChoice { algorithm, cell_ratio });
            assert_eq!(choice.with_fewer_entries(algorithm, 3.0), expected, "{algorithm}, {ratio}");
        }
        let auto = AlgorithmChoice { algorithm: Algorithm::Auto, cell_ratio: 16.0 };
        assert!(auto.with_fewer_entries(LazyGrid, 2.0).is_some_and(|choice| choice.algorithm == ArrayGrid));
    }
}
