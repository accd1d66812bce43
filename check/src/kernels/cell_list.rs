use bytemuck::Zeroable;
use encase::ShaderType;
use lazygrid::Sphere;
use lazygrid::gpu::GpuDevice;
use lazygrid_kernels::kernel::{self as k, Variant};
use lazygrid_kernels::layout::{CellListLayout, InputStats, Outcome, SearchParams, SortCounts};

use super::division::Division;
use super::kernel_call::KernelCall;
use super::support::{KernelError, SIZES, ordered, same};
use crate::scenes::hard;
use crate::{Random, SceneSeed};

pub(crate) fn stats_reduce(gpu: &GpuDevice) -> Result<(), KernelError> {
    let species = Division::Species { meets_itself: true };
    let narrow = Division::NarrowSide { two_sets: true };
    let divisions = [Division::OneSet, Division::TwoSets, species, Division::DisjointPairs(4), narrow];
    for (size, groups, division) in SIZES.into_iter().flat_map(|size| {
        [1, 3].into_iter().flat_map(move |groups| divisions.map(|division| (size, groups, division)))
    }) {
        let mut spheres = hard::any_floats(&SceneSeed::drawn(&mut Random(size as u64), size));
        spheres.iter_mut().step_by(100).for_each(|sphere| sphere.center.y = f32::NAN);
        let (counters, occupancy_slots) = (size as u32 + 7, 512);
        let call = SearchParams { spheres: size as u32, counters, occupancy_slots, ..SearchParams::zeroed() };
        let call = division.divide(call);
        let call = KernelCall::new(gpu)
            .with("params", &[call])?
            .with("count_source", &[size as u32])?
            .with("spheres", &spheres)?
            .with("stats", &[InputStats::zeroed()])?
            .with("starts", &vec![7_u32; counters as usize])?
            .with("occupancy", &vec![7_u32; occupancy_slots as usize])?;
        let variant = Variant { species: division.has_species(), ..Variant::default() };
        let call = division.bind(call, size)?;
        call.run(&k::STATS_REDUCE, variant, groups)?;
        let found = call.read_one::<InputStats>("stats")?;
        // Devices may flush subnormal radii to zero.
        let [unflushed, flushed] = [false, true].map(|flushes| expected_stats(&spheres, division, flushes));
        let expected = if found.smallest == flushed.smallest { flushed } else { unflushed };
        let case = |what: &str| format!("{what} of {size} spheres, {groups} workgroups, {division:?}");
        let counted = |stats: &InputStats| (stats.low, stats.high, stats.smallest, stats.quarantined);
        same(|| case("bounds"), &counted(&found), &counted(&expected))?;
        for class in 0..256 {
            let members =
                |stats: &InputStats| stats.members[class..].iter().step_by(256).copied().collect::<Vec<_>>();
            let sizes = |stats: &InputStats| (members(stats), stats.largest[class]);
            same(|| case(&format!("class {class}")), &sizes(&found), &sizes(&expected))?;
        }
        for (what, length) in [("starts", counters), ("occupancy", occupancy_slots)] {
            let cleared = call.read::<u32>(what, length as usize)?;
            same(|| "counters".to_owned(), &cleared, &vec![0; length as usize])?;
        }
    }
    Ok(())
}

