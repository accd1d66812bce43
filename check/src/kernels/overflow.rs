use bytemuck::Zeroable;
use lazygrid::gpu::{GpuDevice, Outcome};
use lazygrid::{Pair, Sphere};
use lazygrid_kernels::kernel as k;
use lazygrid_kernels::layout::SearchParams;

use super::cells::{CellListCase, ConfiguredCellList, cases};
use super::division::Division;
use super::kernel_call::KernelCall;
use super::support::{KernelError, changed, same};
use crate::{Tolerance, difference};

struct DeferredSearch<'a> {
    call: KernelCall<'a>,
    chosen: &'a ConfiguredCellList,
}

impl<'a> DeferredSearch<'a> {
    fn new(gpu: &'a GpuDevice, chosen: &'a ConfiguredCellList) -> Result<Self, KernelError> {
        let ConfiguredCellList { call, scenario, list, .. } = chosen;
        let (assigned_cells, _) = chosen.assigned_cells(&chosen.occupancy(false), false);
        let mut order: Vec<u32> = (0..call.spheres).collect();
        order.sort_by_key(|&id| assigned_cells[id as usize]);
        let cells: Vec<u32> = order.iter().map(|&id| assigned_cells[id as usize]).collect();
        let starts: Vec<u32> =
            (0..list.cells + 3).map(|cell| cells.partition_point(|&other| other < cell) as u32).collect();
        let image = |&id: &u32| {
            let Sphere { center, radius } = scenario.spheres[id as usize];
            Sphere::new(scenario.space.wrap(center), radius)
        };
        let sorted: Vec<Sphere> = order.iter().map(image).collect();
        let species = chosen.division.species(order.len());
        let sorted_species: Vec<u32> = order.iter().map(|&id| species[id as usize]).collect();
        let call = KernelCall::new(gpu)
            .with("params", &[*call])?
            .with_layout("cell_list", list)?
            .with("starts", &starts)?
            .with("sorted", &sorted)?
            .with("cells", &cells)?
            .with("order", &order)?
            .with("outcome", &[Outcome::zeroed()])?
            .with_zeros::<Pair>("pairs", call.pair_capacity as usize)?
            .with_zeros::<u32>("deferred", order.len().div_ceil(256))?
            .with("sorted_species", &sorted_species)?
            .with_zeros::<u32>("dispatch", 4)?;
        Ok(Self { call: chosen.division.bind(call, order.len())?, chosen })
    }

    fn outcome(&self) -> Result<Outcome, KernelError> {
        Ok(self.call.read_one("outcome")?)
    }

    fn pairs(&self) -> Result<Vec<Pair>, KernelError> {
        Ok(self.call.read("pairs", self.outcome()?.found() as usize)?)
    }

    fn search_first_chunks(&self) -> Result<(), KernelError> {
        let groups = self.chosen.call.spheres.div_ceil(k::WORKGROUP_SIZE);
        Ok(self.call.run(&k::CELL_LIST_SEARCH, self.chosen.variant, groups)?)
    }

    fn search_next_part(&self) -> Result<(), KernelError> {
        let variant = self.chosen.variant;
        self.call.run(&k::CELL_LIST_SEARCH_OVERFLOW_DISPATCH_ARGS, variant, 1)?;
        let groups = self.call.read_one("dispatch")?;
        Ok(self.call.run_over(&k::CELL_LIST_SEARCH_OVERFLOW, variant, groups)?)
    }
}

pub(crate) fn cell_list_search_overflow(gpu: &GpuDevice) -> Result<(), KernelError> {
    for case in cases() {
        let case = CellListCase { spheres: case.spheres.min(1500), ..case };
        let chosen = case.choose(gpu)?;
        let expected = chosen.scenario.oracle_of_valid();
        for tiles_per_submission in [SearchParams::UNLIMITED, 1] {
            let parted = ConfiguredCellList {
                call: SearchParams { tiles_per_submission, ..chosen.call },
                ..chosen.clone()
            };
            let searched = DeferredSearch::new(gpu, &parted)?;
            searched.search_first_chunks()?;
            let mut parts = 0;
            while searched.outcome()?.has_remaining_work() {
                searched.search_next_part()?;
                parts += 1;
            }
            difference(&chosen.scenario, &searched.pairs()?, &expected, Tolerance::Tangent)
                .map_err(|text| KernelError::WrongResult(format!("{text}, {parts} parts, {case:?}")))?;
        }
    }
    Ok(())
}

