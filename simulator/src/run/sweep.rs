use std::fs;
use std::io::Write;
use std::num::NonZeroU32;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use lazygrid_io::excerpt;

use crate::output::{self, DiskEstimate, Lock};
use crate::run::memory_estimate::{Sharing, check_largest_release};
use crate::run::replicas::{ReplicaResults, Replicas, SEEDS};
use crate::run::{Run, queue};
use crate::scenario::sweep::{Sweep, SweptKey, sweep_point_error};
use crate::{AnySimulation, Error};

const POINTS: &str = "points.csv";
const SCENARIO: &str = "scenario.toml";

/// Each point has a directory with its scenario and replicas.
#[derive(Clone, Debug)]
pub struct SweepRuns {
    pub keys: Vec<SweptKey>,
    pub values: Vec<Vec<String>>,
    pub points: Vec<Replicas>,
    pub directory: PathBuf,
    resume: bool,
}

impl SweepRuns {
    /// Calls `run` for the scenario of each point, which gets `count` replicas and a directory within that of the run.
    pub fn new(sweep: Sweep, run: impl Fn(&crate::scenario::Scenario) -> Run, count: NonZeroU32) -> Self {
        let (mut directory, mut resume) = (PathBuf::new(), false);
        let (mut values, mut points) = (Vec::new(), Vec::new());
        for (k, point) in sweep.points.into_iter().enumerate() {
            let mut run = run(&point.scenario);
            directory.clone_from(&run.directory);
            resume = run.resume;
            run.directory = directory_of(&directory, k);
            values.push(point.values);
            let mut replicas = Replicas { run, count };
            replicas.run.resume &= replicas.is_begun();
            points.push(replicas);
        }
        Self { keys: sweep.keys, values, points, directory, resume }
    }

    /// Does all replicas of all points, one per thread at once.
    ///
    /// Calls `watch` as [`Replicas::run`](super::replicas::Replicas::run), with the point. [`Run::resume`] may add
    /// replicas and values of the first key. Returns `None` if `is_cancelled` answers `true` while the seeds are
    /// written.
    ///
    /// # Errors
    /// [`Error::Write`] and [`Error::SweepPoint`], before the first step also for a lack of memory or disk.
    pub fn run(
        &self,
        is_cancelled: impl Fn() -> bool + Sync,
        watch: impl Fn(usize, u32, &AnySimulation) -> ControlFlow<()> + Sync,
    ) -> Result<Option<Vec<ReplicaResults>>, Error> {
        let named = |(k, error): (usize, Error)| sweep_point_error(&self.keys, &self.values[k], error);
        self.check_memory().map_err(named)?;
        let _lock = self.lock()?;
        self.check_disk().map_err(named)?;
        self.refuse_scenarios()?;
        self.write_points()?;
        let mut outdated = Vec::new();
        for (k, point) in self.points.iter().enumerate() {
            if point.prepare(&is_cancelled).map_err(|error| named((k, error)))?.is_none() {
                return Ok(None);
            }
            if point.is_outdated().map_err(|error| named((k, error)))? {
                outdated.push(&point.run.directory);
            }
            let (path, text) = (point.run.directory.join(SCENARIO), &point.run.scenario.text);
            // A resumed point keeps its scenario, because that of the sweep may be refused.
            if point.run.resume && point.checkpoint_count().map_err(|error| named((k, error)))? > 0 {
                continue;
            }
            output::write_atomically(&path, |out| out.write_all(text.as_bytes()))?;
        }
        let results = queue::run_all(&self.points, &watch).map_err(named)?;
        if !outdated.is_empty() {
            outdated.push(&self.directory);
        }
        outdated.into_iter().try_for_each(|directory| output::remove_report(directory))?;
        Ok(Some(results))
    }

    fn lock(&self) -> Result<Lock, Error> {
        if self.resume {
            self.check_points(&self.directory.join(POINTS))?;
            let lock = Lock::acquire(&self.directory)?;
            self.refuse_foreign()?;
            return Ok(lock);
        }
        output::prepare(&self.directory, self.overwrites())
    }

    pub fn overwrites(&self) -> bool {
        !self.resume && self.points.first().is_some_and(|point| point.run.overwrite)
    }

    fn refuse_foreign(&self) -> Result<(), Error> {
        let resumed = self.points.iter().enumerate().filter(|(_, point)| point.run.resume);
        for (k, point) in resumed {
            let refused = point.refuse_foreign();
            refused.map_err(|error| sweep_point_error(&self.keys, &self.values[k], error))?;
        }
        output::refuse_other_table(&self.directory, output::SWEEP, "point,")?;
        let Some(plots) = self.points.first().and_then(|point| point.run.report) else { return Ok(()) };
        let former = output::refuse_foreign_page(&self.directory)?;
        output::refuse_foreign_files(&self.directory, &former, plots, &[]).or_else(|error| {
            for point in &self.points {
                if !point.run.resume || point.is_outdated()? {
                    return Err(error);
                }
            }
            Ok(())
        })
    }

