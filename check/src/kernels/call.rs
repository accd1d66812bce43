use bytemuck::Zeroable;
use lazygrid::gpu::{GpuDevice, Outcome};
use lazygrid::{Space, Sphere};
use lazygrid_kernels::kernel as k;
use lazygrid_kernels::kernel::Variant;
use lazygrid_kernels::layout::{Bounds, ColumnLayout, Grid, SearchParams, SortCounts};

use super::kernel_call::KernelCall;
use super::support::{KernelError, SIZES, changed, ordered, same, variants};
use crate::scenes::{hard, periodic};
use crate::{Random, SceneSeed, TestInput};

pub(crate) fn call_begin(gpu: &GpuDevice) -> Result<(), KernelError> {
    for (count, most) in [(0_u32, 10), (10, 10), (11, 10)] {
        let call = KernelCall::new(gpu)
            .with("params", &[SearchParams { spheres: most, ..SearchParams::zeroed() }])?
            .with("count_source", &[count])?
            .with("bounds", &[1_u32; size_of::<Bounds>() / 4])?
            .with_layout("grid", &Grid::zeroed())?
            .with("outcome", &[1_u32; size_of::<Outcome>() / 4])?;
        call.run(&k::CALL_BEGIN, Variant::default(), 1)?;
        let case = |what: &str| format!("{what}, {count} spheres of {most}");
        let [most_bits, none] = [u32::MAX, 0].map(|bits| [bits; 3]);
        let empty = Bounds { low: most_bits, high: none, radius_min: u32::MAX, ..Bounds::zeroed() };
        same(|| case("bounds"), &call.read_one::<Bounds>("bounds")?, &empty)?;
        same(|| case("spheres"), &call.read_layout::<Grid>("grid")?.spheres, &count.min(most))?;
        let found = call.read_one::<Outcome>("outcome")?;
        let overflow = if count > most { Outcome::OVERFLOW_SPHERES } else { 0 };
        let (x, y, z) = (found.dispatch_x, found.dispatch_y, found.dispatch_z);
        let cleared = changed(Outcome::zeroed(), |new| {
            new.overflow = overflow;
            new.spheres = count;
            new.dispatch_x = x;
            new.dispatch_y = y;
            new.dispatch_z = z;
            new.max_occupancy = 1;
        });
        same(|| case("outcome"), &found, &cleared)?;
    }
    Ok(())
}

pub(crate) fn spheres_wrap(gpu: &GpuDevice) -> Result<(), KernelError> {
    let lengths = [
        [Some(1.0_f32), Some(0.1), Some(3.3)],
        [None, Some(f32::MAX), Some(1.0 / 3.0)],
        [Some(f32::MIN_POSITIVE), Some(f32::from_bits(1)), Some(1e-40)],
        [Some(16_777_215.0), Some(1e30), None],
    ];
    for (seed, lengths) in lengths.into_iter().enumerate() {
        let space = periodic::space(lengths);
        let spheres = wrapped_scene(seed as u64, space);
        let call = KernelCall::new(gpu)
            .with("params", &[SearchParams::zeroed().in_space(space)])?
            .with_layout("grid", &Grid { spheres: spheres.len() as u32, ..Grid::zeroed() })?
            .with("given", &spheres)?
            .with_zeros::<[u32; 4]>("wrapped", spheres.len())?;
        call.run(&k::SPHERES_WRAP, Variant::default(), spheres.len().div_ceil(256) as u32)?;
        let found = call.read::<[f32; 4]>("wrapped", spheres.len())?;
        for (sphere, found) in spheres.iter().zip(found) {
            let center = space.wrap(sphere.center).to_array();
            let same_place = center == [found[0], found[1], found[2]] && found[3] == sphere.radius;
            same(|| format!("{sphere:?} in {lengths:?} at {center:?}: {found:?}"), &same_place, &true)?;
        }
    }
    Ok(())
}

