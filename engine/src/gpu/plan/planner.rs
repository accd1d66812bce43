use std::ops::Range;

use lazygrid_kernels::kernel::{SUBGROUP_PROBE, Variant};
use lazygrid_kernels::layout::SearchParams;
use lazygrid_kernels::{Algorithm, Interactions};

use super::call_plan::{CallConstants, CallPlan, PlanKernel};
use super::sides::{SidePartners, Sides};
use super::tables::TableBytes;
use super::work_budget::{WorkBudget, tests_within_limit};
use super::{CallCost, DeviceLimits, Plan, Request, plan};
use crate::Error;
use crate::gpu::choice::{self, CallSize};
use crate::gpu::config::{GpuConfig, check};
use crate::gpu::costs::Calibration;

/// Plans calls as a [`GpuDetector`](crate::gpu::GpuDetector) would on a device of these limits.
///
/// ```
/// use lazygrid::Algorithm;
/// use lazygrid::gpu::plan::Planner;
/// use lazygrid::gpu::{DeviceLimits, GpuConfig, wgpu};
///
/// let limits = DeviceLimits::from(&wgpu::Limits::default());
/// let config = GpuConfig::default().algorithm(Algorithm::CellList);
/// let plan = Planner::new(config, limits).plan(100_000)?;
/// assert!(plan.buffers[plan.pairs].size >= 8 * u64::from(plan.pair_capacity));
/// # Ok::<(), lazygrid::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Planner {
    config: GpuConfig,
    limits: DeviceLimits,
    smallest_subgroup: Option<u32>,
    min_entries: u32,
    count_in_buffer: bool,
}

impl Planner {
    /// Creates a planner for devices without subgroups.
    pub fn new(config: GpuConfig, limits: DeviceLimits) -> Self {
        Self { config, limits, smallest_subgroup: None, min_entries: 0, count_in_buffer: false }
    }

    /// Sets the device's smallest subgroup size. Default: `None`, no subgroups.
    pub fn subgroups(self, smallest: Option<u32>) -> Self {
        Self { smallest_subgroup: smallest, ..self }
    }

    /// Sets the minimum capacity for (cell, sphere) entries. Calls that need more set
    /// [`Outcome::OVERFLOW_ENTRIES`](crate::gpu::Outcome::OVERFLOW_ENTRIES). Default: 0.
    pub fn min_entries(self, min_entries: u32) -> Self {
        Self { min_entries, ..self }
    }

    /// Sets if the number of spheres comes from a buffer. Default: `false`.
    pub fn count_in_buffer(self, count_in_buffer: bool) -> Self {
        Self { count_in_buffer, ..self }
    }

    /// Plans a call of `spheres` spheres, or at most that many if a buffer has the number.
    ///
    /// # Errors
    /// [`Error::LimitExceeded`] if a buffer exceeds the limits; [`Error::InvalidSetting`] and [`Error::NotOnBackend`]
    /// for the configuration.
    pub fn plan(&self, spheres: u32) -> Result<CallPlan, Error> {
        let Self { config, limits, .. } = self;
        let sized = self.sized(spheres)?;
        let table =
            |interactions| TableBytes::new(interactions, config.most_frequent, limits.storage_binding);
        let tables = config.interactions.as_ref().map(table).transpose()?;
        let call = sized.call(&CallSettings {
            config,
            cell_ratio: config.cell_ratio,
            window: 0..u32::MAX,
            split: 0,
            sides: tables.as_ref().map(|tables| &tables.sides),
        });
        let subgroups = self.smallest_subgroup.filter(|_| config.subgroups);
        let variant = Variant::for_device(subgroups, limits.workgroup_memory);
        let count_in_buffer = self.count_in_buffer;
        let constants = CallConstants { call, count_in_buffer, tables: tables.as_ref() };
        Ok(sized.call_plan(&constants, variant, limits))
    }

    /// Returns the cost of a call that reuses an earlier call's cells, as most calls of a
    /// [`GpuSession`](crate::gpu::GpuSession) do.
    ///
    /// # Errors
    /// See [`plan`](Self::plan).
    pub fn cost_with_reused_cells(&self, spheres: u32) -> Result<CallCost, Error> {
        let mut sized = self.sized(spheres)?;
        if sized.algorithm == Algorithm::CellList {
            sized.reuse_layout();
        }
        Ok(sized.cost())
    }

    fn sized(&self, spheres: u32) -> Result<Plan, Error> {
        check(&self.config)?;
        let (algorithm, _) = self.config.chosen(self.config.algorithm, spheres);
        plan(&Request::new(&self.config, algorithm, spheres, self.min_entries), &self.limits)
    }

    /// Returns the kernel that tests subgroups of at least this size. Its only buffer is a
    /// [`SubgroupProbe`](super::SubgroupProbe), initially [`BEFORE`](super::SubgroupProbe::BEFORE).
    pub fn subgroup_probe(smallest_subgroup: u32) -> PlanKernel {
        let variant = Variant { subgroups: Some(smallest_subgroup), ..Variant::default() };
        PlanKernel { kernel: &SUBGROUP_PROBE, variant }
    }

    /// Returns the most workgroup memory in bytes of any kernel.
    pub fn workgroup_memory(smallest_subgroup: Option<u32>) -> u32 {
        Variant { subgroups: smallest_subgroup, ..Variant::default() }.workgroup_memory()
    }
}

