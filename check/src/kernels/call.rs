use bytemuck::Zeroable;
use lazygrid::gpu::{GpuDevice, Outcome};
use lazygrid::{Space, Sphere};
use lazygrid_kernels::kernel as k;
use lazygrid_kernels::kernel::Variant;
use lazygrid_kernels::layout::{Bounds, ColumnLayout, Grid, SearchParams, SortCounts};

use super::support::{KernelError, SIZES, ordered, same, variants};
use crate::device::{download, download_one, run, upload, upload_one};
use crate::scenes::{hard, periodic};
use crate::{Random, SceneSeed, TestInput};

pub(crate) fn call_begin(own: &GpuDevice) -> Result<(), KernelError> {
    for (given, most) in [(0_u32, 10), (10, 10), (11, 10)] {
        let call = upload(own, &[SearchParams { spheres: most, ..SearchParams::zeroed() }])?;
        let source = upload(own, &[given])?;
        let bounds = upload(own, &[1_u32; size_of::<Bounds>() / 4])?;
        let grid = upload_one(own, &Grid::zeroed())?;
        let outcome = upload(own, &[1_u32; size_of::<Outcome>() / 4])?;
        let bound = [
            ("params", &call),
            ("count_source", &source),
            ("bounds", &bounds),
            ("grid", &grid),
            ("outcome", &outcome),
        ];
        run(own, &k::CALL_BEGIN, Variant::default(), 1, &bound)?;
        let case = |what: &str| format!("{what}, {given} spheres of {most}");
        let [most_bits, none] = [u32::MAX, 0].map(|bits| [bits; 3]);
        let empty = Bounds { low: most_bits, high: none, radius_min: u32::MAX, ..Bounds::zeroed() };
        same(|| case("bounds"), &download::<Bounds>(own, &bounds, 1)?[0], &empty)?;
        same(|| case("spheres"), &download_one::<Grid>(own, &grid)?.spheres, &given.min(most))?;
        let found = download::<Outcome>(own, &outcome, 1)?[0];
        let overflow = if given > most { Outcome::OVERFLOW_SPHERES } else { 0 };
        let (x, y, z) = (found.dispatch_x, found.dispatch_y, found.dispatch_z);
        let cleared = Outcome {
            overflow,
            spheres: given,
            dispatch_x: x,
            dispatch_y: y,
            dispatch_z: z,
            // Kept from the previous call.
            max_occupancy: 1,
            ..Outcome::zeroed()
        };
        same(|| case("outcome"), &found, &cleared)?;
    }
    Ok(())
}

/// Exact at any distance from the origin and for any length of the box.
pub(crate) fn spheres_wrap(own: &GpuDevice) -> Result<(), KernelError> {
    let lengths = [
        [Some(1.0_f32), Some(0.1), Some(3.3)],
        [None, Some(f32::MAX), Some(1.0 / 3.0)],
        [Some(f32::MIN_POSITIVE), Some(f32::from_bits(1)), Some(1e-40)],
        [Some(16_777_215.0), Some(1e30), None],
    ];
    for (seed, lengths) in lengths.into_iter().enumerate() {
        let space = periodic::space(lengths);
        let spheres = wrapped_scene(seed as u64, space);
        let call = SearchParams::zeroed().in_space(space);
        let grid = Grid { spheres: spheres.len() as u32, ..Grid::zeroed() };
        let (call, grid, given) = (upload(own, &[call])?, upload_one(own, &grid)?, upload(own, &spheres)?);
        let wrapped = upload(own, &vec![[0_u32; 4]; spheres.len()])?;
        let bound = [("params", &call), ("grid", &grid), ("given", &given), ("wrapped", &wrapped)];
        let groups = spheres.len().div_ceil(256) as u32;
        run(own, &k::SPHERES_WRAP, Variant::default(), groups, &bound)?;
        let found = download::<[f32; 4]>(own, &wrapped, spheres.len())?;
        for (sphere, found) in spheres.iter().zip(found) {
            let center = space.wrap(sphere.center).to_array();
            let same_place = center == [found[0], found[1], found[2]] && found[3] == sphere.radius;
            same(|| format!("{sphere:?} in {lengths:?} at {center:?}: {found:?}"), &same_place, &true)?;
        }
    }
    Ok(())
}

