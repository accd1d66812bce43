use std::time::Duration;

use lazygrid_host::SkinCosts;
use lazygrid_kernels::{Algorithm, Sphere};

use super::measure::{CLEAR_TIME_RATIO, rounds_up_to, scene, time};
use crate::Error;
use crate::gpu::config::GpuConfig;
use crate::gpu::device::GpuDevice;
use crate::gpu::session::GpuSession;

const SIZES: [u32; 4] = [1 << 14, 1 << 16, 1 << 18, 1 << 20];
const SMALL_SCENE: u32 = 256;
const ROUNDS: usize = 7;
/// Filled fractions of space: almost no overlaps, and some.
const DENSITIES: [f32; 2] = [0.05, 1.0];
/// Skins in radii; the first has hardly more candidates than pairs.
const SKINS: [f32; 2] = [0.05, 1.0];

#[derive(Clone, Copy, Debug)]
struct TimedCall {
    nanoseconds: f64,
    /// Per sphere.
    pairs: f64,
    /// Per sphere.
    candidates: f64,
}

#[derive(Clone, Copy, Debug)]
struct Calls {
    spheres: f64,
    /// Calls without and with a list.
    few: [TimedCall; 2],
    /// Searches per density.
    searched: [TimedCall; 2],
    /// Calls answered from a list, per skin.
    served: [TimedCall; 2],
    /// A rebuild with the wider skin.
    found: TimedCall,
}

pub(super) fn measure(gpu: &GpuDevice) -> Result<SkinCosts, Error> {
    measure_with(gpu, &SIZES)
}

fn measure_with(gpu: &GpuDevice, sizes: &[u32]) -> Result<SkinCosts, Error> {
    let mut search = session(gpu, None)?;
    let few = scene(SMALL_SCENE, 1, DENSITIES[0]);
    let few_searched = fastest(&mut search, &few)?;
    let mut spheres = SMALL_SCENE;
    for &size in sizes {
        spheres = size;
        let taken = fastest(&mut search, &scene(size, 1, DENSITIES[0]))?;
        if few_searched.nanoseconds < taken.nanoseconds * (1.0 - CLEAR_TIME_RATIO) {
            break;
        }
    }
    let [sparse, dense] = DENSITIES.map(|density| scene(spheres, 1, density));
    let [mut narrow, mut wide] = [session(gpu, Some(SKINS[0]))?, session(gpu, Some(SKINS[1]))?];
    let few_served = fastest(&mut narrow, &few)?;
    let calls = Calls {
        spheres: spheres.into(),
        few: [few_searched, few_served],
        searched: [fastest(&mut search, &sparse)?, fastest(&mut search, &dense)?],
        served: [fastest(&mut narrow, &dense)?, fastest(&mut wide, &dense)?],
        found: found(&mut wide, dense)?,
    };
    log::debug!("{calls:?}");
    Ok(costs_from(&calls))
}

fn costs_from(calls: &Calls) -> SkinCosts {
    let Calls { spheres, few, searched, served, found } = calls;
    let each = |call: &TimedCall, few: &TimedCall| (call.nanoseconds - few.nanoseconds) / spheres;
    let slope = |[a, b]: &[TimedCall; 2], amount: fn(&TimedCall) -> f64| {
        ((b.nanoseconds - a.nanoseconds) / spheres / (amount(b) - amount(a)).max(1e-3)).max(0.0)
    };
    let find = slope(searched, |call| call.pairs);
    let search = (each(&searched[0], &few[0]) - find * searched[0].pairs).max(1e-3);
    let test = slope(served, |call| call.candidates);
    let measure = (each(&served[0], &few[1]) - test * served[0].candidates).max(0.0);
    let other_costs = search + measure + (find + test) * found.candidates;
    let keep = (each(found, &few[1]) - other_costs).max(0.0);
    let call = (few[1].nanoseconds - few[0].nanoseconds).max(0.0);
    let [search, find, keep, measure, test, call] =
        [search, find, keep, measure, test, call].map(|cost| cost as f32);
    SkinCosts {
        search_ns: search,
        levels_ns: 0.0,
        find_ns: find,
        keep_ns: keep,
        measure_ns: measure,
        test_ns: test,
        call_ns: call,
    }
}

