use bytemuck::Zeroable;
use lazygrid::gpu::{GpuDevice, Outcome, SkinState};
use lazygrid::{Pair, Space, Sphere};
use lazygrid_kernels::kernel::{self as k, Variant};
use lazygrid_kernels::layout::{SearchParams, SkinParams, SpeciesParams};

use super::kernel_call::KernelCall;
use super::support::{KernelError, SIZES, changed, same};
use crate::Random;
use crate::scenes::periodic;

/// A skin of 0.5, whose whole half is the displacement limit.
const SKIN: SkinParams = SkinParams { half_skin: 0.25, limit_squared: 0.0625, candidate_capacity: 1000 };

const SPACES: [[Option<f32>; 3]; 2] = [[None; 3], [Some(16.0), None, Some(8.0)]];

/// Multiples of an eighth avoid rounding.
fn spheres(count: usize, seed: u64) -> Vec<Sphere> {
    let mut random = Random(seed);
    let mut coordinate = |side: u32| random.below(8 * side) as f32 / 8.0 - side as f32 / 2.0;
    (0..count)
        .map(|k| {
            let center = [coordinate(16), coordinate(16), coordinate(8)];
            Sphere::new(center, if k % 50 == 49 { f32::NAN } else { 0.5_f32.powi(k as i32 % 3) })
        })
        .collect()
}

fn widened(sphere: &Sphere) -> [f32; 4] {
    let [x, y, z] = sphere.center.to_array();
    match sphere.is_valid() {
        true => [x, y, z, (sphere.radius + SKIN.half_skin) * (1.0 + 1.0 / (1 << 19) as f32)],
        false => [0.0, 0.0, 0.0, -1.0],
    }
}

fn call(spheres: usize, space: Space) -> (SearchParams, Variant) {
    let call = SearchParams {
        spheres: spheres as u32,
        pair_capacity: 1 << 16,
        window_end: u32::MAX,
        ..SearchParams::zeroed()
    };
    (call.in_space(space), Variant { periodic: space.is_periodic(), ..Variant::default() })
}

pub(crate) fn skin_displacement(gpu: &GpuDevice) -> Result<(), KernelError> {
    let sizes = SIZES.into_iter().flat_map(|size| SPACES.map(|lengths| (size, lengths)));
    for ((size, lengths), has_species) in sizes.flat_map(|case| [false, true].map(|species| (case, species)))
    {
        let is_idle = |k: usize| has_species && k.is_multiple_of(3);
        let space = periodic::space(lengths);
        let then = spheres(size, 1);
        let mut random = Random(2);
        let now: Vec<Sphere> = then
            .iter()
            .map(|sphere| {
                let step = [(); 3].map(|()| (random.below(5) as f32 - 2.0) / 8.0);
                Sphere::new(space.wrap(sphere.center + glam::Vec3::from(step)), sphere.radius)
            })
            .collect();
        let displacement = |k: usize| match then[k].is_valid() && !is_idle(k) {
            true => space.distance_squared(then[k].center, now[k].center) as f32,
            false => 0.0,
        };
        let farthest = (0..size).map(displacement).fold(0.0, f32::max);
        let other = |change: fn(&mut Sphere)| {
            let mut other = now.clone();
            other.last_mut().into_iter().for_each(change);
            other
        };
        let is_some = u32::from(size > 0);
        let matters = u32::from(size > 0 && (!is_idle(size - 1) || !then[size - 1].is_valid()));
        for (now, changed) in [
            (now.clone(), 0),
            (other(|sphere| sphere.radius = if sphere.is_valid() { f32::NAN } else { 1.0 }), is_some),
            (other(|sphere| sphere.radius = 0.75), matters),
        ] {
            let (call, variant) = call(size, space);
            let (call, variant) = (
                SearchParams { species: if has_species { 2 } else { 0 }, ..call },
                Variant { species: has_species, ..variant },
            );
            let species: Vec<u32> = (0..size).map(|k| u32::from(is_idle(k))).collect();
            let of_species = [0, SpeciesParams::IDLE].map(|flags| SpeciesParams { flags, half: 0.0 });
            let reference: Vec<[f32; 4]> = then.iter().map(widened).collect();
            let call = KernelCall::new(gpu)
                .with("params", &[call])?
                .with("skin", &[SKIN])?
                .with("count_source", &[size as u32])?
                .with("spheres", &now)?
                .with("reference", &reference)?
                .with("species", &species)?
                .with("reference_species", &species)?
                .with("species_params", &of_species)?
                .with("state", &[SkinState::zeroed()])?;
            call.run(&k::SKIN_DISPLACEMENT, variant, size.div_ceil(256) as u32)?;
            let found = call.read_one::<SkinState>("state")?;
            let case = || format!("{size} spheres in {lengths:?}, species {has_species}");
            same(case, &found.input_changed, &changed)?;
            if changed == 0 {
                same(case, &f32::from_bits(found.displacement), &farthest)?;
            }
        }
    }
    Ok(())
}