/// Few spheres get the cells that the kernels for many choose.
pub(crate) fn cell_list_setup_small(gpu: &GpuDevice) -> Result<(), KernelError> {
    let one_set = [0, 1, 300, 2048].map(|size| (size, Division::OneSet));
    let species = Division::Species { meets_itself: false };
    let narrow = Division::NarrowSide { two_sets: true };
    let divided = [Division::TwoSets, species, Division::DisjointPairs(3), narrow];
    let divided = divided.into_iter().flat_map(|division| [(300, division), (2048, division)]);
    let cases = one_set.into_iter().chain(divided);
    for (size, division, periodic) in
        cases.flat_map(|(size, division)| [(size, division, false), (size, division, true)])
    {
        let mut random = Random(size as u64);
        let mut coordinate = || random.unit() * 20.0 - 10.0;
        let mut spheres: Vec<Sphere> = (0..size)
            .map(|k| Sphere::new([(); 3].map(|()| coordinate()), [0.5, 0.06, 0.01][k as usize % 3]))
            .collect();
        spheres.iter_mut().step_by(100).for_each(|sphere| sphere.center.y = f32::NAN);
        let period_x = if periodic { 20.0 } else { 0.0 };
        let (cells, counters) = (CELLS, CELLS + 2);
        let call = SearchParams {
            spheres: size,
            cells,
            counters,
            cell_ratio: 2.0,
            tau: 8,
            period_x,
            ..SearchParams::zeroed()
        };
        let new_call = || {
            let call = KernelCall::new(gpu)
                .with("params", &[division.divide(call)])?
                .with("count_source", &[size])?
                .with("spheres", &spheres)?;
            division.bind(call, size as usize)
        };
        let variant = Variant { periodic, species: division.has_species(), ..Variant::default() };
        let expected =
            run_setup(new_call()?, variant, &[(&k::STATS_REDUCE, 3), (&k::CELL_LIST_CONFIGURE, 1)])?;
        let found = run_setup(new_call()?, variant, &[(&k::CELL_LIST_SETUP_SMALL, 1)])?;
        let case = |what: &str| format!("{what} of {size} spheres, periodic {periodic}, {division:?}");
        same(|| case("statistics are cleared"), &found.has_cleared_stats, &true)?;
        same(|| case("the list"), &found.list, &expected.list)?;
        let counts = |result: &SetupResult| (result.outcome.clone(), result.lengths.clone());
        same(|| case("outcome and lengths"), &counts(&found), &counts(&expected))?;
        same(|| case("counters"), &found.starts, &vec![0; CELLS as usize + 2])?;
    }
    Ok(())
}

const CELLS: u32 = 4096;

struct SetupResult {
    has_cleared_stats: bool,
    list: Vec<u8>,
    outcome: Vec<u8>,
    lengths: Vec<u8>,
    starts: Vec<u32>,
}