fn session(gpu: &GpuDevice, skin: Option<f32>) -> Result<GpuSession, Error> {
    let settings = GpuConfig::default().algorithm(Algorithm::CellList).timestamps(true);
    let mut session = GpuSession::new(gpu.clone(), settings)?;
    session.set_skin(skin)?;
    Ok(session)
}

fn fastest(session: &mut GpuSession, spheres: &[Sphere]) -> Result<TimedCall, Error> {
    time(session, spheres)?;
    let mut least = Duration::MAX;
    for _ in rounds_up_to(ROUNDS) {
        least = least.min(time(session, spheres)?);
    }
    Ok(call(session, spheres.len(), least))
}

fn found(session: &mut GpuSession, mut spheres: Vec<Sphere>) -> Result<TimedCall, Error> {
    let mut least = Duration::MAX;
    for _ in rounds_up_to(ROUNDS) {
        spheres[0].radius *= 0.99;
        least = least.min(time(session, &spheres)?);
    }
    Ok(call(session, spheres.len(), least))
}

fn call(session: &GpuSession, spheres: usize, taken: Duration) -> TimedCall {
    let each = |count: u64| count as f64 / spheres as f64;
    let candidates = session.candidate_list_stats().map_or(0, |stats| stats.count);
    TimedCall {
        nanoseconds: taken.as_secs_f64() * 1e9,
        pairs: each(session.outcome().found()),
        candidates: each(candidates),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::device::device_or_skip;

    #[test]
    fn known_costs_are_recovered_from_their_calls() {
        let known = SkinCosts {
            search_ns: 10.0,
            levels_ns: 0.0,
            find_ns: 3.0,
            keep_ns: 2.0,
            measure_ns: 1.0,
            test_ns: 0.5,
            call_ns: 700.0,
        };
        let (n, submitting) = (1000.0, 5000.0);
        let call = |each: f32, has_list: bool, [pairs, candidates]: [f32; 2]| TimedCall {
            nanoseconds: submitting
                + f64::from(each) * n
                + if has_list { f64::from(known.call_ns) } else { 0.0 },
            pairs: pairs.into(),
            candidates: candidates.into(),
        };
        let searched = |pairs: f32| call(known.search_ns + known.find_ns * pairs, false, [pairs, 0.0]);
        let served =
            |candidates: f32| call(known.measure_ns + known.test_ns * candidates, true, [0.5, candidates]);
        let new = known.measure_ns + known.keep_ns + known.search_ns + (known.find_ns + known.test_ns) * 8.0;
        let calls = Calls {
            spheres: n,
            few: [call(0.0, false, [0.0; 2]), call(0.0, true, [0.0; 2])],
            searched: [searched(0.25), searched(3.0)],
            served: [served(4.0), served(8.0)],
            found: call(new, true, [3.0, 8.0]),
        };
        let found = costs_from(&calls);
        let per_sphere = |costs: SkinCosts| {
            let SkinCosts { search_ns, find_ns, keep_ns, measure_ns, test_ns, call_ns, .. } = costs;
            [search_ns, find_ns, keep_ns, measure_ns, test_ns, call_ns]
        };
        for (found, known) in per_sphere(found).into_iter().zip(per_sphere(known)) {
            assert!((found / known - 1.0).abs() < 1e-3, "{found} instead of {known}");
        }
        assert_eq!(found.min_worthwhile_spheres(), Some(78));
        assert_eq!(SkinCosts { measure_ns: 10.0, ..known }.min_worthwhile_spheres(), None);
    }

    #[test]
    fn measured_costs_are_valid() {
        let Some(gpu) = device_or_skip() else { return };
        let costs = measure_with(&gpu, &[1 << 11]).expect("measured");
        assert!(costs.is_valid(), "{costs:?}");
        let none = TimedCall { nanoseconds: 0.0, pairs: 0.0, candidates: 0.0 };
        let [few, searched, served] = [[none; 2]; 3];
        let costs = costs_from(&Calls { spheres: 1.0, few, searched, served, found: none });
        assert!(costs.is_valid(), "{costs:?}");
    }
}
