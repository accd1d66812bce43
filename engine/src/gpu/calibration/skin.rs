//! Measures the costs of keeping a candidate list on a device.

use std::time::Duration;

use lazygrid_host::TunerCosts;
use lazygrid_kernels::{Algorithm, Sphere};

use super::{CLEARLY, scene, time};
use crate::Error;
use crate::gpu::{GpuConfig, GpuDevice, GpuSession};

/// Spheres of the scenes, four times as many until a search takes long enough to be told from what it takes to submit one.
const SIZES: [u32; 4] = [1 << 14, 1 << 16, 1 << 18, 1 << 20];
/// So few that a call takes as long as submitting it.
const FEW: u32 = 256;
/// Rounds of which the fastest counts.
const ROUNDS: usize = 7;
/// The parts of space that spheres fill, overlaps counted twice: in the first they have no partners, in the second some.
const DENSITIES: [f32; 2] = [0.05, 1.0];
/// Skins, in radii: the first has hardly more candidates than there are pairs.
const SKINS: [f32; 2] = [0.05, 1.0];

/// The costs of calls with and without a candidate list, in nanoseconds; only ratios count. `Auto` chooses skins by them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkinCosts {
    /// For each sphere of a search, for any result.
    pub search: f32,
    /// For each pair or candidate that a search finds.
    pub find: f32,
    /// For each sphere, to keep where it was.
    pub keep: f32,
    /// For each sphere, to measure how far it has gone.
    pub measure: f32,
    /// To test a candidate.
    pub test: f32,
    /// For each call that keeps candidates, however many spheres there are: for its further dispatches.
    pub call: f32,
}

impl SkinCosts {
    /// Assumed of a GPU that was not measured: an estimate by the bytes that kernels move at 10¹² bytes a second, of which a
    /// search moves 210 for each sphere by its plan, and 100 more for each pair; a call has six more dispatches of 2 µs, and
    /// fourteen whose workgroups the device finds, of 3 µs more. No GPU has confirmed it.
    pub const HARDWARE: Self =
        Self { search: 0.21, find: 0.1, keep: 0.048, measure: 0.036, test: 0.04, call: 54_000.0 };
    /// Assumed of a software adapter that was not measured: what `lazygrid calibrate` says of Mesa's llvmpipe on two cores,
    /// rounded.
    pub const SOFTWARE: Self =
        Self { search: 900.0, find: 30.0, keep: 200.0, measure: 50.0, test: 15.0, call: 0.0 };

    /// From how many spheres on calls that candidates serve may cost less than a search; none where they never do.
    pub(crate) fn worth_from(&self) -> Option<u32> {
        let saved = self.search - self.measure;
        (saved > 0.0).then(|| (self.call / saved).ceil() as u32)
    }

    /// Returns `true` if each cost can have been measured.
    pub fn is_valid(&self) -> bool {
        let Self { search, find, keep, measure, test, call } = *self;
        let all = [find, keep, measure, test, call];
        search.is_finite() && search > 0.0 && all.iter().all(|cost| cost.is_finite() && *cost >= 0.0)
    }
}

impl From<SkinCosts> for TunerCosts {
    fn from(costs: SkinCosts) -> Self {
        let SkinCosts { search, find, keep, measure, test, call } = costs;
        Self { search, levels: 0.0, find, keep, measure, test, call }
    }
}

/// The fastest of some calls, and what one had.
#[derive(Clone, Copy, Debug)]
struct Call {
    nanoseconds: f64,
    /// Pairs per sphere, and candidates.
    pairs: f64,
    candidates: f64,
}

/// The calls that costs are worked out from.
#[derive(Clone, Copy, Debug)]
struct Calls {
    spheres: f64,
    /// Searches of few spheres, and such as candidates serve.
    few: [Call; 2],
    /// Searches at either density.
    searched: [Call; 2],
    /// Calls that candidates serve, with either skin.
    served: [Call; 2],
    /// A call that finds candidates, with the wider skin.
    found: Call,
}

/// Measures it.
pub(super) fn measure(own: &GpuDevice) -> Result<SkinCosts, Error> {
    measure_with(own, &SIZES)
}

/// Measures it with scenes of these sizes.
fn measure_with(own: &GpuDevice, sizes: &[u32]) -> Result<SkinCosts, Error> {
    let mut search = session(own, None)?;
    let few = scene(FEW, 1, DENSITIES[0]);
    let few_searched = fastest(&mut search, &few)?;
    let mut spheres = FEW;
    for &size in sizes {
        spheres = size;
        let taken = fastest(&mut search, &scene(size, 1, DENSITIES[0]))?;
        if few_searched.nanoseconds < taken.nanoseconds * (1.0 - CLEARLY) {
            break;
        }
    }
    let [sparse, dense] = DENSITIES.map(|density| scene(spheres, 1, density));
    let [mut narrow, mut wide] = [session(own, Some(SKINS[0]))?, session(own, Some(SKINS[1]))?];
    let few_served = fastest(&mut narrow, &few)?;
    let calls = Calls {
        spheres: spheres.into(),
        few: [few_searched, few_served],
        searched: [fastest(&mut search, &sparse)?, fastest(&mut search, &dense)?],
        served: [fastest(&mut narrow, &dense)?, fastest(&mut wide, &dense)?],
        found: found(&mut wide, dense)?,
    };
    log::debug!("{calls:?}");
    Ok(worked_out(&calls))
}

