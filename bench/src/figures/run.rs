use std::error::Error;
use std::fs;
use std::path::Path;
use std::time::{Duration, Instant, UNIX_EPOCH};

use rayon::ThreadPoolBuilder;
use serde::{Deserialize, Serialize};

use super::comparison::{Comparison, Limits};
use super::plan::{DataPoint, RunScale, SceneUpdate, Settings};
use super::row::{Results, Row};
use super::{Contender, Environment, Figure, burst, memory};
use crate::peers::lammps;
use lazygrid_io::scenes::Scene;
use lazygrid_io::write::AtomicFile;

/// Fraction of a point's time for measured runs; the rest is for spheres, references and warm-ups.
const MEASURED_FRACTION: f64 = 0.6;
/// An engine is left out if one run would take longer than both this multiple of its time at the point and
/// [`always_allowed_seconds`].
const MAX_TIME_FACTOR: f64 = 4.0;

/// Multiple of the time budget after which the remaining points, the largest, are left out.
const MAX_OVERRUN: f64 = 1.5;

#[derive(Clone, Debug)]
pub struct Progress {
    pub done: usize,
    pub points: usize,
    pub next: String,
    pub left: Duration,
}

#[derive(Serialize, Deserialize)]
struct CachedPoint {
    #[serde(rename = "mark")]
    fingerprint: String,
    seconds: f64,
    rows: Vec<Row>,
}

/// Runs all figures and stores each finished point in `folder`, to resume a run of the same settings and
/// build. `program` is `lazygrid-bench`, for memory measurements.
///
/// # Errors
/// Fails if the folder cannot be written or a reference fails. A wrong answer is a row with
/// [`Status::Error`](super::Status::Error).
pub fn run(
    settings: &Settings,
    folder: &Path,
    program: &Path,
    mut report: impl FnMut(&Progress),
) -> Result<Results, Box<dyn Error>> {
    let environment = Environment::here();
    let points = settings.points();
    let cache = folder.join("points");
    fs::create_dir_all(&cache).map_err(|e| format!("{}: cannot create: {e}", cache.display()))?;
    let fingerprint = Fingerprint::new(settings, &environment, program);
    let path_of = |point: &DataPoint| cache.join(format!("{}.json", point.key()));
    let cached: Vec<Option<CachedPoint>> =
        points.iter().map(|p| load(&path_of(p), &fingerprint.for_point(p))).collect();

    let mut budget = TimeBudget::new(settings, &points, &cached);
    let (mut rows, mut seconds, mut missing) = (vec![], 0.0, vec![]);
    for (done, (point, cached)) in points.iter().zip(cached).enumerate() {
        let next = format!("{}: {} {}", point.figure, point.n, point.name());
        report(&Progress { done, points: points.len(), next: next.clone(), left: budget.left() });
        let new = match cached {
            Some(cached) => cached,
            None if budget.is_over() => {
                missing.push(next);
                continue;
            }
            None => {
                let began = Instant::now();
                let rows = rows_of(point, settings, budget.time_limit(point), &rows, program)?;
                budget.spent(point);
                let new = CachedPoint {
                    fingerprint: fingerprint.for_point(point),
                    seconds: began.elapsed().as_secs_f64(),
                    rows,
                };
                save(&path_of(point), &new)?;
                new
            }
        };
        seconds += new.seconds;
        rows.extend(new.rows);
    }
    report(&Progress { done: points.len(), points: points.len(), next: String::new(), left: Duration::ZERO });
    let order = |row: &Row| Figure::ALL.iter().position(|figure| figure.name() == row.figure);
    rows.sort_by_key(order);
    Ok(Results { environment, settings: settings.clone(), seconds, missing, rows })
}

struct TimeBudget {
    end: Instant,
    latest: Instant,
    weight: f64,
}

impl TimeBudget {
    fn new(settings: &Settings, points: &[DataPoint], cached: &[Option<CachedPoint>]) -> Self {
        let all: f64 = points.iter().map(DataPoint::weight).sum();
        let left = points.iter().zip(cached).filter(|(_, cached)| cached.is_none());
        let weight: f64 = left.map(|(point, _)| point.weight()).sum();
        let seconds = settings.minutes * 60.0 * weight / all.max(f64::MIN_POSITIVE);
        let (now, time) = (Instant::now(), Duration::from_secs_f64(seconds.clamp(0.0, 1e7)));
        Self { end: now + time, latest: now + time.mul_f64(MAX_OVERRUN), weight }
    }

    fn is_over(&self) -> bool {
        Instant::now() >= self.latest
    }

    fn left(&self) -> Duration {
        self.end.saturating_duration_since(Instant::now())
    }

    fn time_limit(&self, point: &DataPoint) -> Duration {
        self.left().mul_f64((point.weight() / self.weight).clamp(0.0, 1.0))
    }

    fn spent(&mut self, point: &DataPoint) {
        self.weight = (self.weight - point.weight()).max(f64::MIN_POSITIVE);
    }
}