pub(crate) fn skin_check(gpu: &GpuDevice) -> Result<(), KernelError> {
    let unchanged = changed(SkinState::zeroed(), |new| {
        new.is_complete = 1;
        new.spheres = 10;
        new.age = 4;
        new.displacement = SKIN.limit_squared.to_bits();
    });
    let cases = [
        (unchanged, 0),
        (SkinState::zeroed(), SkinState::NO_LIST),
        (changed(unchanged, |new| new.spheres = 9), SkinState::INPUT_CHANGED),
        (changed(unchanged, |new| new.input_changed = 1), SkinState::INPUT_CHANGED),
        (
            changed(unchanged, |new| new.displacement = SKIN.limit_squared.next_up().to_bits()),
            SkinState::DISPLACEMENT,
        ),
        (changed(unchanged, |new| new.displacement = f32::NAN.to_bits()), SkinState::DISPLACEMENT),
    ];
    for (state, rebuilt) in cases {
        let is_rebuilt = rebuilt != 0;
        for steps in [1, 20, 70] {
            let full: Vec<u32> = (1..=3 * steps).collect();
            let call = KernelCall::new(gpu)
                .with("params", &[call(12, Space::UNBOUNDED).0])?
                .with("skin", &[SKIN])?
                .with("count_source", &[10_u32])?
                .with("state", &[state])?
                .with("full_counts", &full)?
                .with("dispatch_counts", &vec![7_u32; 3 * steps as usize])?
                .with("dispatch", &[7_u32; 4])?;
            call.run(&k::SKIN_CHECK, Variant::default(), 1)?;
            let case = || format!("{state:?}, {steps} dispatches");
            let expected = changed(state, |new| {
                new.displacement = 0;
                new.input_changed = 0;
                new.spheres = 10;
                new.rebuild_reason = rebuilt;
                new.age = if is_rebuilt { 0 } else { state.age + 1 };
                new.last_displacement = state.displacement;
                new.is_complete = u32::from(!is_rebuilt);
            });
            same(case, &call.read_one::<SkinState>("state")?, &expected)?;
            let gated = if is_rebuilt { full } else { vec![0; 3 * steps as usize] };
            same(case, &call.read::<u32>("dispatch_counts", 3 * steps as usize)?, &gated)?;
            let further = if is_rebuilt { [7; 3] } else { [0; 3] };
            same(case, &call.read_one::<[u32; 3]>("dispatch")?, &further)?;
        }
    }
    Ok(())
}

pub(crate) fn skin_store_reference(gpu: &GpuDevice) -> Result<(), KernelError> {
    for (size, rebuilt) in
        SIZES.into_iter().flat_map(|size| [0, SkinState::DISPLACEMENT].map(|rebuilt| (size, rebuilt)))
    {
        let current = spheres(size, 3);
        let state = changed(SkinState::zeroed(), |new| {
            new.spheres = size as u32;
            new.rebuild_reason = rebuilt;
        });
        let before = vec![[7.0_f32; 4]; size];
        let (call, variant) = call(size, Space::UNBOUNDED);
        let call = KernelCall::new(gpu)
            .with("params", &[call])?
            .with("skin", &[SKIN])?
            .with("spheres", &current)?
            .with("state", &[state])?
            .with("reference", &before)?;
        call.run(&k::SKIN_STORE_REFERENCE, variant, size.div_ceil(256) as u32)?;
        let expected = if rebuilt != 0 { current.iter().map(widened).collect() } else { before };
        let case = || format!("{size} spheres, rebuilt {rebuilt}");
        same(case, &call.read::<[f32; 4]>("reference", size)?, &expected)?;
    }
    Ok(())
}