/// No value is written above the number or the capacity.
pub(crate) fn spheres_interleave(own: &GpuDevice) -> Result<(), KernelError> {
    const ROOM: usize = 700;
    const UNWRITTEN: [u32; 4] = [7; 4];
    let mut random = Random(0);
    for (given, most) in [(0_u32, 10_u32), (255, 700), (256, 257), (700, 700), (701, 700)] {
        let layout = ColumnLayout {
            first: [0; 4].map(|_: u32| random.below(9)),
            stride: [1, 9, 0, 3].map(|stride: u32| stride + random.below(2)),
        };
        let columns = layout.bytes(ROOM as u32).map(|bytes| -> Vec<u32> {
            (0..bytes / 4).map(|_| 0x3f80_0000 + random.below(1 << 22)).collect()
        });
        let call = upload(own, &[SearchParams { spheres: most, ..SearchParams::zeroed() }])?;
        let (described, source) = (upload(own, &[layout])?, upload(own, &[given])?);
        let [x, y, z, r] = columns.each_ref().map(|column| upload(own, column));
        let (x, y, z, r) = (x?, y?, z?, r?);
        let rows = upload(own, &[UNWRITTEN; ROOM])?;
        let bound = [
            ("params", &call),
            ("columns", &described),
            ("count_source", &source),
            ("x", &x),
            ("y", &y),
            ("z", &z),
            ("r", &r),
            ("rows", &rows),
        ];
        run(own, &k::SPHERES_INTERLEAVE, Variant::default(), ROOM.div_ceil(256) as u32, &bound)?;
        let number = |column: usize, sphere: usize| {
            columns[column][layout.first[column] as usize + sphere * layout.stride[column] as usize]
        };
        let written = given.min(most) as usize;
        let row = |sphere| {
            if sphere < written { [0, 1, 2, 3].map(|column| number(column, sphere)) } else { UNWRITTEN }
        };
        let expected: Vec<[u32; 4]> = (0..ROOM).map(row).collect();
        let found = download::<[u32; 4]>(own, &rows, ROOM)?;
        same(|| format!("{given} spheres of {most} in {layout:?}"), &found, &expected)?;
    }
    Ok(())
}

fn wrapped_scene(seed: u64, space: Space) -> Vec<Sphere> {
    let mut random = Random(seed);
    let words = SceneSeed::drawn(&mut random, 500);
    let mut spheres = hard::any_floats(&words);
    spheres.extend((0..500).map(|k| {
        let mut place = |length: Option<f32>| {
            let x = (random.below(9) as f32 - 4.0) * 0.5 * length.unwrap_or(1.0);
            let x = if x.is_finite() { x } else { f32::MAX };
            [x, x, x.next_up(), x.next_down()][random.below(4) as usize].clamp(f32::MIN, f32::MAX)
        };
        Sphere::new(space.lengths_f32().map(&mut place), k as f32)
    }));
    spheres
}

pub(crate) fn bounds_reduce(own: &GpuDevice) -> Result<(), KernelError> {
    let float = |word: u32| f32::from_bits(if word >> 31 == 1 { word ^ 1 << 31 } else { !word });
    for size in SIZES {
        let mut spheres = hard::soup(&SceneSeed::drawn(&mut Random(size as u64), size));
        let bad = size / 100;
        spheres.iter_mut().take(bad).for_each(|sphere| sphere.center.y = f32::NAN);
        let empty = Bounds { low: [u32::MAX; 3], radius_min: u32::MAX, ..Bounds::zeroed() };
        let (call, bounds) = (upload(own, &[SearchParams::zeroed()])?, upload(own, &[empty])?);
        let grid = upload_one(own, &Grid { spheres: size as u32, ..Grid::zeroed() })?;
        let (outcome, input) = (upload(own, &[Outcome::zeroed()])?, upload(own, &spheres)?);
        let bound = [
            ("params", &call),
            ("grid", &grid),
            ("spheres", &input),
            ("bounds", &bounds),
            ("outcome", &outcome),
        ];
        let groups = (size as u32).div_ceil(k::BOUNDS_TILE);
        run(own, &k::BOUNDS_REDUCE, Variant::default(), groups, &bound)?;
        let found = download::<Bounds>(own, &bounds, 1)?[0];
        let outcome = download::<Outcome>(own, &outcome, 1)?[0];
        same(|| format!("invalid spheres of {size}"), &outcome.quarantined, &(bad as u32))?;
        let valid = &spheres[bad..];
        if valid.is_empty() {
            same(|| "bounds without spheres".to_owned(), &found, &empty)?;
            continue;
        }
        let extent = |of: &dyn Fn(&Sphere) -> f32| {
            let values = valid.iter().map(of);
            values.fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
        };
        for axis in 0..3 {
            let [low, _] = extent(&|sphere| sphere.center[axis] - sphere.radius);
            let [_, high] = extent(&|sphere| sphere.center[axis] + sphere.radius);
            let (found_low, found_high) = (float(found.low[axis]), float(found.high[axis]));
            let is_held = found.low[axis] <= ordered(low) && found.high[axis] >= ordered(high);
            let is_near = found_low >= low - 1e-4 && found_high <= high + 1e-4;
            let case = || format!("{low}..{high} within {found_low}..{found_high}, {size} spheres");
            same(case, &(is_held && is_near), &true)?;
        }
        // A radius of 0 is increased slightly, to differ from "no radius".
        let [least, most] = extent(&|sphere| sphere.radius);
        let radii = [found.radius_min, found.radius_max].map(f32::from_bits);
        let near = radii[0] >= least && radii[0] <= least + 1e-30 && radii[1] == most;
        same(|| format!("radii {least} to {most} as {radii:?}, {size} spheres"), &near, &true)?;
    }
    Ok(())
}