fn rows_of(
    point: &DataPoint,
    settings: &Settings,
    time_limit: Duration,
    earlier: &[Row],
    program: &Path,
) -> Result<Vec<Row>, Box<dyn Error>> {
    let at_least = if settings.scale == RunScale::Full { 3 } else { 2 };
    let time = time_limit.mul_f64(MEASURED_FRACTION / point.contenders.len().max(1) as f64);
    let limits = Limits { runs: point.runs, at_least: at_least.min(point.runs), time, in_all: time_limit };
    let too_long = |contender: Contender| {
        let seconds = predicted(contender, point, earlier)?;
        let most = (MAX_TIME_FACTOR * time.as_secs_f64()).max(always_allowed_seconds(contender, point.scene));
        (seconds > most && settings.scale != RunScale::Smoke)
            .then(|| format!("left out: a run would take about {seconds:.1} s"))
    };
    // Points with steps or a simulation have all engines.
    let left_out = |contender: Contender| match point.update {
        SceneUpdate::Steps { .. } | SceneUpdate::Simulated { .. } => None,
        _ => too_long(contender),
    };
    match point.update {
        SceneUpdate::Processes => memory::rows(point, program),
        SceneUpdate::Simulated { steps } => burst::rows(point, steps, limits, settings.seed, left_out),
        SceneUpdate::Fresh | SceneUpdate::Species(_) => {
            let sample = |k: usize, spheres: &mut Vec<_>| *spheres = point.sample(settings.seed + k as u64);
            run_comparison(Comparison::new(point, limits, left_out), 1, sample)
        }
        SceneUpdate::Steps { step_length } => {
            let sample = |k: usize, spheres: &mut Vec<_>| match k.checked_sub(1) {
                None => *spheres = point.scene.spheres(point.n, settings.seed),
                Some(step) => Scene::advance_by(step_length, spheres, settings.seed, step as u32),
            };
            // Trees with a margin enlarge boxes in the second frame.
            let single = || {
                run_comparison(Comparison::new(point, limits, left_out), 2, sample).map_err(|e| e.to_string())
            };
            match point.figure.is_single_threaded() {
                // A pool per detector would add a thread switch to each call.
                true => Ok(ThreadPoolBuilder::new().num_threads(1).build()?.install(single)?),
                false => Ok(single()?),
            }
        }
    }
}

fn run_comparison(
    mut comparison: Comparison<'_>,
    warm_ups: usize,
    mut change: impl FnMut(usize, &mut Vec<lazygrid::Sphere>),
) -> Result<Vec<Row>, Box<dyn Error>> {
    let mut spheres = vec![];
    let mut frame = 0;
    while !comparison.is_over() {
        change(frame, &mut spheres);
        comparison.frame(&spheres, frame < warm_ups)?;
        frame += 1;
    }
    Ok(comparison.take_rows(None))
}

/// Linear engines must appear at the largest size.
fn always_allowed_seconds(contender: Contender, scene: Scene) -> f64 {
    if is_quadratic(contender, scene) { 2.0 } else { 120.0 }
}

/// Every pair of spheres at one point touches.
fn is_quadratic(contender: Contender, scene: Scene) -> bool {
    contender.is_quadratic() || scene == Scene::Point
}

/// Uses the slowest row of the largest earlier point.
fn predicted(contender: Contender, point: &DataPoint, earlier: &[Row]) -> Option<f64> {
    let name = contender.to_string();
    let same = earlier.iter().filter(|row| {
        let same = row.figure == point.figure.name() && row.scene == point.kind();
        same && row.engine == name && !row.wall.is_empty()
    });
    let last = same.max_by(|a, b| a.n.cmp(&b.n).then(a.median().total_cmp(&b.median())))?;
    let exponent = if is_quadratic(contender, point.scene) { 2.0 } else { 1.1 };
    Some(last.median() * (point.n as f64 / last.n as f64).powf(exponent))
}

struct Fingerprint {
    common: String,
    /// The library of LAMMPS, and the search path of the libraries that it needs.
    lammps: String,
}

impl Fingerprint {
    fn new(settings: &Settings, environment: &Environment, program: &Path) -> Self {
        let Settings { scale, runs, minutes, seed, only: _, command: _ } = settings;
        let (commit, machine, graphics) =
            (&environment.commit, environment.machine(), environment.graphics());
        let built = file_version(program);
        let common = format!(
            "{scale:?}, {runs:?} runs, {minutes} min, seed {seed}, {commit}, {built}, {machine}, {graphics}"
        );
        let folders = std::env::var_os("LD_LIBRARY_PATH").unwrap_or_default();
        let lammps = lammps::library().map_or_else(
            || "no LAMMPS".to_owned(),
            |path| format!("{} of {}, {}", path.display(), file_version(&path), folders.display()),
        );
        Self { common, lammps }
    }

    fn for_point(&self, point: &DataPoint) -> String {
        let Self { common, lammps } = self;
        match point.contenders.contains(&Contender::Lammps) {
            true => format!("{common}, {lammps}"),
            false => common.clone(),
        }
    }
}

fn file_version(path: &Path) -> String {
    let version = fs::metadata(path).ok().and_then(|file| {
        let modified = file.modified().ok()?.duration_since(UNIX_EPOCH).ok()?;
        Some(format!("{} bytes, {}", file.len(), modified.as_millis()))
    });
    version.unwrap_or_default()
}

fn load(path: &Path, fingerprint: &str) -> Option<CachedPoint> {
    let cached: CachedPoint = serde_json::from_slice(&fs::read(path).ok()?).ok()?;
    (cached.fingerprint == fingerprint).then_some(cached)
}

fn save(path: &Path, cached: &CachedPoint) -> Result<(), Box<dyn Error>> {
    let bytes = serde_json::to_vec(cached)?;
    let mut file = AtomicFile::create(path)?;
    file.write_with(|out| out.write_all(&bytes))?;
    Ok(file.commit()?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn skipped_points_are_named() {
        let folder = tempfile::tempdir().expect("a folder");
        let only = vec![Figure::F3a];
        let command = String::new();
        let settings =
            Settings { scale: RunScale::Full, only, runs: Some(1), minutes: 0.0, seed: 1, command };
        let results = run(&settings, folder.path(), Path::new("lazygrid"), |_| ()).expect("nothing is run");
        assert!(results.rows.is_empty());
        assert_eq!(results.missing.len(), settings.points().len());
        assert_eq!(results.missing[0], "3a: 100 equal");
    }
}
