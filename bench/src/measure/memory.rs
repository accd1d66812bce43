use std::error::Error;
use std::time::Instant;

use lazygrid::{Pair, Sphere};

use super::{ContenderFactory, Digest, PairFinder, Spread};
use lazygrid_io::scenes::Scene;

#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Sample {
    /// Nanoseconds per sphere of the first call, which allocates.
    pub first: f64,
    /// Median nanoseconds per sphere and step of later calls, or of the only one.
    pub nanos: f64,
    /// Peak bytes per sphere besides spheres and result; `None` if unknown.
    pub bytes: Option<f64>,
    pub pairs: u64,
    pub sum: Option<u64>,
}

/// Measures times, and the peak memory of this process.
pub fn sample(
    contender: &ContenderFactory,
    scene: Scene,
    n: usize,
    steps: u32,
    seed: u64,
) -> Result<Sample, Box<dyn Error>> {
    let mut spheres = scene.spheres(n, seed);
    let before = resident("VmRSS");
    let reset = std::fs::write("/proc/self/clear_refs", "5").is_ok();
    let mut search = (contender.make)()?;
    let timed = |search: &mut dyn PairFinder, spheres: &[Sphere]| -> Result<(f64, Digest), Box<dyn Error>> {
        search.prepare(spheres)?;
        let start = Instant::now();
        let answer = search.run(spheres)?;
        let nanos = start.elapsed().as_nanos() as f64 / n.max(1) as f64;
        Ok((nanos, Digest::from_found(&answer)))
    };
    let (first, mut found) = timed(&mut *search, &spheres)?;
    let mut most = found.pairs;
    let mut nanos = vec![];
    for step in 0..steps {
        Scene::advance(&mut spheres, seed, step);
        let (step, digest) = timed(&mut *search, &spheres)?;
        nanos.push(step);
        found = digest;
        most = most.max(found.pairs);
    }
    let peak = resident("VmHWM").filter(|_| reset);
    let result = if found.sum.is_some() { size_of::<Pair>() as f64 * most as f64 } else { 0.0 };
    let used = before.zip(peak).map(|(before, peak)| peak - before - result);
    Ok(Sample {
        first,
        nanos: if nanos.is_empty() { first } else { Spread::from_values(&nanos).median },
        bytes: used.map(|bytes| bytes / n.max(1) as f64),
        pairs: found.pairs,
        sum: found.sum,
    })
}

fn resident(name: &str) -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(':'))?;
    Some(line.split_whitespace().next()?.parse::<f64>().ok()? * 1024.0)
}