fn worked_out(calls: &Calls) -> SkinCosts {
    let Calls { spheres, few, searched, served, found } = calls;
    // The cost of a submission is not part of the cost per sphere.
    let each = |call: &Call, few: &Call| (call.nanoseconds - few.nanoseconds) / spheres;
    let slope = |[a, b]: &[Call; 2], of: fn(&Call) -> f64| {
        ((b.nanoseconds - a.nanoseconds) / spheres / (of(b) - of(a)).max(1e-3)).max(0.0)
    };
    let find = slope(searched, |call| call.pairs);
    let search = (each(&searched[0], &few[0]) - find * searched[0].pairs).max(1e-3);
    let test = slope(served, |call| call.candidates);
    let measure = (each(&served[0], &few[1]) - test * served[0].candidates).max(0.0);
    let besides = search + measure + (find + test) * found.candidates;
    let keep = (each(found, &few[1]) - besides).max(0.0);
    let call = (few[1].nanoseconds - few[0].nanoseconds).max(0.0);
    let [search, find, keep, measure, test, call] =
        [search, find, keep, measure, test, call].map(|cost| cost as f32);
    SkinCosts { search, find, keep, measure, test, call }
}

fn session(own: &GpuDevice, skin: Option<f32>) -> Result<GpuSession, Error> {
    let settings = GpuConfig::default().algorithm(Algorithm::CellList).timed(true);
    let mut session = GpuSession::new(own.clone(), settings)?;
    session.set_skin(skin)?;
    Ok(session)
}

/// Searches spheres that stand still, after a call that finds candidates where some are kept.
fn fastest(session: &mut GpuSession, spheres: &[Sphere]) -> Result<Call, Error> {
    time(session, spheres)?;
    let mut least = Duration::MAX;
    for _ in 0..ROUNDS {
        least = least.min(time(session, spheres)?);
    }
    Ok(call(session, spheres.len(), least))
}

/// Searches spheres one of which changes at every call, so that candidates are found anew.
fn found(session: &mut GpuSession, mut spheres: Vec<Sphere>) -> Result<Call, Error> {
    let mut least = Duration::MAX;
    for _ in 0..ROUNDS {
        spheres[0].radius *= 0.99;
        least = least.min(time(session, &spheres)?);
    }
    Ok(call(session, spheres.len(), least))
}

fn call(session: &GpuSession, spheres: usize, taken: Duration) -> Call {
    let each = |count: u64| count as f64 / spheres as f64;
    let candidates = session.kept().map_or(0, |kept| kept.count);
    Call {
        nanoseconds: taken.as_secs_f64() * 1e9,
        pairs: each(session.outcome().found()),
        candidates: each(candidates),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::adapter::device_or_skip;

    #[test]
    fn costs_are_those_that_calls_were_made_of() {
        let known = SkinCosts { search: 10.0, find: 3.0, keep: 2.0, measure: 1.0, test: 0.5, call: 700.0 };
        let (n, submitting) = (1000.0, 5000.0);
        let call = |each: f32, kept: bool, [pairs, candidates]: [f32; 2]| Call {
            nanoseconds: submitting + f64::from(each) * n + if kept { f64::from(known.call) } else { 0.0 },
            pairs: pairs.into(),
            candidates: candidates.into(),
        };
        let searched = |pairs: f32| call(known.search + known.find * pairs, false, [pairs, 0.0]);
        let served = |candidates: f32| call(known.measure + known.test * candidates, true, [0.5, candidates]);
        let new = known.measure + known.keep + known.search + (known.find + known.test) * 8.0;
        let calls = Calls {
            spheres: n,
            few: [call(0.0, false, [0.0; 2]), call(0.0, true, [0.0; 2])],
            searched: [searched(0.25), searched(3.0)],
            served: [served(4.0), served(8.0)],
            found: call(new, true, [3.0, 8.0]),
        };
        let found = worked_out(&calls);
        let parts = |costs: SkinCosts| {
            let SkinCosts { search, find, keep, measure, test, call } = costs;
            [search, find, keep, measure, test, call]
        };
        for (found, known) in parts(found).into_iter().zip(parts(known)) {
            assert!((found / known - 1.0).abs() < 1e-3, "{found} instead of {known}");
        }
        // 700 over what is saved for each sphere.
        assert_eq!(found.worth_from(), Some(78));
        assert_eq!(SkinCosts { measure: 10.0, ..known }.worth_from(), None);
    }

    /// However busy the machine, what comes out can be used.
    #[test]
    fn what_is_measured_is_valid() {
        let Some(own) = device_or_skip() else { return };
        let costs = measure_with(&own, &[1 << 11]).expect("measured");
        assert!(costs.is_valid(), "{costs:?}");
        let none = Call { nanoseconds: 0.0, pairs: 0.0, candidates: 0.0 };
        let [few, searched, served] = [[none; 2]; 3];
        let costs = worked_out(&Calls { spheres: 1.0, few, searched, served, found: none });
        assert!(costs.is_valid(), "{costs:?}");
    }

    #[test]
    fn only_numbers_that_can_be_costs_are_valid() {
        assert!(SkinCosts::HARDWARE.is_valid() && SkinCosts::SOFTWARE.is_valid());
        for bad in [f32::NAN, -1.0, f32::INFINITY] {
            assert!(!SkinCosts { test: bad, ..SkinCosts::SOFTWARE }.is_valid(), "{bad}");
            assert!(!SkinCosts { search: bad, ..SkinCosts::SOFTWARE }.is_valid(), "{bad}");
        }
        assert!(!SkinCosts { search: 0.0, ..SkinCosts::SOFTWARE }.is_valid());
    }
}
