use bytemuck::Zeroable;
use lazygrid::gpu::{GpuDevice, Outcome};
use lazygrid::{Pair, Sphere};
use lazygrid_kernels::kernel::{self as k, Variant};
use lazygrid_kernels::layout::{Grid, SearchParams, SortCounts};

use super::kernel_call::KernelCall;
use super::support::{KernelError, same};
use crate::Random;

const PAIR_CAPACITY: u32 = 1 << 21;
/// Distance in a run up to which the first search finds pairs.
const NEAR: u32 = 256;

struct Runs<'a> {
    call: KernelCall<'a>,
    groups: u32,
}

impl<'a> Runs<'a> {
    fn new(gpu: &'a GpuDevice, spheres: &[Sphere], keys: &[u32], passive: u32) -> Result<Self, KernelError> {
        let count = keys.len() as u32;
        let call = SearchParams {
            pair_capacity: PAIR_CAPACITY,
            window_end: u32::MAX,
            split_policy: passive,
            tiles_per_submission: SearchParams::UNLIMITED,
            ..SearchParams::zeroed()
        };
        let grid = Grid { spheres: count, passive, split_policy: 2 * passive, ..Grid::zeroed() };
        let objects: Vec<u32> = (0..count).map(|entry| entry | 7 << 29).collect();
        let call = KernelCall::new(gpu)
            .with("params", &[call])?
            .with_layout("grid", &grid)?
            .with("sort_counts", &[SortCounts { items: count, ..SortCounts::zeroed() }])?
            .with("keys", keys)?
            .with("objects", &objects)?
            .with("spheres", spheres)?
            .with("outcome", &[Outcome::zeroed()])?
            .with_zeros::<Pair>("pairs", PAIR_CAPACITY as usize)?
            .with_zeros::<u32>("deferred", keys.len().div_ceil(256))?
            .with_zeros::<u32>("dispatch", 4)?;
        Ok(Self { call, groups: count.div_ceil(256) })
    }

    fn search(&self) -> Result<(), KernelError> {
        Ok(self.call.run(&k::RUNS_SEARCH_NEAR, Variant::default(), self.groups)?)
    }

    fn search_far(&self, variant: Variant) -> Result<(), KernelError> {
        self.call.run(&k::RUNS_SEARCH_FAR_DISPATCH_ARGS, variant, 1)?;
        Ok(self.call.run_over(&k::RUNS_SEARCH_FAR, variant, self.call.read_one("dispatch")?)?)
    }

    fn pairs(&self) -> Result<Vec<Pair>, KernelError> {
        let found = self.call.read_one::<Outcome>("outcome")?.found();
        let mut pairs = self.call.read::<Pair>("pairs", found as usize)?;
        pairs.sort_unstable();
        Ok(pairs)
    }
}

pub(crate) fn runs_search_near(gpu: &GpuDevice) -> Result<(), KernelError> {
    for (actives, passives, passive) in
        [(0, 5, 1), (1, 0, 1), (1, 256, 1), (3, 200, 1), (257, 0, 0), (100, 157, 1)]
    {
        let run_length = actives + passives;
        let count = 5 * run_length;
        let key_of = |entry: u32| {
            ((entry / run_length) << passive) | (u32::from(entry % run_length >= actives) * passive)
        };
        let keys: Vec<u32> = (0..count).map(key_of).collect();
        let spheres = vec![Sphere::new([0.0; 3], 1.0); count as usize];
        let runs = Runs::new(gpu, &spheres, &keys, passive)?;
        runs.search()?;
        let expected = (0..count)
            .flat_map(|i| (i + 1..count).map(move |j| Pair { i, j }))
            .filter(|pair| pair.i / run_length == pair.j / run_length && pair.i % run_length < actives);
        let case = || format!("{actives} active, {passives} passive");
        same(case, &runs.pairs()?, &expected.collect())?;
    }
    Ok(())
}

pub(crate) fn runs_search_far(gpu: &GpuDevice) -> Result<(), KernelError> {
    for variant in super::support::variants(gpu) {
        for lengths in [&[257_u32][..], &[258, 3, 258], &[1, 900, 40, 600, 7], &[2300]] {
            let keys: Vec<u32> =
                (0..).zip(lengths).flat_map(|(run, &length)| (0..length).map(move |_| run)).collect();
            // Multiples of a quarter avoid rounding.
            let mut random = Random(keys.len() as u64);
            let mut coordinate = || random.below(16) as f32 / 4.0;
            let spheres: Vec<Sphere> =
                keys.iter().map(|_| Sphere::new([(); 3].map(|()| coordinate()), 0.5)).collect();
            let touch = |i: u32, j: u32| {
                let [a, b] = [i, j].map(|k| spheres[k as usize].center);
                keys[i as usize] == keys[j as usize] && a.distance_squared(b) <= 1.0
            };
            let count = keys.len() as u32;
            let expected: Vec<Pair> = (0..count)
                .flat_map(|i| (i + 1..count).filter(move |&j| touch(i, j)).map(move |j| Pair { i, j }))
                .collect();
            let runs = Runs::new(gpu, &spheres, &keys, 0)?;
            runs.search()?;
            let near = expected.iter().filter(|pair| pair.j - pair.i <= NEAR).copied().collect();
            let case = |what: &str| format!("{what}, runs of {lengths:?}, {variant:?}");
            same(|| case("near ones"), &runs.pairs()?, &near)?;
            runs.search_far(variant)?;
            same(|| case("all"), &runs.pairs()?, &expected)?;
        }
    }
    Ok(())
}