impl Request {
    pub(crate) fn new(config: &GpuConfig, algorithm: Algorithm, spheres: u32, entries: u32) -> Self {
        Self {
            spheres,
            pairs: config.pair_capacity,
            entries,
            algorithm,
            has_species: config.interactions.is_some(),
            periodic: config.space.is_periodic(),
            columns: config.columns,
            radix_sort_from: config.radix_sort_from,
            max_tests: max_tests(config),
            deferred_parts: config.deferred_parts,
        }
    }
}

fn max_tests(config: &GpuConfig) -> u64 {
    config.max_tests_per_dispatch.unwrap_or_else(|| tests_within_limit(Calibration::TESTS_PER_SECOND))
}

impl WorkBudget {
    pub(crate) fn new(config: &GpuConfig, limits: &DeviceLimits) -> Self {
        Self { tests: max_tests(config), row: limits.groups_per_dimension }
    }
}

#[derive(Clone, Debug)]
pub(crate) struct CallSettings<'a> {
    pub(crate) config: &'a GpuConfig,
    pub(crate) cell_ratio: f32,
    pub(crate) window: Range<u32>,
    pub(crate) split: u32,
    pub(crate) sides: Option<&'a Sides>,
}

impl Plan {
    pub(crate) fn call(&self, settings: &CallSettings<'_>) -> SearchParams {
        let partners = match (settings.sides, settings.split) {
            (Some(sides), 0) => sides.one_set.clone(),
            (Some(sides), _) => sides.two_sets.clone(),
            (None, 0) => SidePartners::one_set(),
            (None, _) => SidePartners::two_sets(),
        };
        let has_narrow_sides = self.algorithm == Algorithm::CellList;
        let call = SearchParams {
            interaction: partners.interaction,
            narrow_sides: if has_narrow_sides { partners.narrow.into() } else { 0 },
            entry_capacity: self.entries,
            key_bits: self.key_bits,
            cell_ratio: settings.cell_ratio,
            search_groups: self.search_groups,
            split_policy: self.split_policy as u32,
            occupancy_slots: self.occupancy_slots,
            tiles_per_submission: self.budget.tiles(),
            cells: self.cells,
            counters: if self.tile == 0 { self.counters } else { 0 },
            radix_tile: self.tile,
            candidates_per_invocation: self.candidates_per_invocation,
            chunks_per_block: self.chunks_per_block,
            ..settings.config.call(self.spheres, &settings.window, settings.split)
        };
        call.with_sides(&partners.of_side)
    }
}

impl GpuConfig {
    pub(crate) fn call(&self, spheres: u32, window: &Range<u32>, split: u32) -> SearchParams {
        let call = SearchParams {
            spheres,
            pair_capacity: self.pair_capacity,
            species: self.interactions.as_ref().map_or(0, Interactions::species),
            consumer_workgroup_size: self.consumer_workgroup_size,
            window_begin: window.start,
            window_end: window.end,
            second_set_start: split,
            tau: self.tau,
            pairs_in_cell_order: u32::from(self.pairs_in_cell_order && *window == (0..u32::MAX)),
            ..SearchParams::default()
        };
        call.in_space(self.space)
    }

    pub(crate) fn chosen(&self, algorithm: Algorithm, spheres: u32) -> (Algorithm, String) {
        choice::algorithm(algorithm, CallSize { spheres, split: None, classes: 1 }, self.crossover, "given")
    }
}

#[cfg(test)]
mod tests {
    use lazygrid_kernels::Interaction;

    use super::*;

    fn limits() -> DeviceLimits {
        DeviceLimits::from(&wgpu::Limits { max_storage_buffers_per_shader_stage: 16, ..Default::default() })
    }

    #[test]
    fn calls_above_any_limit_are_refused() {
        for (&algorithm, radix_sort_from) in
            Algorithm::GPU.iter().flat_map(|algorithm| [(algorithm, 0), (algorithm, u32::MAX)])
        {
            let config = GpuConfig::default().algorithm(algorithm).radix_sort_from(radix_sort_from);
            for spheres in [1 << 28, 1 << 31, (1 << 31) + 1, u32::MAX] {
                let refused = Planner::new(config.clone(), limits()).plan(spheres);
                assert!(matches!(refused, Err(Error::LimitExceeded { .. })), "{algorithm}, {spheres}");
            }
        }
    }

    #[test]
    fn empty_table_of_interactions_has_the_buffers_of_species() {
        let table = Interactions::new(0, Interaction::Touch).expect("an empty table");
        let config = GpuConfig::default().algorithm(Algorithm::CellList).interactions(table);
        for radix_sort_from in [0, u32::MAX] {
            let config = config.clone().radix_sort_from(radix_sort_from);
            let plan = Planner::new(config, limits()).plan(1000).expect("within the limits");
            let sorted = plan.buffers.iter().find(|buffer| buffer.name == "sorted_species");
            assert_eq!(sorted.map(|buffer| buffer.size), Some(4000));
        }
    }

    #[test]
    fn indirect_dispatches_need_all_workgroups_of_a_dimension() {
        let plan = |algorithm, groups_per_dimension| {
            let limits = DeviceLimits { groups_per_dimension, ..limits() };
            Planner::new(GpuConfig::default().algorithm(algorithm), limits)
                .plan(1000)
                .map(|plan| plan.spheres)
        };
        let (needed, limit) = (65_535, 65_534);
        let refused = plan(Algorithm::ArrayGrid, limit as u32).expect_err("too few workgroups");
        assert!(
            matches!(refused, Error::LimitExceeded { needed: n, limit: l, .. } if (n, l) == (needed, limit))
        );
        assert!(plan(Algorithm::ArrayGrid, needed as u32).is_ok());
        assert!(plan(Algorithm::Naive, limit as u32).is_ok());
    }
}
