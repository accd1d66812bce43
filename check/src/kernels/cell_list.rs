use bytemuck::Zeroable;
use encase::ShaderType;
use lazygrid::Sphere;
use lazygrid::gpu::{GpuDevice, wgpu};
use lazygrid_kernels::kernel::{self as k, Variant};
use lazygrid_kernels::layout::{CellListLayout, InputStats, Outcome, SearchParams, SortCounts};

use super::division::Division;
use super::support::{KernelError, SIZES, ordered, same};
use crate::device::{download, run, upload, upload_one};
use crate::scenes::hard;
use crate::{Random, SceneSeed};

/// Any number of workgroups gives the same statistics, and clears the counters.
pub(crate) fn stats_reduce(own: &GpuDevice) -> Result<(), KernelError> {
    let species = Division::Species { meets_itself: true };
    let divisions = [Division::OneSet, Division::TwoSets, species, Division::DisjointPairs(4)];
    for (size, groups, division) in SIZES.into_iter().flat_map(|size| {
        [1, 3].into_iter().flat_map(move |groups| divisions.map(|division| (size, groups, division)))
    }) {
        let mut spheres = hard::any_floats(&SceneSeed::drawn(&mut Random(size as u64), size));
        spheres.iter_mut().step_by(100).for_each(|sphere| sphere.center.y = f32::NAN);
        let (counters, occupancy_slots) = (size as u32 + 7, 512);
        let call = SearchParams { spheres: size as u32, counters, occupancy_slots, ..SearchParams::zeroed() };
        let call = division.divide(call);
        let (call, count) = (upload(own, &[call])?, upload(own, &[size as u32])?);
        let (input, survey) = (upload(own, &spheres)?, upload(own, &[InputStats::zeroed()])?);
        let [starts, density] = [counters, occupancy_slots].map(|length| vec![7_u32; length as usize]);
        let (starts, density) = (upload(own, &starts)?, upload(own, &density)?);
        let bound = [
            ("params", &call),
            ("count_source", &count),
            ("spheres", &input),
            ("stats", &survey),
            ("starts", &starts),
            ("occupancy", &density),
        ];
        let variant = Variant { species: division.has_species(), ..Variant::default() };
        let species = division.upload(own, size)?;
        run(own, &k::STATS_REDUCE, variant, groups, &species.and(&bound))?;
        let found = download::<InputStats>(own, &survey, 1)?[0];
        // Devices may flush subnormal radii to zero.
        let [kept, flushed] = [false, true].map(|flushes| surveyed(&spheres, division, flushes));
        let expected = if found.smallest == flushed.smallest { flushed } else { kept };
        let case = |what: &str| format!("{what} of {size} spheres, {groups} workgroups, {division:?}");
        let counted = |survey: &InputStats| (survey.low, survey.high, survey.smallest, survey.quarantined);
        same(|| case("bounds"), &counted(&found), &counted(&expected))?;
        for class in 0..256 {
            let members = |survey: &InputStats| {
                survey.members[class..].iter().step_by(256).copied().collect::<Vec<_>>()
            };
            let sizes = |survey: &InputStats| (members(survey), survey.largest[class]);
            same(|| case(&format!("class {class}")), &sizes(&found), &sizes(&expected))?;
        }
        for (what, length) in [(&starts, counters), (&density, occupancy_slots)] {
            let cleared = download::<u32>(own, what, length as usize)?;
            same(|| "counters".to_owned(), &cleared, &vec![0; length as usize])?;
        }
    }
    Ok(())
}