/// All later spheres are candidates of a coincident sphere.
pub(crate) fn cell_list_search(gpu: &GpuDevice) -> Result<(), KernelError> {
    for count in [2_u32, 256, 257, 300, 700, 769, 1400] {
        let division = Division::OneSet;
        let case = CellListCase { spheres: count, lengths: [None; 3], is_overfull: false, division };
        let spheres = vec![Sphere::new([0.3; 3], 0.5); count as usize];
        let chosen = case.choose_for(gpu, spheres)?;
        let searched = DeferredSearch::new(gpu, &chosen)?;
        searched.search_first_chunks()?;
        let chunk = chosen.call.candidates_per_invocation;
        let what = |what: &str| format!("{what} of {count} at one point");
        let mut found = searched.pairs()?;
        found.sort_unstable();
        let first = (0..count).flat_map(|i| (i + 1..count.min(i + 1 + chunk)).map(move |j| Pair { i, j }));
        same(|| what("first candidates"), &found, &first.collect())?;
        let outcome = searched.outcome()?;
        let rest = (count - 1).saturating_sub(chunk);
        let blocks: Vec<u32> = (0..count).step_by(256).filter(|block| count - 1 - block > chunk).collect();
        let listed = (outcome.deferred_blocks as usize, outcome.deferred_max_tiles);
        same(|| what("blocks and chunks"), &listed, &(blocks.len(), rest.div_ceil(chunk)))?;
        let mut deferred = searched.call.read::<u32>("deferred", blocks.len())?;
        deferred.sort_unstable();
        same(|| what("blocks"), &deferred, &blocks)?;
        few(gpu, &chosen)?;
        refused(gpu, &chosen)?;
    }
    Ok(())
}

fn few(gpu: &GpuDevice, chosen: &ConfiguredCellList) -> Result<(), KernelError> {
    let count = chosen.call.spheres;
    let pairs = count * (count - 1) / 2;
    let chunks_per_block = count.div_ceil(chosen.call.candidates_per_invocation);
    // Only one of the two scans stores the largest occupancy.
    for (pair_capacity, largest) in [(pairs, count), (pairs, 0), (pairs / 2, count)] {
        let call =
            SearchParams { chunks_per_block, pair_capacity, consumer_workgroup_size: 64, ..chosen.call };
        let limited = ConfiguredCellList { call, ..chosen.clone() };
        let searched = DeferredSearch::new(gpu, &limited)?;
        let largest_at = 4 * u64::from(chosen.list.cells + 2);
        gpu.queue.write_buffer(searched.call.buffer("starts"), largest_at, bytemuck::bytes_of(&largest));
        let groups = count.div_ceil(k::WORKGROUP_SIZE) * chunks_per_block;
        searched.call.run(&k::CELL_LIST_SEARCH, chosen.variant, groups)?;
        let outcome = searched.outcome()?;
        let found = [outcome.found_lo, outcome.overflow, outcome.dispatch_x, outcome.deferred_blocks];
        let overflow = if pair_capacity < pairs { Outcome::OVERFLOW_PAIRS } else { 0 };
        let expected = [pairs, overflow, pair_capacity.div_ceil(64), 0];
        same(|| format!("outcome of {count} at one point"), &found, &expected)?;
    }
    Ok(())
}

fn refused(gpu: &GpuDevice, chosen: &ConfiguredCellList) -> Result<(), KernelError> {
    for overflow in [0, Outcome::OVERFLOW_LAYOUT] {
        let variant = k::Variant { reuse: true, ..chosen.variant };
        let chosen = ConfiguredCellList { variant, ..chosen.clone() };
        let searched = DeferredSearch::new(gpu, &chosen)?;
        let before = changed(Outcome::zeroed(), |new| new.overflow = overflow);
        gpu.queue.write_buffer(searched.call.buffer("outcome"), 0, bytemuck::bytes_of(&before));
        searched.search_first_chunks()?;
        let is_searched = searched.outcome()? != before;
        same(|| format!("search with overflow {overflow}"), &is_searched, &(overflow == 0))?;
    }
    Ok(())
}

pub(crate) fn cell_list_search_overflow_dispatch_args(gpu: &GpuDevice) -> Result<(), KernelError> {
    let blocks = [1, 5, 4096, 65_535, 65_536, 1_000_000];
    for (blocks, chunks) in
        blocks.into_iter().flat_map(|blocks| [1, 7, 50_000].map(|chunks| (blocks, chunks)))
    {
        for (begin, tiles_per_submission) in
            [(0, SearchParams::UNLIMITED), (0, 1 << 18), (blocks - 1, 1 << 18), (0, 1)]
        {
            let call = SearchParams {
                tiles_per_submission,
                candidates_per_invocation: k::CANDIDATES_PER_INVOCATION,
                ..SearchParams::zeroed()
            };
            let listed = changed(Outcome::zeroed(), |new| {
                new.deferred_blocks = blocks;
                new.deferred_max_tiles = chunks;
                new.deferred_end = begin;
            });
            let call = KernelCall::new(gpu)
                .with("params", &[call])?
                .with("outcome", &[listed])?
                .with("dispatch", &[0_u32; 4])?;
            call.run(&k::CELL_LIST_SEARCH_OVERFLOW_DISPATCH_ARGS, Default::default(), 1)?;
            let left = blocks - begin;
            let taken = match tiles_per_submission {
                SearchParams::UNLIMITED => left,
                tiles => left.min((tiles / (chunks * (k::CANDIDATES_PER_INVOCATION / 256))).max(1)),
            };
            let case = || {
                format!(
                    "{blocks} blocks, the first {begin}, of {chunks} chunks, {tiles_per_submission} a part"
                )
            };
            let expected = changed(listed, |new| {
                new.deferred_begin = begin;
                new.deferred_end = begin + taken;
            });
            same(case, &call.read_one::<Outcome>("outcome")?, &expected)?;
            let groups = call.read_one::<[u32; 3]>("dispatch")?;
            same(case, &groups, &[chunks, taken.min(65_535), taken.div_ceil(65_535)])?;
        }
    }
    Ok(())
}
