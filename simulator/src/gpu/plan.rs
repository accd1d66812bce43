use lazygrid::Error;
use lazygrid::gpu::DeviceLimits;

use super::kernel::WORKGROUP_SIZE;
use super::layout::{
    BORN_BYTES, CANDIDATE_BYTES, CLAIM_BYTES, EVENT_BYTES, MOVER_BYTES, NEXT_EVENT_BYTES, PUSH_BYTES,
};

/// Capacities and rounds grow on demand. No option affects results.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GpuOptions {
    /// Initial capacity for pairs. Default: 2¹⁶.
    pub pair_capacity: u32,
    /// Initial matching rounds by the whole device, before one workgroup does the rest. Default: 3.
    pub rounds: u32,
    /// Initial capacity for second products of dissociations in a step. Default: 2¹².
    pub birth_capacity: u32,
    /// Initial capacity for arrivals between readbacks. Default: 2¹⁶.
    pub event_capacity: u32,
    /// Maximum loop iterations of that workgroup, up to 60,000. Default: 60,000.
    pub max_iterations: u32,
}

impl Default for GpuOptions {
    fn default() -> Self {
        Self {
            pair_capacity: 1 << 16,
            rounds: 3,
            birth_capacity: 1 << 12,
            event_capacity: 1 << 16,
            max_iterations: MAX_LOOP_ITERATIONS,
        }
    }
}

/// Software drivers end loops after 65,535 iterations without an error.
pub(super) const MAX_LOOP_ITERATIONS: u32 = 60_000;
/// Capacity of the log: the most steps between readbacks.
pub(super) const LOG_ROWS: u32 = 1024;
const ROUND_GROUPS: u32 = 1024;
/// At about twenty loop iterations each.
const CANDIDATES_PER_THREAD: u32 = 2048;

/// One workgroup sorts the second products of a step.
pub(super) const MAX_BIRTHS: u32 = 1 << 19;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Sizes {
    pub(super) particles: u32,
    pub(super) pairs: u32,
    pub(super) births: u32,
    pub(super) events: u32,
    pub(super) has_velocity: bool,
    pub(super) near: u32,
    /// Windows per step, and rounds per window.
    pub(super) windows: u32,
    pub(super) window_rounds: u32,
    pub(super) speed_doublings: u32,
}

impl Sizes {
    pub(super) fn bytes(self, name: &'static str, limits: &DeviceLimits) -> Result<u64, Error> {
        let Self { particles, pairs, births, events, has_velocity, near, .. } = self;
        let movers = if near > 0 { particles } else { 0 };
        let (items, each) = match name {
            "spheres" | "moved" => (particles, if has_velocity { 32 } else { 16 }),
            "tags" => (particles, 8),
            "movers" => (movers, MOVER_BYTES),
            "next_events" => (movers, NEXT_EVENT_BYTES),
            "inflated" => (movers, 16),
            "pushes" => (movers, PUSH_BYTES),
            "neighbors" => (near, 8),
            "claims" => (particles, CLAIM_BYTES),
            "sums" => (particles.div_ceil(WORKGROUP_SIZE) + 1, 4),
            "candidates" => (pairs, CANDIDATE_BYTES),
            "left0" | "left1" => (pairs, 4),
            "born" => (births, BORN_BYTES),
            "born_keys0" | "born_keys1" => (births, 8),
            "events" => (events, EVENT_BYTES),
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

    pub(super) fn speed_factor(self) -> f32 {
        2f32.powi(self.speed_doublings as i32)
    }

    pub(super) fn round_groups(self) -> u32 {
        let min_groups = self.pairs.div_ceil(WORKGROUP_SIZE * CANDIDATES_PER_THREAD).max(1);
        self.particles
            .div_ceil(WORKGROUP_SIZE)
            .min(self.pairs.div_ceil(WORKGROUP_SIZE))
            .clamp(min_groups, ROUND_GROUPS.max(min_groups))
    }
}

pub(super) fn groups_for(items: u32, limits: &DeviceLimits) -> [u32; 2] {
    let groups = items.div_ceil(WORKGROUP_SIZE).max(1);
    let rows = groups.div_ceil(limits.groups_per_dimension);
    [groups.div_ceil(rows), rows]
}

/// Steps in which no tally exceeds 32 bits, at `counts` per particle and step.
pub(super) fn steps_per_readback(particles: u32, counts: u32) -> u32 {
    (u32::MAX / particles.saturating_mul(counts).max(1)).clamp(1, LOG_ROWS)
}

pub(super) fn grow(needed: u32) -> u32 {
    needed.saturating_add(needed / 4).max(WORKGROUP_SIZE)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn limits() -> DeviceLimits {
        let limits = lazygrid::gpu::wgpu::Limits { max_buffer_size: 1 << 30, ..Default::default() };
        DeviceLimits::from(&limits)
    }

    #[test]
    fn loops_stay_bounded_and_dispatches_cover_all() {
        for shift in 0..29 {
            let sizes = Sizes { particles: 1 << (shift / 2), pairs: 1 << shift, ..Sizes::default() };
            let threads = sizes.round_groups() * WORKGROUP_SIZE;
            assert!(sizes.pairs.div_ceil(threads) <= CANDIDATES_PER_THREAD, "{sizes:?}");
            let [x, y] = groups_for(1 << shift, &limits());
            assert!(x <= limits().groups_per_dimension && u64::from(x) * u64::from(y) * 256 >= 1 << shift);
        }
    }

    #[test]
    fn models_that_do_not_fit_are_refused_with_their_size() {
        let sizes = Sizes { particles: (1 << 22) + 1, pairs: 1, ..Sizes::default() };
        let refused = sizes.bytes("claims", &limits());
        assert!(matches!(refused, Err(Error::LimitExceeded { needed, .. }) if needed == (1 << 27) + 32));
        assert_eq!(sizes.bytes("tags", &limits()), Ok((1 << 25) + 8));
    }

    #[test]
    fn tallies_stay_within_32_bits() {
        for particles in [0, 1, 1000, 10_000_000, u32::MAX] {
            let steps = steps_per_readback(particles, 1);
            assert!(steps >= 1 && u64::from(steps) * u64::from(particles) <= u64::from(u32::MAX));
        }
    }
}