/// Chooses the cells of the kernels for many spheres, and clears the statistics.
pub(crate) fn cell_list_setup_small(own: &GpuDevice) -> Result<(), KernelError> {
    let one_set = [0, 1, 300, 2048].map(|size| (size, Division::OneSet));
    let species = Division::Species { meets_itself: false };
    let divided = [Division::TwoSets, species, Division::DisjointPairs(3)];
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
        let call = division.divide(call);
        let (call, count, input) = (upload(own, &[call])?, upload(own, &[size])?, upload(own, &spheres)?);
        let species = division.upload(own, size as usize)?;
        let given = species.and(&[("params", &call), ("count_source", &count), ("spheres", &input)]);
        let variant = Variant { periodic, species: division.has_species(), ..Variant::default() };
        let expected = begun(own, &given, variant, &[(&k::STATS_REDUCE, 3), (&k::CELL_LIST_CONFIGURE, 1)])?;
        let found = begun(own, &given, variant, &[(&k::CELL_LIST_SETUP_SMALL, 1)])?;
        let case = |what: &str| format!("{what} of {size} spheres, periodic {periodic}, {division:?}");
        same(|| case("survey is empty"), &found.leaves_no_survey, &true)?;
        same(|| case("the list"), &found.list, &expected.list)?;
        let counts = |begun: &Begun| (begun.outcome.clone(), begun.lengths.clone());
        same(|| case("outcome and lengths"), &counts(&found), &counts(&expected))?;
        same(|| case("counters"), &found.starts, &vec![0; CELLS as usize + 2])?;
    }
    Ok(())
}

const CELLS: u32 = 4096;

struct Begun {
    leaves_no_survey: bool,
    list: Vec<u8>,
    outcome: Vec<u8>,
    lengths: Vec<u8>,
    starts: Vec<u32>,
}

