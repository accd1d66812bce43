use lazygrid_kernels::layout::Outcome;

use crate::gpu::detector::LayoutSource;

/// Calls that reuse cells before new statistics, about a tenth of a call, choose others: older cells suit the spheres
/// less.
const MAX_REUSES: u32 = 16;
const MAX_PAUSE: u32 = 63;

/// Decides which searches reuse an earlier call's cells. This affects the time only, as the device checks the cells.
#[derive(Debug, Default)]
pub(super) struct LayoutReuse {
    /// Remaining reuses.
    left: u32,
    pause: u32,
    /// Pauses grow, because a refused call runs twice.
    last_pause: u32,
}

impl LayoutReuse {
    pub(super) fn source(&self, may_reuse: bool) -> LayoutSource {
        if may_reuse && self.left > 0 { LayoutSource::EarlierCall } else { LayoutSource::ThisCall }
    }

    pub(super) fn record(&mut self, has_reused: bool, outcome: &Outcome) {
        if has_reused && outcome.overflow & Outcome::OVERFLOW_LAYOUT != 0 {
            self.last_pause = (2 * self.last_pause + 1).min(MAX_PAUSE);
            (self.left, self.pause) = (0, self.last_pause);
        } else if has_reused {
            self.left = self.left.saturating_sub(1);
            if self.left == 0 {
                self.last_pause = 0;
            }
        } else if self.pause > 0 {
            self.pause -= 1;
        } else {
            // Overfull cells need new statistics.
            let suits = outcome.max_occupancy == 0 && outcome.quarantined == 0;
            self.left = if suits { MAX_REUSES } else { 0 };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn searches(reuse: &mut LayoutReuse, count: u32, refuses: impl Fn(u32) -> bool) -> Vec<bool> {
        let search = |search: u32| {
            let reused = reuse.source(true) == LayoutSource::EarlierCall;
            let mut outcome = Outcome::default();
            if reused && refuses(search) {
                outcome.overflow = Outcome::OVERFLOW_LAYOUT;
            }
            reuse.record(reused, &outcome);
            reused
        };
        (0..count).map(search).collect()
    }

    #[test]
    fn every_seventeenth_call_has_a_new_layout() {
        let reused = searches(&mut LayoutReuse::default(), 40, |_| false);
        let new_layouts: Vec<usize> = (0..40).filter(|&call| !reused[call]).collect();
        assert_eq!(new_layouts, [0, 17, 34]);
    }

    #[test]
    fn refusals_make_attempts_rare() {
        let mut reuse = LayoutReuse::default();
        let attempts = searches(&mut reuse, 1000, |_| true).into_iter().filter(|&reused| reused).count();
        assert!((10..30).contains(&attempts), "{attempts} attempts");
        assert!(searches(&mut reuse, 200, |_| false).into_iter().filter(|&reused| reused).count() > 100);
    }

    #[test]
    fn calls_with_overfull_cells_have_a_new_layout() {
        let mut reuse = LayoutReuse::default();
        let mut outcome = Outcome::default();
        outcome.max_occupancy = 100;
        reuse.record(false, &outcome);
        assert_eq!(reuse.source(true), LayoutSource::ThisCall);
        reuse.record(false, &Outcome::default());
        assert_eq!(reuse.source(true), LayoutSource::EarlierCall);
        assert_eq!(reuse.source(false), LayoutSource::ThisCall);
    }
}