pub(crate) fn candidates_test_dispatch_args(gpu: &GpuDevice) -> Result<(), KernelError> {
    let most = 40_000_000;
    let entries = Outcome::OVERFLOW_ENTRIES;
    for (low, high, overflow, count) in [
        (0, 0, 0, 10),
        (1000, 0, 0, 10),
        (most, 0, 0, 10),
        (most + 1, 0, Outcome::OVERFLOW_PAIRS, 10),
        (5, 1, Outcome::OVERFLOW_PAIRS, 10),
        (7, 0, entries, 10),
        (7, 0, Outcome::OVERFLOW_SPHERES, 13),
    ] {
        let of_search = changed(Outcome::zeroed(), |new| {
            new.found_lo = low;
            new.found_hi = high;
            new.overflow = overflow;
            new.quarantined = 3;
        });
        let call = KernelCall::new(gpu)
            .with("params", &[call(12, Space::UNBOUNDED).0])?
            .with("skin", &[SkinParams { candidate_capacity: most, ..SKIN }])?
            .with("count_source", &[count])?
            .with("found", &[of_search])?
            .with("state", &[SkinState::zeroed()])?
            .with("outcome", &[Outcome::zeroed()])?
            .with("dispatch", &[0_u32; 4])?;
        call.run(&k::CANDIDATES_TEST_DISPATCH_ARGS, Variant::default(), 1)?;
        let full = of_search.found() > most.into();
        let lost = (overflow & entries) | if full { Outcome::OVERFLOW_CANDIDATES } else { 0 };
        let more = if count > 12 { Outcome::OVERFLOW_SPHERES } else { 0 };
        let expected = changed(Outcome::zeroed(), |new| {
            new.overflow = lost | more;
            new.quarantined = 3;
            new.entries_lo = low;
            new.entries_hi = high;
            new.spheres = count;
        });
        let case = || format!("{of_search:?}, {count} spheres");
        same(case, &call.read_one::<Outcome>("outcome")?, &expected)?;
        let written = if full { most } else { low };
        let state = call.read_one::<SkinState>("state")?;
        same(case, &(state.is_complete, state.candidates), &(u32::from(lost == 0), written))?;
        let [x, y, z] = call.read_one::<[u32; 3]>("dispatch")?;
        let enough = x <= 65_535 && x * y >= written.div_ceil(256) && x * y < written.div_ceil(256) + 65_536;
        same(case, &(enough && y > 0 && z == 1), &true)?;
    }
    Ok(())
}

pub(crate) fn candidates_test(gpu: &GpuDevice) -> Result<(), KernelError> {
    for (lengths, (window, capacity)) in SPACES.into_iter().flat_map(|lengths| {
        [(0..u32::MAX, 1 << 16), (100..200, 1 << 16), (0..u32::MAX, 50)].map(|limits| (lengths, limits))
    }) {
        let space = periodic::space(lengths);
        let current: Vec<Sphere> = spheres(400, 5).into_iter().filter(Sphere::is_valid).collect();
        let all = 0..current.len() as u32;
        let candidates: Vec<Pair> =
            all.clone().flat_map(|i| (i + 1..all.end).map(move |j| Pair { i, j })).collect();
        let touch = |pair: &Pair| {
            let [a, b] = [pair.i, pair.j].map(|id| &current[id as usize]);
            let cutoff = f64::from(a.radius + b.radius);
            window.contains(&pair.i) && space.distance_squared(a.center, b.center) <= cutoff * cutoff
        };
        let expected: Vec<Pair> = candidates.iter().copied().filter(touch).collect();
        let (call, variant) = call(current.len(), space);
        let call = SearchParams {
            pair_capacity: capacity,
            window_begin: window.start,
            window_end: window.end,
            ..call
        };
        let state = changed(SkinState::zeroed(), |new| new.candidates = candidates.len() as u32);
        let groups = (candidates.len() as u32).div_ceil(256);
        let call = KernelCall::new(gpu)
            .with("params", &[call])?
            .with("candidates", &candidates)?
            .with("state", &[state])?
            .with("spheres", &current)?
            .with("outcome", &[Outcome::zeroed()])?
            .with_zeros::<Pair>("pairs", capacity as usize)?;
        call.run_over(&k::CANDIDATES_TEST, variant, [groups.div_ceil(2) + 1, 2, 1])?;
        let found = call.read_one::<Outcome>("outcome")?.found();
        let case = || format!("{lengths:?}, {window:?}, capacity {capacity}");
        same(case, &found, &(expected.len() as u64))?;
        let mut listed = call.read::<Pair>("pairs", capacity.min(found as u32) as usize)?;
        listed.sort_unstable();
        let is_full = expected.len() > capacity as usize;
        let distinct = listed.windows(2).all(|two| two[0] < two[1])
            && listed.iter().all(|pair| expected.binary_search(pair).is_ok());
        same(case, &(listed == expected || (is_full && distinct)), &true)?;
    }
    Ok(())
}