pub(crate) fn entries_finish(own: &GpuDevice) -> Result<(), KernelError> {
    let capacity = 5000;
    for (low, high) in [(0_u32, 0_u32), (1, 0), (4999, 0), (5000, 0), (5001, 0), (u32::MAX, 0), (7, 1)] {
        let call = upload(own, &[SearchParams { entry_capacity: capacity, ..SearchParams::zeroed() }])?;
        let wanted = Outcome { entries_lo: low, entries_hi: high, ..Outcome::zeroed() };
        let (outcome, lengths) = (upload(own, &[wanted])?, upload(own, &[SortCounts::zeroed()])?);
        let bound = [("params", &call), ("outcome", &outcome), ("sort_counts", &lengths)];
        run(own, &k::ENTRIES_FINISH, Variant::default(), 1, &bound)?;
        let items = wanted.entries_needed().min(capacity.into()) as u32;
        let overflow = if wanted.entries_needed() > capacity.into() { Outcome::OVERFLOW_ENTRIES } else { 0 };
        let found = download::<Outcome>(own, &outcome, 1)?[0];
        let lengths = download::<SortCounts>(own, &lengths, 1)?[0];
        let case = || format!("{} entries, capacity {capacity}", wanted.entries_needed());
        same(case, &(lengths.items, found), &(items, Outcome { overflow, ..wanted }))?;
        let tiles = lengths.counters / 256;
        same(case, &(lengths.counters % 256 == 0 && (tiles > 0) == (items > 0) && tiles <= items), &true)?;
    }
    Ok(())
}

/// Dispatch arguments suffice if one cell has all entries, up to the largest plan.
pub(crate) fn runs_search_far_dispatch_args(own: &GpuDevice) -> Result<(), KernelError> {
    let most = 65_535 * k::RUN_TILES;
    let blocks = [1, 5, 4096, 65_535, 65_536, most];
    let tiles = [1, k::RUN_TILES + 1, 65_535, 131_071, 196_606, 262_141, 1_000_003, most];
    for (blocks, tiles) in blocks.into_iter().flat_map(|blocks| tiles.map(|tiles| (blocks, tiles))) {
        for tiles_per_submission in [1 << 18, SearchParams::UNLIMITED] {
            let call = upload(own, &[SearchParams { tiles_per_submission, ..SearchParams::zeroed() }])?;
            let listed = Outcome { deferred_blocks: blocks, deferred_max_tiles: tiles, ..Outcome::zeroed() };
            let (outcome, dispatch) = (upload(own, &[listed])?, upload(own, &[0_u32; 4])?);
            let bound = [("params", &call), ("outcome", &outcome), ("dispatch", &dispatch)];
            run(own, &k::RUNS_SEARCH_FAR_DISPATCH_ARGS, Variant::default(), 1, &bound)?;
            let outcome = download::<Outcome>(own, &outcome, 1)?[0];
            let [x, y, z] = download::<[u32; 3]>(own, &dispatch, 1)?[0];
            let taken = outcome.deferred_end.wrapping_sub(outcome.deferred_begin);
            let fits = match tiles_per_submission {
                SearchParams::UNLIMITED => taken == blocks && !outcome.has_remaining_work(),
                _ => taken == 1 || (2..=blocks.min(tiles_per_submission / tiles)).contains(&taken),
            };
            let counts = [x, y, z].iter().all(|groups| (1..=65_535).contains(groups));
            let reaches = counts && y * z >= taken && tiles.div_ceil(x) <= k::RUN_TILES;
            let case = || {
                format!(
                    "{blocks} blocks of {tiles} tiles, {tiles_per_submission} per submission: {taken} dispatched as {x} {y} {z}"
                )
            };
            same(case, &(fits && reaches), &true)?;
        }
    }
    Ok(())
}