pub(crate) fn spheres_interleave(gpu: &GpuDevice) -> Result<(), KernelError> {
    const CAPACITY: usize = 700;
    const UNWRITTEN: [u32; 4] = [7; 4];
    let mut random = Random(0);
    for (count, most) in [(0_u32, 10_u32), (255, 700), (256, 257), (700, 700), (701, 700)] {
        let layout = ColumnLayout {
            first: [0; 4].map(|_: u32| random.below(9)),
            stride: [1, 9, 0, 3].map(|stride: u32| stride + random.below(2)),
        };
        let columns = layout.bytes(CAPACITY as u32).map(|bytes| -> Vec<u32> {
            (0..bytes / 4).map(|_| 0x3f80_0000 + random.below(1 << 22)).collect()
        });
        let call = KernelCall::new(gpu)
            .with("params", &[SearchParams { spheres: most, ..SearchParams::zeroed() }])?
            .with("columns", &[layout])?
            .with("count_source", &[count])?
            .with("x", &columns[0])?
            .with("y", &columns[1])?
            .with("z", &columns[2])?
            .with("r", &columns[3])?
            .with("rows", &[UNWRITTEN; CAPACITY])?;
        call.run(&k::SPHERES_INTERLEAVE, Variant::default(), CAPACITY.div_ceil(256) as u32)?;
        let number = |column: usize, sphere: usize| {
            columns[column][layout.first[column] as usize + sphere * layout.stride[column] as usize]
        };
        let written = count.min(most) as usize;
        let row = |sphere| {
            if sphere < written { [0, 1, 2, 3].map(|column| number(column, sphere)) } else { UNWRITTEN }
        };
        let expected: Vec<[u32; 4]> = (0..CAPACITY).map(row).collect();
        let found = call.read::<[u32; 4]>("rows", CAPACITY)?;
        same(|| format!("{count} spheres of {most} in {layout:?}"), &found, &expected)?;
    }
    Ok(())
}

fn wrapped_scene(seed: u64, space: Space) -> Vec<Sphere> {
    let mut random = Random(seed);
    let words = SceneSeed::drawn(&mut random, 500);
    let mut spheres = hard::any_floats(&words);
    spheres.extend((0..500).map(|k| {
        let mut coordinate = |length: Option<f32>| {
            let x = (random.below(9) as f32 - 4.0) * 0.5 * length.unwrap_or(1.0);
            let x = if x.is_finite() { x } else { f32::MAX };
            [x, x, x.next_up(), x.next_down()][random.below(4) as usize].clamp(f32::MIN, f32::MAX)
        };
        Sphere::new(space.lengths_f32().map(&mut coordinate), k as f32)
    }));
    spheres
}

