use std::time::{Duration, Instant};

use lazygrid::gpu::{self, CallCost, GpuConfig, GpuDevice, GpuSession};
use lazygrid::{Algorithm, Backend, Config, Detector, Error, PhaseTime, Skin, Sphere, Spheres};

use lazygrid_io::lacking_memory;

use super::bandwidth::{median, warm_up};
use crate::catch_panic;
use crate::detectors::text;
use crate::device::TIMEOUT;

pub const SIZES: [usize; 4] = [10_000, 100_000, 1_000_000, 10_000_000];
/// Number of spheres that full checks time in addition.
pub const FULL: usize = 100_000_000;
/// Maximum number of timed rounds, after the warm-up.
const ROUNDS: usize = 5;
/// Seconds after which no further round starts.
const SECONDS: f64 = 0.5;

#[derive(Clone, Debug)]
pub struct Speed {
    pub pairs: u64,
    /// Median of a call, with upload and readback.
    pub seconds: f64,
    /// Seconds of GPU work by timestamps, or else of the whole call.
    pub busy: f64,
    pub stages: Vec<(&'static str, f64)>,
    pub rounds: usize,
    pub cost: Option<CallCost>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SkipReason {
    TooLarge(String),
    Failed(String),
}

pub fn on_gpu(gpu: &GpuDevice, algorithm: Algorithm, spheres: &[Sphere]) -> Result<Speed, SkipReason> {
    let mut is_too_large = false;
    let mut describe = |error: Error| {
        use Error::{DeviceOutOfMemory, LimitExceeded, OutOfMemory};
        is_too_large = matches!(error, LimitExceeded { .. } | OutOfMemory { .. } | DeviceOutOfMemory { .. });
        error.to_string()
    };
    let speed = catch_panic(|| {
        let settings = GpuConfig::default().algorithm(algorithm).timestamps(true);
        let mut session = GpuSession::new(gpu.clone(), settings).map_err(&mut describe)?;
        session.set_timeout(TIMEOUT);
        let timed = timed(warm_up(gpu), || {
            let ticket = session.begin(Spheres::from(spheres)).map_err(&mut describe)?;
            let pairs = session.finish_count(ticket).map_err(&mut describe)?;
            Ok((pairs, session.timings().to_vec()))
        })?;
        let is_stage = |name: &str| gpu::GpuPhase::ALL.iter().any(|phase| phase.name() == name);
        let stages: Vec<_> = timed.stages.iter().copied().filter(|(name, _)| is_stage(name)).collect();
        let busy = if stages.is_empty() { timed.seconds } else { stages.iter().map(|(_, s)| s).sum() };
        Ok(Speed { stages, busy, cost: session.cost(), ..timed })
    });
    speed.map_err(|what| if is_too_large { SkipReason::TooLarge(what) } else { SkipReason::Failed(what) })
}

pub fn on_cpu(algorithm: Algorithm, spheres: &[Sphere]) -> Result<Speed, SkipReason> {
    // Spheres at rest would never rebuild a candidate list.
    let config = Config::default().backend(Backend::Cpu).algorithm(algorithm).skin(Skin::Off);
    let mut detector = Detector::new(config).map_err(|error| SkipReason::Failed(error.to_string()))?;
    check_memory(detector.memory_for(spheres.len() as u64)).map_err(SkipReason::TooLarge)?;
    let speed = catch_panic(|| {
        timed(Duration::ZERO, || {
            let pairs = detector.count(spheres).map_err(text)?;
            Ok((pairs, detector.report().phases))
        })
    });
    speed.map_err(SkipReason::Failed)
}

pub fn check_memory(needed: u64) -> Result<(), String> {
    match lacking_memory(needed) {
        None => Ok(()),
        Some(free) => {
            Err(format!("{} MiB needed, {} MiB free ({})", needed >> 20, free.bytes >> 20, free.limit.name()))
        }
    }
}

fn timed(
    warm_up: Duration,
    mut call: impl FnMut() -> Result<(u64, Vec<PhaseTime>), String>,
) -> Result<Speed, String> {
    let begun = Instant::now();
    let (pairs, first) = call()?;
    let once = begun.elapsed().as_secs_f64();
    let same = |again: u64| match again == pairs {
        true => Ok(()),
        false => Err(format!("{pairs} pairs counted, then {again} for the same spheres")),
    };
    while once < SECONDS && begun.elapsed() < warm_up {
        same(call()?.0)?;
    }
    let begun = Instant::now();
    let (mut times, mut stages) = (vec![], Vec::new());
    let mut spent = 0.0;
    let is_fast = |spent| spent < SECONDS && once < SECONDS;
    // On hardware the first call may have compiled kernels.
    while times.len() < ROUNDS && (is_fast(spent) || (times.is_empty() && !warm_up.is_zero())) {
        let start = Instant::now();
        let (again, phases) = call()?;
        same(again)?;
        times.push(start.elapsed().as_secs_f64());
        stages.push(phases);
        spent = begun.elapsed().as_secs_f64();
    }
    if times.is_empty() {
        times.push(once);
        stages.push(first);
    }
    let names: Vec<&'static str> = stages[0].iter().map(|phase| phase.name).collect();
    let stage = |name: &'static str| {
        let all = stages.iter().flatten().filter(|phase| phase.name == name);
        (name, median(&all.map(|phase| phase.time.as_secs_f64()).collect::<Vec<_>>()))
    };
    let seconds = median(&times);
    Ok(Speed {
        pairs,
        seconds,
        busy: seconds,
        stages: names.into_iter().map(stage).collect(),
        rounds: times.len(),
        cost: None,
    })
}

/// Predicts seconds from the growth of the last step, at least linear (quadratic for `Naive`). Returns 0
/// without earlier times.
pub fn forecast(algorithm: Algorithm, before: &[(usize, f64)], spheres: usize) -> f64 {
    let Some(&(last, seconds)) = before.last() else { return 0.0 };
    let growth = (spheres as f64 / last as f64).ln();
    let least = if algorithm == Algorithm::Naive { 2.0 } else { 1.0 };
    let exponent = match before {
        [.., (first, earlier), _] if *earlier > 0.0 => {
            ((seconds / earlier).ln() / (last as f64 / *first as f64).ln()).max(least)
        }
        _ => least,
    };
    seconds * (exponent * growth).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn forecast_extrapolates_measured_times() {
        let near = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-9;
        assert_eq!(forecast(Algorithm::Naive, &[], 10), 0.0);
        assert!(near(forecast(Algorithm::Naive, &[(10, 1.0)], 100), 100.0));
        assert!(near(forecast(Algorithm::CellList, &[(10, 1.0)], 100), 10.0));
        assert!(near(forecast(Algorithm::CellList, &[(10, 1.0), (100, 20.0)], 1000), 400.0));
        assert!(near(forecast(Algorithm::CellList, &[(10, 1.0), (100, 2.0)], 1000), 20.0));
    }

    #[test]
    fn algorithms_agree_and_report_phases() {
        let spheres = lazygrid_io::scenes::Scene::FiveSizes.spheres(2000, 1);
        let [naive, list] = [Algorithm::Naive, Algorithm::CellList]
            .map(|algorithm| on_cpu(algorithm, &spheres).expect("counted"));
        assert_eq!(naive.pairs, list.pairs);
        assert!(list.stages.iter().any(|(name, _)| *name == "search"), "{list:?}");
        let mut answers = 0..;
        let changing = timed(Duration::ZERO, || Ok((answers.next().expect("endless"), vec![])));
        assert!(changing.is_err_and(|text| text.contains("0 pairs counted, then 1")));
    }
}