pub(crate) fn naive_search(own: &GpuDevice) -> Result<(), KernelError> {
    for variant in variants(own) {
        more_than_a_word_of_pairs(own, variant)?;
        for (size, window, capacity) in [
            (0_u32, 0..u32::MAX, 16_u32),
            (1, 0..u32::MAX, 16),
            (2, 0..u32::MAX, 16),
            (257, 0..u32::MAX, 1 << 20),
            (1000, 100..300, 1 << 20),
            (1000, 0..u32::MAX, 1000),
        ] {
            let spheres = vec![Sphere::new([1.0, 2.0, 3.0], 0.5); size as usize];
            let scenario = TestInput::from(spheres);
            let mut expected = scenario.oracle();
            expected.retain(|pair| window.contains(&pair.i));
            let call = SearchParams {
                spheres: size,
                pair_capacity: capacity,
                search_groups: 64,
                window_begin: window.start,
                window_end: window.end,
                ..SearchParams::zeroed()
            };
            let grid = upload_one(own, &Grid { spheres: size, ordinary: 1, ..Grid::zeroed() })?;
            let (call, input) = (upload(own, &[call])?, upload(own, &scenario.spheres)?);
            let outcome = upload(own, &[Outcome::zeroed()])?;
            let pairs = upload(own, &vec![[u32::MAX; 2]; capacity as usize + 1])?;
            let bound = [
                ("params", &call),
                ("grid", &grid),
                ("spheres", &input),
                ("outcome", &outcome),
                ("pairs", &pairs),
            ];
            run(own, &k::NAIVE_SEARCH, variant, 64, &bound)?;
            let found = download::<Outcome>(own, &outcome, 1)?[0].found();
            let case = |what: &str| format!("{what}, {size} at one point, {variant:?}");
            same(|| case("found"), &found, &(expected.len() as u64))?;
            let mut listed = download::<[u32; 2]>(own, &pairs, capacity as usize + 1)?;
            same(|| case("after the end"), &listed[capacity as usize], &[u32::MAX; 2])?;
            listed.retain(|pair| *pair != [u32::MAX; 2]);
            listed.sort_unstable();
            let wanted: Vec<[u32; 2]> = expected.iter().map(|pair| [pair.i, pair.j]).collect();
            if wanted.len() <= capacity as usize {
                same(|| case("pairs"), &listed, &wanted)?;
            } else {
                let distinct =
                    listed.windows(2).all(|two| two[0] < two[1]) && listed.len() == capacity as usize;
                same(|| case("as many as the capacity"), &distinct, &true)?;
            }
        }
    }
    Ok(())
}

fn more_than_a_word_of_pairs(own: &GpuDevice, variant: Variant) -> Result<(), KernelError> {
    let spheres = vec![Sphere::new([1.0, 2.0, 3.0], 0.5); 600];
    let call = SearchParams {
        spheres: 600,
        pair_capacity: 16,
        search_groups: 64,
        window_end: u32::MAX,
        ..SearchParams::zeroed()
    };
    let before = Outcome { found_lo: u32::MAX - 1000, found_hi: 2, ..Outcome::zeroed() };
    let grid = upload_one(own, &Grid { spheres: 600, ordinary: 1, ..Grid::zeroed() })?;
    let (call, input, outcome) = (upload(own, &[call])?, upload(own, &spheres)?, upload(own, &[before])?);
    let pairs = upload(own, &[[u32::MAX; 2]; 17])?;
    let bound =
        [("params", &call), ("grid", &grid), ("spheres", &input), ("outcome", &outcome), ("pairs", &pairs)];
    run(own, &k::NAIVE_SEARCH, variant, 64, &bound)?;
    let found = download::<Outcome>(own, &outcome, 1)?[0].found();
    same(|| format!("found beyond 32 bits, {variant:?}"), &found, &(before.found() + 600 * 599 / 2))
}

/// Each written pair has a thread, and an overflow is reported.
pub(crate) fn outcome_finish(own: &GpuDevice) -> Result<(), KernelError> {
    let capacity = 40_000_000_u32;
    for (low, high) in [
        (0_u32, 0_u32),
        (1, 0),
        (256, 0),
        (257, 0),
        (16_776_961, 0),
        (capacity, 0),
        (capacity + 1, 0),
        (3, 2),
    ] {
        let call = upload(
            own,
            &[SearchParams {
                pair_capacity: capacity,
                consumer_workgroup_size: 256,
                ..SearchParams::zeroed()
            }],
        )?;
        let given = Outcome { found_lo: low, found_hi: high, ..Outcome::zeroed() };
        let outcome = upload(own, &[given])?;
        run(own, &k::OUTCOME_FINISH, Variant::default(), 1, &[("params", &call), ("outcome", &outcome)])?;
        let found = download::<Outcome>(own, &outcome, 1)?[0];
        let overflow = if given.found() > capacity.into() { Outcome::OVERFLOW_PAIRS } else { 0 };
        let case = || format!("{} pairs, capacity {capacity}: {found:?}", given.found());
        same(case, &found.overflow, &overflow)?;
        let written = given.found().min(capacity.into());
        let groups = u64::from(found.dispatch_x) * u64::from(found.dispatch_y) * u64::from(found.dispatch_z);
        let enough = groups >= written.div_ceil(256) && groups < written.div_ceil(256) + 65_536;
        same(case, &(enough && found.dispatch_x <= 65_535 && found.dispatch_y >= 1), &true)?;
    }
    Ok(())
}
