//! How long every algorithm takes, stage by stage.

use std::time::Instant;

use lazygrid::gpu::{self, Cost, GpuDevice, GpuSession, GpuSettings};
use lazygrid::{Algorithm, Backend, Config, Detector, Error, Phase, Skin, Sphere, Spheres};

use crate::bandwidth::median;
use crate::device::PATIENCE;
use crate::guarded;
use crate::way::text;

/// Numbers of spheres that are timed.
pub const SIZES: [usize; 4] = [10_000, 100_000, 1_000_000, 10_000_000];
/// One more where there is time.
pub const FULL: usize = 100_000_000;
/// Rounds that count, at most, after one to warm up.
const ROUNDS: usize = 5;
/// No further round begins after so many seconds.
const SECONDS: f64 = 0.5;

/// How long the calls of one algorithm took.
#[derive(Clone, Debug)]
pub struct Speed {
    /// How many pairs were counted.
    pub pairs: u64,
    /// Seconds of a call, upload of spheres and readback of the count included: the median of the rounds.
    pub seconds: f64,
    /// Seconds that the GPU was busy, by its own clock where it has one; on the CPU those of the whole call.
    pub busy: f64,
    /// Seconds of each stage, in the order of the work: medians.
    pub stages: Vec<(&'static str, f64)>,
    /// How many rounds there were.
    pub rounds: usize,
    /// What a call cost the GPU by its plan; `None` on the CPU.
    pub cost: Option<Cost>,
}

/// Why there is no time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Untimed {
    /// So many spheres do not fit.
    TooLarge(String),
    /// Something is wrong.
    Failed(String),
}

/// Counts the pairs on the GPU, some times.
///
/// # Errors
/// Where the device cannot hold so many, or fails.
pub fn on_gpu(own: &GpuDevice, algorithm: Algorithm, spheres: &[Sphere]) -> Result<Speed, Untimed> {
    let mut is_too_large = false;
    let mut said = |error: Error| {
        use Error::{DeviceOutOfMemory, LimitExceeded, OutOfMemory};
        is_too_large = matches!(error, LimitExceeded { .. } | OutOfMemory { .. } | DeviceOutOfMemory { .. });
        error.to_string()
    };
    let speed = guarded(|| {
        let settings = GpuSettings { algorithm, timed: true, ..GpuSettings::default() };
        let mut session = GpuSession::new(own.clone(), settings).map_err(&mut said)?;
        session.set_timeout(PATIENCE);
        let timed = timed(|| {
            let ticket = session.begin(Spheres::from(spheres)).map_err(&mut said)?;
            let pairs = session.finish_count(ticket).map_err(&mut said)?;
            Ok((pairs, session.timings().to_vec()))
        })?;
        let is_stage = |name: &str| gpu::Phase::ALL.iter().any(|phase| phase.name() == name);
        let stages: Vec<_> = timed.stages.iter().copied().filter(|(name, _)| is_stage(name)).collect();
        let busy = if stages.is_empty() { timed.seconds } else { stages.iter().map(|(_, s)| s).sum() };
        Ok(Speed { stages, busy, cost: session.cost(), ..timed })
    });
    speed.map_err(|what| if is_too_large { Untimed::TooLarge(what) } else { Untimed::Failed(what) })
}

/// Counts the pairs on the CPU, some times.
///
/// # Errors
/// Where there is no memory for so many, or a call fails.
pub fn on_cpu(algorithm: Algorithm, spheres: &[Sphere]) -> Result<Speed, Untimed> {
    // The spheres stand still, so that candidates would be kept for ever.
    let config = Config::default().backend(Backend::Cpu).algorithm(algorithm).skin(Skin::Off);
    let mut detector = Detector::new(config).map_err(|error| Untimed::Failed(error.to_string()))?;
    let (needed, free) = (detector.memory_for(spheres.len() as u64), free_memory());
    if free.is_some_and(|free| needed > free) {
        let [needed, free] = [needed, free.unwrap_or(0)].map(|bytes| bytes >> 20);
        return Err(Untimed::TooLarge(format!("{needed} MiB are needed where {free} MiB are free")));
    }
    let speed = guarded(|| {
        timed(|| {
            let pairs = detector.count(spheres).map_err(text)?;
            Ok((pairs, detector.report().phases))
        })
    });
    speed.map_err(Untimed::Failed)
}

/// Bytes of memory that programs may take without pushing others out, where the system tells.
fn free_memory() -> Option<u64> {
    let told = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = told.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kibibytes << 10)
}

fn timed(mut call: impl FnMut() -> Result<(u64, Vec<Phase>), String>) -> Result<Speed, String> {
    let begun = Instant::now();
    let (pairs, first) = call()?;
    let once = begun.elapsed().as_secs_f64();
    let (mut times, mut stages) = (vec![], Vec::new());
    let mut spent = 0.0;
    while times.len() < ROUNDS && (spent < SECONDS && once < SECONDS) {
        let start = Instant::now();
        let (again, phases) = call()?;
        if again != pairs {
            return Err(format!("{pairs} pairs counted, and then {again} of the same spheres"));
        }
        times.push(start.elapsed().as_secs_f64());
        stages.push(phases);
        spent = begun.elapsed().as_secs_f64() - once;
    }
    if times.is_empty() {
        // One call has to do, warm or not.
        times.push(once);
        stages.push(first);
    }
    let names: Vec<&'static str> = stages[0].iter().map(|phase| phase.name).collect();
    let of = |name: &'static str| {
        let all = stages.iter().flatten().filter(|phase| phase.name == name);
        (name, median(&all.map(|phase| phase.time.as_secs_f64()).collect::<Vec<_>>()))
    };
    let seconds = median(&times);
    Ok(Speed {
        pairs,
        seconds,
        busy: seconds,
        stages: names.into_iter().map(of).collect(),
        rounds: times.len(),
        cost: None,
    })
}

/// How long a call of `spheres` takes that took `seconds` with fewer, given the sizes and times before: as the last step
/// went, and at least in proportion. With one time alone the square of the number is assumed for all pairs, and
/// proportion for the rest.
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
    fn forecasts_follow_what_was_seen() {
        let near = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-9;
        assert_eq!(forecast(Algorithm::Naive, &[], 10), 0.0);
        assert!(near(forecast(Algorithm::Naive, &[(10, 1.0)], 100), 100.0));
        assert!(near(forecast(Algorithm::CellList, &[(10, 1.0)], 100), 10.0));
        assert!(near(forecast(Algorithm::CellList, &[(10, 1.0), (100, 20.0)], 1000), 400.0));
        // What was dominated by a constant goes on in proportion at least.
        assert!(near(forecast(Algorithm::CellList, &[(10, 1.0), (100, 2.0)], 1000), 20.0));
    }

    #[test]
    fn counts_and_stages_of_a_call() {
        let spheres = lazygrid_io::scenes::Scene::FiveSizes.spheres(2000, 1);
        let [naive, list] = [Algorithm::Naive, Algorithm::CellList]
            .map(|algorithm| on_cpu(algorithm, &spheres).expect("counted"));
        assert_eq!(naive.pairs, list.pairs);
        assert!(list.stages.iter().any(|(name, _)| *name == "search"), "{list:?}");
        let mut answers = 0..;
        let changing = timed(|| Ok((answers.next().expect("endless"), vec![])));
        assert!(changing.is_err_and(|text| text.contains("0 pairs counted, and then 1")));
    }
}
