//! Calls that take more than one submission: for want of room, because a result is larger than the output, or because
//! no submission may keep the device for long.

use std::ops::{ControlFlow, Range};

use lazygrid_kernels::Pair;
use lazygrid_kernels::layout::Outcome;

use super::{GpuSession, SLOTS, Work};
use crate::gpu::mapping::Wait;
use crate::gpu::{GpuError, GpuSettings};

impl GpuSession {
    /// Waits for a call and appends the pairs that came back; repeats it with more room for entries, or
    /// with a coarser raster, where they found none.
    pub(super) async fn settle(
        &mut self,
        number: u64,
        window: Range<u32>,
        wait: Wait,
    ) -> Result<Outcome, GpuError> {
        self.timings.clear();
        let mut ratio = self.raster_ratio;
        loop {
            let outcome = self.land(number, wait).await.map_err(|error| self.own.reason(error))?;
            self.last = outcome;
            if outcome.overflow & Outcome::ENTRIES == 0 {
                return self.complete(number, window, outcome, wait).await;
            }
            self.pairs.clear();
            if self.detector.set_entry_capacity(outcome.entries()) {
                log::info!("{} entries do not fit: repeating with room for them", outcome.entries());
                self.launch(number, Work::Call(window.clone()))?;
                continue;
            }
            ratio *= 2.0;
            if ratio > GpuSettings::MAX_RASTER_RATIO {
                let limit = self.detector.plan().map_or(0, |plan| plan.entries.into());
                let (what, remedy) = ("the number of (cell, object) entries", "split the spheres");
                return Err(GpuError::LimitExceeded { what, needed: outcome.entries(), limit, remedy });
            }
            log::info!("{} entries do not fit: repeating with raster ratio {ratio}", outcome.entries());
            let relaunched = self
                .detector
                .set_raster_ratio(ratio)
                .and_then(|()| self.launch(number, Work::Call(window.clone())));
            self.detector.set_raster_ratio(self.raster_ratio)?;
            relaunched?;
        }
    }

    /// Goes on with a crowded search that was too much for one submission, part by part.
    async fn complete(
        &mut self,
        number: u64,
        window: Range<u32>,
        mut outcome: Outcome,
        wait: Wait,
    ) -> Result<Outcome, GpuError> {
        if outcome.is_partial() && self.launched != number {
            // The call that was begun since has used the same buffers.
            self.launch(number, Work::Call(window))?;
            self.pairs.clear();
            outcome = self.land(number, wait).await.map_err(|error| self.own.reason(error))?;
        }
        while outcome.is_partial() {
            self.launch(number, Work::Rest)?;
            // Those of all parts come with the last one.
            self.pairs.clear();
            outcome = self.land(number, wait).await.map_err(|error| self.own.reason(error))?;
        }
        self.last = outcome;
        Ok(outcome)
    }

    /// Repeats a call for one window of smaller indices after another, each as large as the output holds.
    pub(super) async fn windows(
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
            self.launch(number, Work::Call(begin..end))?;
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
}
