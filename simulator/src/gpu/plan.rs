//! The buffers and dispatches of a run. Pure functions of sizes and limits.

use lazygrid::Error;
use lazygrid::gpu::DeviceLimits;

use super::kernel::GROUP;
use super::layout::{CANDIDATE_BYTES, CLAIM_BYTES};

/// The options of a run on a device. None of them changes a result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GpuOptions {
    /// Pairs that there is room for at first; it grows where a step finds more. Default: 2¹⁶.
    pub pair_capacity: u32,
    /// Rounds of the matching that the whole device takes part in; one workgroup does the rest. It grows where that
    /// is not enough. Default: 3.
    pub rounds: u32,
    /// The most loop turns of that workgroup's threads, up to 60 000. Default: 60 000.
    pub turns: u32,
}

impl Default for GpuOptions {
    fn default() -> Self {
        Self { pair_capacity: 1 << 16, rounds: 3, turns: MAX_TURNS }
    }
}

/// Software drivers end an invocation's loops after 65 535 turns without a word.
pub(super) const MAX_TURNS: u32 = 60_000;
/// Steps that the log has room for, and so the most between two looks.
pub(super) const LOG_ROWS: u32 = 1024;
/// Workgroups of a round of the matching, at most: enough to fill today's largest devices.
const ROUND_GROUPS: u32 = 1024;
/// Candidates that one thread may go through in a round, at about twenty loop turns each.
const CANDIDATES_PER_THREAD: u32 = 2048;

/// Sizes of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Sizes {
    /// Particles that there is room for.
    pub(super) particles: u32,
    /// Pairs, and so candidates.
    pub(super) pairs: u32,
}

impl Sizes {
    /// Bytes of a buffer that depends on the sizes.
    ///
    /// # Errors
    /// [`Error::LimitExceeded`] where the device cannot bind it.
    pub(super) fn bytes(self, name: &'static str, limits: &DeviceLimits) -> Result<u64, Error> {
        let Self { particles, pairs } = self;
        let (items, each) = match name {
            "spheres" | "moved" => (particles, 16),
            "tags" => (particles, 8),
            "claims" => (particles, CLAIM_BYTES),
            "sums" => (particles.div_ceil(GROUP) + 1, 4),
            "candidates" => (pairs, CANDIDATE_BYTES),
            "left0" | "left1" => (pairs, 4),
            _ => (particles, 4),
        };
        let needed = (u64::from(items) * each).max(64);
        let limit = limits.storage_binding.min(limits.buffer);
        if needed > limit {
            let remedy = "release fewer particles, or choose the CPU";
            return Err(Error::LimitExceeded { what: name, needed, limit, remedy });
        }
        Ok(needed)
    }

    /// Workgroups of a round of the matching.
    pub(super) fn round_groups(self) -> u32 {
        let least = self.pairs.div_ceil(GROUP * CANDIDATES_PER_THREAD).max(1);
        self.particles.div_ceil(GROUP).min(self.pairs.div_ceil(GROUP)).clamp(least, ROUND_GROUPS.max(least))
    }
}

/// Workgroups for a thread per item, laid out in two dimensions.
pub(super) fn groups_for(items: u32, limits: &DeviceLimits) -> [u32; 2] {
    let groups = items.div_ceil(GROUP).max(1);
    let rows = groups.div_ceil(limits.groups_per_dimension);
    [groups.div_ceil(rows), rows]
}

/// Steps between two looks, so that no tally of them passes 32 bits: a particle is counted once in a step at most.
pub(super) fn steps_between_looks(particles: u32) -> u32 {
    (u32::MAX / particles.max(1)).clamp(1, LOG_ROWS)
}

/// Room for `needed` particles, with some more so that growth is rare.
pub(super) fn grown(needed: u32) -> u32 {
    needed.saturating_add(needed / 4).max(GROUP)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Limits of a small device.
    fn limits() -> DeviceLimits {
        let limits = lazygrid::gpu::wgpu::Limits { max_buffer_size: 1 << 30, ..Default::default() };
        DeviceLimits::from(&limits)
    }

    #[test]
    fn loops_stay_bounded_and_dispatches_cover_all() {
        for shift in 0..29 {
            let sizes = Sizes { particles: 1 << (shift / 2), pairs: 1 << shift };
            let threads = sizes.round_groups() * GROUP;
            assert!(sizes.pairs.div_ceil(threads) <= CANDIDATES_PER_THREAD, "{sizes:?}");
            let [x, y] = groups_for(1 << shift, &limits());
            assert!(x <= limits().groups_per_dimension && u64::from(x) * u64::from(y) * 256 >= 1 << shift);
        }
    }

    #[test]
    fn what_does_not_fit_is_refused_with_its_size() {
        let sizes = Sizes { particles: (1 << 22) + 1, pairs: 1 };
        let refused = sizes.bytes("claims", &limits());
        assert!(matches!(refused, Err(Error::LimitExceeded { needed, .. }) if needed == (1 << 27) + 32));
        assert_eq!(sizes.bytes("tags", &limits()), Ok((1 << 25) + 8));
    }

    #[test]
    fn tallies_stay_within_32_bits() {
        for particles in [0, 1, 1000, 10_000_000, u32::MAX] {
            let steps = steps_between_looks(particles);
            assert!(steps >= 1 && u64::from(steps) * u64::from(particles) <= u64::from(u32::MAX));
        }
    }
}