    /// Refuses scenarios in points that are not begun, which are of others.
    fn refuse_scenarios(&self) -> Result<(), Error> {
        let mut new = self.points.iter().filter(|point| !point.is_begun() && !point.run.overwrite);
        new.try_for_each(|point| output::refuse_file(&point.run.directory, SCENARIO))
    }

    /// Removes results of a former sweep, whose points could count as done.
    fn write_points(&self) -> Result<(), Error> {
        for point in self.points.iter().filter(|point| !point.run.resume) {
            point.check_table_fits_into(&self.directory)?;
        }
        if self.overwrites() {
            output::remove_results(&self.directory)?;
            for point in output::numbered(&self.directory, "point-")? {
                remove_point(&directory_of(&self.directory, point as usize))?;
            }
        }
        output::write_atomically(&self.directory.join(POINTS), |out| out.write_all(self.table().as_bytes()))
    }

    fn table(&self) -> String {
        let paths = self.keys.iter().map(|key| key.path.clone());
        let header = ["point".to_owned()].into_iter().chain(paths).collect::<Vec<_>>().join(",");
        let row = |(k, values): (usize, &Vec<String>)| format!("\n{k},{}", values.join(","));
        header + &self.values.iter().enumerate().map(row).collect::<String>() + "\n"
    }

    /// Refuses to resume other points; points may follow the table's.
    fn check_points(&self, path: &Path) -> Result<(), Error> {
        let before = fs::read_to_string(path);
        let before = before.map_err(|source| Error::Read { path: path.to_owned(), source })?;
        let now = self.table();
        if now.starts_with(&before) && before.ends_with('\n') {
            return Ok(());
        }
        let differs = before.lines().zip(now.lines()).find(|(before, now)| before != now);
        let message = match differs {
            Some((before, now)) => {
                let [before, now] = [before, now].map(|line| excerpt(line.as_bytes()));
                format!("it has '{before}' and the sweep has '{now}'")
            }
            None => format!(
                "it has {} points and the sweep has {}",
                before.lines().count() - 1,
                self.values.len()
            ),
        };
        let message = format!(
            "{message}; resume with the keys and values that it was begun with, after which the first key may have more \
             values, or start over with --overwrite"
        );
        Err(Error::Checkpoint { path: path.to_owned(), message })
    }

    fn check_memory(&self) -> Result<(), (usize, Error)> {
        let sharing = Sharing { runs: queue::at_once(&self.points), machines: 1 };
        let check = |(k, point): (usize, &Replicas)| {
            let scenario = &point.run.scenario;
            check_largest_release(&scenario.model, scenario.steps, sharing).map_err(|error| (k, error))
        };
        self.points.iter().enumerate().try_for_each(check)
    }

    fn check_disk(&self) -> Result<(), (usize, Error)> {
        let mut all = DiskEstimate { min_bytes: 0, max_bytes: 0, checkpoint: [0; 2] };
        for (k, point) in self.points.iter().enumerate().filter(|(_, point)| point.run.space_check) {
            let (run, at) = (&point.run, |error| (k, error));
            let begun_count = if run.resume { point.checkpoint_count().map_err(at)? } else { 0 };
            let new = point.count.get() - begun_count;
            if new == 0 {
                continue;
            }
            let (model, seed) = (&run.scenario.model, run.scenario.seed);
            let simulation = AnySimulation::begin(model, seed, lazygrid::Backend::Cpu, run.algorithm, None);
            let one = run.disk_estimate(&simulation.map_err(at)?).times(new);
            all = DiskEstimate {
                min_bytes: all.min_bytes.saturating_add(one.min_bytes),
                max_bytes: all.max_bytes.saturating_add(one.max_bytes),
                checkpoint: [0, 1].map(|k| all.checkpoint[k].saturating_add(one.checkpoint[k])),
            };
        }
        match self.points.first() {
            Some(first) if first.run.space_check => {
                let whole = Run { directory: self.directory.clone(), ..first.run.clone() };
                whole.check_fits(all).map_err(|error| (0, error))
            }
            _ => Ok(()),
        }
    }
}

/// Removes a point's results, and its scenario if a table of seeds exists.
fn remove_point(directory: &Path) -> Result<(), Error> {
    let scenario = directory.join(SCENARIO);
    if directory.join(SEEDS).is_file() && scenario.is_file() {
        fs::remove_file(&scenario).map_err(|source| Error::Write { path: scenario, source })?;
    }
    output::remove_replicas(directory)?;
    output::remove_results(directory)
}

fn directory_of(sweep: &Path, point: usize) -> PathBuf {
    sweep.join(format!("point-{point:04}"))
}