fn run_setup(
    call: KernelCall<'_>,
    variant: Variant,
    kernels: &[(&'static k::Kernel, u32)],
) -> Result<SetupResult, KernelError> {
    let call = call
        .with("stats", &[InputStats::zeroed()])?
        .with_layout("cell_list", &CellListLayout::zeroed())?
        .with("outcome", &[Outcome::default()])?
        .with("sort_counts", &[SortCounts::zeroed()])?
        .with("starts", &[7_u32; CELLS as usize + 2])?
        .with("occupancy", &[0_u32; 4])?;
    kernels.iter().try_for_each(|&(kernel, groups)| call.run(kernel, variant, groups))?;
    Ok(SetupResult {
        has_cleared_stats: call.read_one::<InputStats>("stats")? == InputStats::zeroed(),
        list: call.read("cell_list", CellListLayout::min_size().get() as usize)?,
        outcome: call.read("outcome", size_of::<Outcome>())?,
        lengths: call.read("sort_counts", size_of::<SortCounts>())?,
        starts: call.read("starts", CELLS as usize + 2)?,
    })
}

/// Constant that is added to radii, larger than the numbers that devices flush to zero.
const FLUSHED: f32 = f32::MIN_POSITIVE * 64.0;

pub(crate) fn expected_stats(spheres: &[Sphere], division: Division, flushes: bool) -> InputStats {
    let mut stats = InputStats::zeroed();
    for (id, sphere) in spheres.iter().enumerate() {
        if !sphere.is_valid() {
            stats.quarantined += 1;
            continue;
        }
        if !division.may_pair(id, spheres.len()) {
            continue;
        }
        for axis in 0..3 {
            let x = ordered(sphere.center[axis]);
            stats.low[axis] = stats.low[axis].max(!x);
            stats.high[axis] = stats.high[axis].max(x);
        }
        let radius = division.effective_radius(id, spheres);
        let value = if flushes && radius.is_subnormal() { 0.0 } else { radius };
        let radius = (value + FLUSHED).to_bits();
        let class = (radius >> 23) as usize;
        stats.smallest = stats.smallest.max(!radius);
        stats.members[256 * division.side(id, spheres.len()) + class] += 1;
        stats.largest[class] = stats.largest[class].max(radius);
    }
    stats
}

pub(crate) fn cell_starts_find(gpu: &GpuDevice) -> Result<(), KernelError> {
    let sizes = [(0, 10), (1, 1), (300, 5000), (20_000, 9000), (20_000, 3), (70_000, 4096), (70_000, 1)];
    for (spheres, cells) in sizes {
        let mut random = Random(spheres as u64);
        let mut sorted: Vec<u32> = (0..spheres).map(|_| random.below(cells)).collect();
        sorted.sort_unstable();
        let list = CellListLayout {
            spheres: spheres as u32,
            cells: cells - cells.min(2),
            ..CellListLayout::zeroed()
        };
        let counters = list.cells + 2;
        let expected: Vec<u32> =
            (0..counters).map(|cell| sorted.partition_point(|&other| other < cell) as u32).collect();
        let call = KernelCall::new(gpu)
            .with_layout("cell_list", &list)?
            .with("cells", &sorted)?
            .with("starts", &vec![u32::MAX; counters as usize])?;
        call.run(&k::CELL_STARTS_FIND, Variant::default(), counters.div_ceil(2048))?;
        let found = call.read::<u32>("starts", counters as usize)?;
        same(|| format!("{spheres} spheres in {cells} cells"), &found, &expected)?;
    }
    Ok(())
}

pub(crate) fn spheres_scatter(gpu: &GpuDevice) -> Result<(), KernelError> {
    for size in SIZES {
        let mut random = Random(size as u64);
        let spheres = hard::any_floats(&SceneSeed::drawn(&mut random, size));
        let cells = size as u32 / 3 + 1;
        let mut starts = vec![0_u32; cells as usize + 1];
        let assigned_cells: Vec<[u32; 2]> = (0..size)
            .map(|_| {
                let cell = random.below(cells);
                starts[cell as usize + 1] += 1;
                [cell, starts[cell as usize + 1] - 1]
            })
            .collect();
        (0..cells as usize).for_each(|cell| starts[cell + 1] += starts[cell]);
        let mut order: Vec<u32> = (0..size as u32).collect();
        order.sort_by_key(|&at| assigned_cells[at as usize]);
        let list = CellListLayout { spheres: size as u32, ..CellListLayout::zeroed() };
        let call = KernelCall::new(gpu)
            .with("params", &[SearchParams::zeroed()])?
            .with_layout("cell_list", &list)?
            .with("spheres", &spheres)?
            .with("starts", &starts)?
            .with("cell_ranks", &assigned_cells)?
            .with_zeros::<[u32; 4]>("sorted", size)?
            .with_zeros::<u32>("cells", size)?
            .with_zeros::<u32>("order", size)?
            .with("outcome", &[Outcome::default()])?;
        let groups = (size as u32).div_ceil(k::WORKGROUP_SIZE);
        call.run(&k::SPHERES_SCATTER, Variant::default(), groups)?;
        let expected_cells: Vec<u32> = order.iter().map(|&at| assigned_cells[at as usize][0]).collect();
        same(|| format!("order of {size} spheres"), &call.read::<u32>("order", size)?, &order)?;
        same(|| format!("cells of {size} spheres"), &call.read::<u32>("cells", size)?, &expected_cells)?;
        gathered(&call, &spheres, &order)?;
        let call = call.with_zeros::<[u32; 4]>("sorted", size)?;
        call.run(&k::SPHERES_GATHER, Variant::default(), groups)?;
        gathered(&call, &spheres, &order)?;
    }
    Ok(())
}

fn gathered(call: &KernelCall<'_>, spheres: &[Sphere], order: &[u32]) -> Result<(), KernelError> {
    let bits = |sphere: &Sphere| bytemuck::cast::<Sphere, [u32; 4]>(*sphere);
    let expected: Vec<[u32; 4]> = order.iter().map(|&at| bits(&spheres[at as usize])).collect();
    let found = call.read::<[u32; 4]>("sorted", order.len())?;
    same(|| format!("{} spheres in order", order.len()), &found, &expected)
}