pub(crate) fn bounds_reduce(gpu: &GpuDevice) -> Result<(), KernelError> {
    let float = |word: u32| f32::from_bits(if word >> 31 == 1 { word ^ 1 << 31 } else { !word });
    for size in SIZES {
        let mut spheres = hard::soup(&SceneSeed::drawn(&mut Random(size as u64), size));
        let bad = size / 100;
        spheres.iter_mut().take(bad).for_each(|sphere| sphere.center.y = f32::NAN);
        let empty = Bounds { low: [u32::MAX; 3], radius_min: u32::MAX, ..Bounds::zeroed() };
        let call = KernelCall::new(gpu)
            .with("params", &[SearchParams::zeroed()])?
            .with_layout("grid", &Grid { spheres: size as u32, ..Grid::zeroed() })?
            .with("spheres", &spheres)?
            .with("bounds", &[empty])?
            .with("outcome", &[Outcome::zeroed()])?;
        call.run(&k::BOUNDS_REDUCE, Variant::default(), (size as u32).div_ceil(k::BOUNDS_TILE))?;
        let found = call.read_one::<Bounds>("bounds")?;
        let outcome = call.read_one::<Outcome>("outcome")?;
        same(|| format!("invalid spheres of {size}"), &outcome.quarantined, &(bad as u32))?;
        let valid = &spheres[bad..];
        if valid.is_empty() {
            same(|| "bounds without spheres".to_owned(), &found, &empty)?;
            continue;
        }
        let extent = |value: &dyn Fn(&Sphere) -> f32| {
            let values = valid.iter().map(value);
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
        // A radius of 0 is increased, to differ from "no radius".
        let [least, most] = extent(&|sphere| sphere.radius);
        let radii = [found.radius_min, found.radius_max].map(f32::from_bits);
        let near = radii[0] >= least && radii[0] <= least + 1e-30 && radii[1] == most;
        same(|| format!("radii {least} to {most} as {radii:?}, {size} spheres"), &near, &true)?;
    }
    Ok(())
}

pub(crate) fn entries_finish(gpu: &GpuDevice) -> Result<(), KernelError> {
    let capacity = 5000;
    for (low, high) in [(0_u32, 0_u32), (1, 0), (4999, 0), (5000, 0), (5001, 0), (u32::MAX, 0), (7, 1)] {
        let wanted = changed(Outcome::zeroed(), |new| {
            new.entries_lo = low;
            new.entries_hi = high;
        });
        let call = KernelCall::new(gpu)
            .with("params", &[SearchParams { entry_capacity: capacity, ..SearchParams::zeroed() }])?
            .with("outcome", &[wanted])?
            .with("sort_counts", &[SortCounts::zeroed()])?;
        call.run(&k::ENTRIES_FINISH, Variant::default(), 1)?;
        let items = wanted.entries_needed().min(capacity.into()) as u32;
        let overflow = if wanted.entries_needed() > capacity.into() { Outcome::OVERFLOW_ENTRIES } else { 0 };
        let found = call.read_one::<Outcome>("outcome")?;
        let lengths = call.read_one::<SortCounts>("sort_counts")?;
        let case = || format!("{} entries, capacity {capacity}", wanted.entries_needed());
        same(case, &(lengths.items, found), &(items, changed(wanted, |new| new.overflow = overflow)))?;
        let tiles = lengths.counters / 256;
        same(case, &(lengths.counters % 256 == 0 && (tiles > 0) == (items > 0) && tiles <= items), &true)?;
    }
    Ok(())
}

/// The arguments suffice if one cell has all entries.
pub(crate) fn runs_search_far_dispatch_args(gpu: &GpuDevice) -> Result<(), KernelError> {
    let most = 65_535 * k::RUN_TILES;
    let blocks = [1, 5, 4096, 65_535, 65_536, most];
    let tiles = [1, k::RUN_TILES + 1, 65_535, 131_071, 196_606, 262_141, 1_000_003, most];
    for (blocks, tiles) in blocks.into_iter().flat_map(|blocks| tiles.map(|tiles| (blocks, tiles))) {
        for tiles_per_submission in [1 << 18, SearchParams::UNLIMITED] {
            let listed = changed(Outcome::zeroed(), |new| {
                new.deferred_blocks = blocks;
                new.deferred_max_tiles = tiles;
            });
            let call = KernelCall::new(gpu)
                .with("params", &[SearchParams { tiles_per_submission, ..SearchParams::zeroed() }])?
                .with("outcome", &[listed])?
                .with("dispatch", &[0_u32; 4])?;
            call.run(&k::RUNS_SEARCH_FAR_DISPATCH_ARGS, Variant::default(), 1)?;
            let outcome = call.read_one::<Outcome>("outcome")?;
            let [x, y, z] = call.read_one::<[u32; 3]>("dispatch")?;
            let taken = outcome.deferred_end.wrapping_sub(outcome.deferred_begin);
            let fits = match tiles_per_submission {
                SearchParams::UNLIMITED => taken == blocks && !outcome.has_remaining_work(),
                _ => taken == 1 || (2..=blocks.min(tiles_per_submission / tiles)).contains(&taken),
            };
            let counts = [x, y, z].iter().all(|groups| (1..=65_535).contains(groups));
            let is_covered = counts && y * z >= taken && tiles.div_ceil(x) <= k::RUN_TILES;
            let case = || {
                format!(
                    "{blocks} blocks of {tiles} tiles, {tiles_per_submission} per submission: {taken} dispatched as {x} {y} {z}"
                )
            };
            same(case, &(fits && is_covered), &true)?;
        }
    }
    Ok(())
}

pub(crate) fn naive_search(gpu: &GpuDevice) -> Result<(), KernelError> {
    for variant in variants(gpu) {
        more_than_a_word_of_pairs(gpu, variant)?;
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
            let call = naive_call(gpu, call, &scenario.spheres, Outcome::zeroed())?;
            call.run(&k::NAIVE_SEARCH, variant, 64)?;
            let found = call.read_one::<Outcome>("outcome")?.found();
            let case = |what: &str| format!("{what}, {size} at one point, {variant:?}");
            same(|| case("found"), &found, &(expected.len() as u64))?;
            let mut listed = call.read::<[u32; 2]>("pairs", capacity as usize + 1)?;
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

fn more_than_a_word_of_pairs(gpu: &GpuDevice, variant: Variant) -> Result<(), KernelError> {
    let spheres = vec![Sphere::new([1.0, 2.0, 3.0], 0.5); 600];
    let call = SearchParams {
        spheres: 600,
        pair_capacity: 16,
        search_groups: 64,
        window_end: u32::MAX,
        ..SearchParams::zeroed()
    };
    let before = changed(Outcome::zeroed(), |new| {
        new.found_lo = u32::MAX - 1000;
        new.found_hi = 2;
    });
    let call = naive_call(gpu, call, &spheres, before)?;
    call.run(&k::NAIVE_SEARCH, variant, 64)?;
    let found = call.read_one::<Outcome>("outcome")?.found();
    same(|| format!("found beyond 32 bits, {variant:?}"), &found, &(before.found() + 600 * 599 / 2))
}

/// The pair buffer has an extra row, which must stay unchanged.
fn naive_call<'a>(
    gpu: &'a GpuDevice,
    call: SearchParams,
    spheres: &[Sphere],
    before: Outcome,
) -> Result<KernelCall<'a>, KernelError> {
    let grid = Grid { spheres: call.spheres, ordinary: 1, ..Grid::zeroed() };
    Ok(KernelCall::new(gpu)
        .with("params", &[call])?
        .with_layout("grid", &grid)?
        .with("spheres", spheres)?
        .with("outcome", &[before])?
        .with("pairs", &vec![[u32::MAX; 2]; call.pair_capacity as usize + 1])?)
}

pub(crate) fn outcome_finish(gpu: &GpuDevice) -> Result<(), KernelError> {
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
        let call =
            SearchParams { pair_capacity: capacity, consumer_workgroup_size: 256, ..SearchParams::zeroed() };
        let outcome_before = changed(Outcome::zeroed(), |new| {
            new.found_lo = low;
            new.found_hi = high;
        });
        let call = KernelCall::new(gpu).with("params", &[call])?.with("outcome", &[outcome_before])?;
        call.run(&k::OUTCOME_FINISH, Variant::default(), 1)?;
        let found = call.read_one::<Outcome>("outcome")?;
        let overflow = if outcome_before.found() > capacity.into() { Outcome::OVERFLOW_PAIRS } else { 0 };
        let case = || format!("{} pairs, capacity {capacity}: {found:?}", outcome_before.found());
        same(case, &found.overflow, &overflow)?;
        let written = outcome_before.found().min(capacity.into());
        let groups = u64::from(found.dispatch_x) * u64::from(found.dispatch_y) * u64::from(found.dispatch_z);
        let enough = groups >= written.div_ceil(256) && groups < written.div_ceil(256) + 65_536;
        same(case, &(enough && found.dispatch_x <= 65_535 && found.dispatch_y >= 1), &true)?;
    }
    Ok(())
}