fn begun(
    own: &GpuDevice,
    given: &[(&'static str, &wgpu::Buffer)],
    variant: Variant,
    kernels: &[(&'static k::Kernel, u32)],
) -> Result<Begun, KernelError> {
    let (survey, list) = (upload(own, &[InputStats::zeroed()])?, upload_one(own, &CellListLayout::zeroed())?);
    let (outcome, lengths) = (upload(own, &[Outcome::default()])?, upload(own, &[SortCounts::zeroed()])?);
    let (starts, density) = (upload(own, &[7_u32; CELLS as usize + 2])?, upload(own, &[0_u32; 4])?);
    let written = [
        ("stats", &survey),
        ("cell_list", &list),
        ("outcome", &outcome),
        ("sort_counts", &lengths),
        ("starts", &starts),
        ("occupancy", &density),
    ];
    for &(kernel, groups) in kernels {
        let binds = |name: &str| kernel.bindings(variant).any(|binding| binding.name == name);
        let bound: Vec<_> = given.iter().copied().chain(written).filter(|(name, _)| binds(name)).collect();
        run(own, kernel, variant, groups, &bound)?;
    }
    Ok(Begun {
        leaves_no_survey: download::<InputStats>(own, &survey, 1)?[0] == InputStats::zeroed(),
        list: download::<u8>(own, &list, CellListLayout::min_size().get() as usize)?,
        outcome: download::<u8>(own, &outcome, size_of::<Outcome>())?,
        lengths: download::<u8>(own, &lengths, size_of::<SortCounts>())?,
        starts: download::<u32>(own, &starts, CELLS as usize + 2)?,
    })
}

/// Larger than the numbers that devices flush.
const FLUSHED: f32 = f32::MIN_POSITIVE * 64.0;

/// Expected statistics, if subnormal numbers are flushed or not.
pub(crate) fn surveyed(spheres: &[Sphere], division: Division, flushes: bool) -> InputStats {
    let mut survey = InputStats::zeroed();
    for (id, sphere) in spheres.iter().enumerate() {
        if !sphere.is_valid() {
            survey.quarantined += 1;
            continue;
        }
        if !division.may_pair(id, spheres.len()) {
            continue;
        }
        for axis in 0..3 {
            let x = ordered(sphere.center[axis]);
            survey.low[axis] = survey.low[axis].max(!x);
            survey.high[axis] = survey.high[axis].max(x);
        }
        let kept = if flushes && sphere.radius.is_subnormal() { 0.0 } else { sphere.radius };
        let radius = (kept + FLUSHED).to_bits();
        let class = (radius >> 23) as usize;
        survey.smallest = survey.smallest.max(!radius);
        survey.members[256 * division.side(id, spheres.len()) + class] += 1;
        survey.largest[class] = survey.largest[class].max(radius);
    }
    survey
}

pub(crate) fn cell_starts_find(own: &GpuDevice) -> Result<(), KernelError> {
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
            (0..counters).map(|cell| sorted.partition_point(|&own| own < cell) as u32).collect();
        let (list, sorted) = (upload_one(own, &list)?, upload(own, &sorted)?);
        let starts = upload(own, &vec![u32::MAX; counters as usize])?;
        let bound = [("cell_list", &list), ("cells", &sorted), ("starts", &starts)];
        run(own, &k::CELL_STARTS_FIND, Variant::default(), counters.div_ceil(2048), &bound)?;
        let found = download::<u32>(own, &starts, counters as usize)?;
        same(|| format!("{spheres} spheres in {cells} cells"), &found, &expected)?;
    }
    Ok(())
}

pub(crate) fn spheres_scatter(own: &GpuDevice) -> Result<(), KernelError> {
    for size in SIZES {
        let mut random = Random(size as u64);
        let spheres = hard::any_floats(&SceneSeed::drawn(&mut random, size));
        let cells = size as u32 / 3 + 1;
        let mut starts = vec![0_u32; cells as usize + 1];
        let homes: Vec<[u32; 2]> = (0..size)
            .map(|_| {
                let cell = random.below(cells);
                starts[cell as usize + 1] += 1;
                [cell, starts[cell as usize + 1] - 1]
            })
            .collect();
        (0..cells as usize).for_each(|cell| starts[cell + 1] += starts[cell]);
        let mut order: Vec<u32> = (0..size as u32).collect();
        order.sort_by_key(|&at| homes[at as usize]);
        let call = upload(own, &[SearchParams::zeroed()])?;
        let outcome = upload(own, &[Outcome::default()])?;
        let list = upload_one(own, &CellListLayout { spheres: size as u32, ..CellListLayout::zeroed() })?;
        let (input, starts, homes_given) =
            (upload(own, &spheres)?, upload(own, &starts)?, upload(own, &homes)?);
        let [cells, places] = [(); 2].map(|()| upload(own, &vec![0_u32; size]));
        let (cells, places, sorted) = (cells?, places?, upload(own, &vec![[0_u32; 4]; size])?);
        let bound = [
            ("params", &call),
            ("cell_list", &list),
            ("spheres", &input),
            ("starts", &starts),
            ("cell_ranks", &homes_given),
            ("sorted", &sorted),
            ("cells", &cells),
            ("order", &places),
            ("outcome", &outcome),
        ];
        let groups = (size as u32).div_ceil(k::WORKGROUP_SIZE);
        run(own, &k::SPHERES_SCATTER, Variant::default(), groups, &bound)?;
        let expected_cells: Vec<u32> = order.iter().map(|&at| homes[at as usize][0]).collect();
        same(|| format!("order of {size} spheres"), &download::<u32>(own, &places, size)?, &order)?;
        same(|| format!("cells of {size} spheres"), &download::<u32>(own, &cells, size)?, &expected_cells)?;
        gathered(own, &sorted, &spheres, &order)?;
        // The gathering kernel must give the same order.
        let sorted = upload(own, &vec![[0_u32; 4]; size])?;
        let bound = [
            ("params", &call),
            ("cell_list", &list),
            ("spheres", &input),
            ("cells", &cells),
            ("order", &places),
            ("sorted", &sorted),
            ("outcome", &outcome),
        ];
        run(own, &k::SPHERES_GATHER, Variant::default(), groups, &bound)?;
        gathered(own, &sorted, &spheres, &order)?;
    }
    Ok(())
}

fn gathered(
    own: &GpuDevice,
    sorted: &wgpu::Buffer,
    spheres: &[Sphere],
    order: &[u32],
) -> Result<(), KernelError> {
    let bits = |sphere: &Sphere| bytemuck::cast::<Sphere, [u32; 4]>(*sphere);
    let expected: Vec<[u32; 4]> = order.iter().map(|&at| bits(&spheres[at as usize])).collect();
    let found = download::<[u32; 4]>(own, sorted, order.len())?;
    same(|| format!("{} spheres in order", order.len()), &found, &expected)
}
