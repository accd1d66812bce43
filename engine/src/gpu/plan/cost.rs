use lazygrid_kernels::Algorithm;
use lazygrid_kernels::kernel::{self as k, Kernel};

use super::{BufferId, Dispatch, Plan};

/// The planned cost of a call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct CallCost {
    /// Algorithm that runs; never `Auto`.
    pub algorithm: Algorithm,
    /// Largest number of spheres.
    pub spheres: u32,
    /// Number of dispatches and clears of buffers.
    pub dispatches: u32,
    /// Parts by [`GpuConfig::max_tests_per_dispatch`](crate::gpu::GpuConfig::max_tests_per_dispatch).
    pub parts: u32,
    /// Bytes of working memory, without spheres and pairs.
    pub working_bytes: u64,
    /// Bytes of pairs.
    pub pair_bytes: u64,
    /// Bytes that all dispatches read and write, without pairs and overfull cells: sequential reads once, random
    /// reads by 32-byte sectors. `None` if it depends on the cells per sphere or on caches.
    pub traffic_bytes: Option<u64>,
}

impl Plan {
    pub(crate) fn cost(&self) -> CallCost {
        let pair_bytes =
            self.buffers.iter().find(|(id, _)| *id == BufferId::Pairs).map_or(0, |(_, bytes)| *bytes);
        CallCost {
            algorithm: self.algorithm,
            spheres: self.spheres,
            dispatches: self.dispatches.len() as u32 + u32::from(self.cleared_bytes() > 0),
            parts: self.parts(),
            working_bytes: self.bytes() - pair_bytes,
            pair_bytes,
            traffic_bytes: self
                .dispatches
                .iter()
                .map(|dispatch| self.traffic_of(dispatch))
                .sum::<Option<u64>>()
                .map(|bytes| bytes + self.cleared_bytes()),
        }
    }

    fn traffic_of(&self, dispatch: &Dispatch) -> Option<u64> {
        if self.algorithm != Algorithm::CellList {
            return None;
        }
        let (spheres, counters) = (u64::from(self.spheres), u64::from(self.counters));
        let is_counted = self.tile == 0;
        let is = |kernel: &Kernel| dispatch.kernel == kernel;
        // Bytes per sphere, and per counter of the cell table.
        let (per_sphere, per_counter) = if is(&k::STATS_REDUCE) || is(&k::CELL_LIST_SETUP_SMALL) {
            (16 + 4 * u64::from(self.occupancy_slots) / spheres.max(1), if is_counted { 4 } else { 0 })
        } else if is(&k::SPHERES_INTERLEAVE) {
            (16 + 16, 0)
        } else if is(&k::CELLS_COUNT) {
            // Sphere in, cell out; counters are read and written in a cache.
            (16 + 8, 8)
        } else if is(&k::CELLS_KEY) {
            (16 + 4, 0)
        } else if is(&k::SCAN_ONCE) {
            (0, 8)
        } else if is(&k::SCAN_REDUCE) {
            (0, 4)
        } else if is(&k::SCAN_SPREAD) {
            (0, 8)
        } else if is(&k::RADIX_COUNT) {
            (4, 0)
        } else if is(&k::RADIX_SCATTER) {
            // The payload of the first pass is the position itself.
            (if dispatch.pass == 0 { 4 + 8 } else { 8 + 8 }, 0)
        } else if is(&k::CELL_STARTS_FIND) {
            (4, 4)
        } else if is(&k::SPHERES_SCATTER) {
            // Cell and sphere in; sphere, cell and index out, by sectors.
            (8 + 16 + 3 * 32, 4)
        } else if is(&k::SPHERES_GATHER) {
            // Index in, sphere in by sectors, sphere out. Reused cells are checked for overfull ones.
            (4 + 32 + 16 + if self.reuses_layout { 4 } else { 0 }, 0)
        } else if is(&k::CELL_LIST_SEARCH) {
            // Sphere, cell and index, and the starts of cells.
            (16 + 4 + 4, 4)
        } else {
            (0, 0)
        };
        // A divided search reads each sphere in one part.
        let parts = match is(&k::CELL_LIST_SEARCH) {
            true => self.dispatches.iter().filter(|other| other.kernel == dispatch.kernel).count(),
            false => 1,
        };
        Some((per_sphere * spheres + per_counter * counters) / parts as u64)
    }
}
