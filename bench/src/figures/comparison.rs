use std::error::Error;
use std::hint::black_box;
use std::time::{Duration, Instant};

use lazygrid::{PhaseTime, Sphere};
use thiserror::Error;

use super::plan::DataPoint;
use super::row::{Row, Status};
use super::verify::Reference;
use super::{Contender, Figure};
use crate::measure::{ContenderFactory, Digest, Found, PairFinder, Spread, random_order};

/// Factor of the time that an engine may use to reach `at_least` runs.
const MAX_OVERTIME_FACTOR: u32 = 3;

/// Warm-up time per engine if numbers of threads are compared: threads that were just woken may share a core for
/// milliseconds.
const WARM_UP: Duration = Duration::from_millis(40);

#[derive(Clone, Copy, Debug, Error)]
#[error("{0}")]
pub(super) struct Unavailable(&'static str);

impl Unavailable {
    #[cfg(not(feature = "bullet"))]
    pub(super) const BULLET: Self = Self("not built in; build with --features bullet");
    pub(super) const SPECIES: Self = Self("searches all spheres alike");
    pub(super) const LAMMPS: Self = Self("set LAZYGRID_LAMMPS_LIB to the path of liblammps.so");

    pub(super) fn factory(self, name: String) -> ContenderFactory {
        ContenderFactory::new(name, move || Err::<NoFinder, _>(self.into()))
    }
}

enum NoFinder {}

impl PairFinder for NoFinder {
    fn run(&mut self, _: &[Sphere]) -> Result<Found<'_>, Box<dyn Error>> {
        match *self {}
    }
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    pub(super) runs: usize,
    pub(super) at_least: usize,
    /// Limit of the total time of an engine's own runs. With fewer than `at_least` runs, it is
    /// [`MAX_OVERTIME_FACTOR`] times as long.
    pub(super) time: Duration,
    /// Limit of the time of all engines, with the work between runs. Later only engines with fewer than
    /// `at_least` runs start another.
    pub(super) in_all: Duration,
}

pub(super) struct Comparison<'a> {
    point: &'a DataPoint,
    limits: Limits,
    runs: Vec<ContenderRun>,
    frames: usize,
    began: Option<Instant>,
}

struct ContenderRun {
    contender: Contender,
    search: Option<Box<dyn PairFinder>>,
    phases: Vec<Vec<PhaseTime>>,
    used: Duration,
    last: Option<Digest>,
    has_worked: bool,
    row: Row,
}

impl<'a> Comparison<'a> {
    pub(super) fn new(
        point: &'a DataPoint,
        limits: Limits,
        left_out: impl Fn(Contender) -> Option<String>,
    ) -> Self {
        let run = |&contender: &Contender| {
            let mut run = ContenderRun::new(point, contender);
            match left_out(contender) {
                Some(reason) => run.exclude(Status::LeftOut, reason),
                None => match (point.factory(contender).make)() {
                    Ok(search) => run.search = Some(search),
                    Err(error) => run.fail(error.as_ref()),
                },
            }
            run
        };
        Self { point, limits, runs: point.contenders.iter().map(run).collect(), frames: 0, began: None }
    }

    pub(super) fn is_over(&self) -> bool {
        self.runs.iter().all(|run| run.is_done(self.limits, self.is_late()))
    }

    fn is_late(&self) -> bool {
        self.began.is_some_and(|began| began.elapsed() >= self.limits.in_all)
    }

    pub(super) fn frame(&mut self, spheres: &[Sphere], warm_up: bool) -> Result<(), Box<dyn Error>> {
        if !warm_up {
            self.began.get_or_insert_with(Instant::now);
        }
        let (runs, limits, is_late) = (self.runs.len(), self.limits, self.is_late());
        for index in random_order(runs, self.frames as u64) {
            let run = &mut self.runs[index];
            run.last = None;
            if warm_up || !run.is_done(limits, is_late) {
                run.wake(self.point, spheres);
                run.run(spheres, warm_up);
            }
        }
        self.frames += 1;
        if self.runs.iter().any(|run| run.last.is_some()) {
            let reference = Reference::new(spheres, self.point.species())?;
            self.runs.iter_mut().for_each(|run| run.verify(&reference, spheres));
        }
        Ok(())
    }

    pub(super) fn take_rows(&mut self, at: Option<f64>) -> Vec<Row> {
        let point = self.point;
        self.began = None;
        self.runs.iter_mut().map(|run| run.take_row(point, at)).collect()
    }
}

impl ContenderRun {
    fn new(point: &DataPoint, contender: Contender) -> Self {
        let row = Row::new(point, contender);
        Self {
            contender,
            search: None,
            phases: vec![],
            used: Duration::ZERO,
            last: None,
            has_worked: false,
            row,
        }
    }

    fn is_done(&self, limits: Limits, is_late: bool) -> bool {
        let runs = self.row.wall.len();
        let enough = runs >= limits.at_least || self.used >= MAX_OVERTIME_FACTOR * limits.time;
        let out_of_time = runs > 0 && enough && (is_late || self.used >= limits.time);
        self.search.is_none() || runs >= limits.runs || out_of_time
    }

    fn wake(&mut self, point: &DataPoint, spheres: &[Sphere]) {
        let Some(search) = self.search.as_mut().filter(|_| point.figure == Figure::Threads) else { return };
        let begun = Instant::now();
        while begun.elapsed() < WARM_UP {
            let _ = search.run(black_box(spheres)).map(black_box);
        }
    }

    fn run(&mut self, spheres: &[Sphere], warm_up: bool) {
        let Some(search) = &mut self.search else { return };
        let prepared = search.prepare(spheres);
        let start = Instant::now();
        let found = prepared.and_then(|()| search.run(black_box(spheres))).map(black_box);
        let time = start.elapsed();
        let digest = match found {
            Ok(found) => Digest::from_found(&found),
            Err(error) => return self.fail(error.as_ref()),
        };
        self.last = Some(digest);
        self.has_worked = true;
        self.row.pairs = digest.pairs;
        if warm_up {
            return;
        }
        self.used += time;
        self.row.wall.push(time.as_secs_f64());
        self.row.gpu.extend(search.gpu_time().map(|t| t.as_secs_f64()));
        self.phases.push(search.phases());
    }

    fn verify(&mut self, reference: &Reference, spheres: &[Sphere]) {
        let Some(found) = self.last else { return };
        let verdict = match (reference.check(found), &mut self.search) {
            // GPUs may round differently.
            (Err(reason), Some(search)) if self.contender.rounds_freely() => match search.run(spheres) {
                Ok(again) if Digest::from_found(&again) != found => {
                    Err("a repeated search gave a different answer".to_owned())
                }
                Ok(Found::Pairs(pairs)) => reference.tangent(pairs),
                Ok(Found::Count(_)) => Err(reason),
                Err(error) => Err(error.to_string()),
            },
            (verdict, _) => verdict.map(|()| 0),
        };
        match verdict {
            Ok(tangent) => self.row.tangent = self.row.tangent.max(tangent),
            Err(reason) => self.exclude(Status::Error, reason),
        }
    }

    fn fail(&mut self, error: &(dyn Error + 'static)) {
        let refused = !self.has_worked && is_refusal(error);
        self.exclude(if refused { Status::NotAvailable } else { Status::Error }, error.to_string());
    }

    fn exclude(&mut self, status: Status, reason: String) {
        (self.row.status, self.row.reason) = (status, reason);
        self.search = None;
        self.last = None;
        self.row.wall.clear();
        self.row.gpu.clear();
        self.phases.clear();
    }

    fn take_row(&mut self, point: &DataPoint, at: Option<f64>) -> Row {
        let fresh = Self::new(point, self.contender).row;
        let (status, reason) = match (self.row.status, at) {
            (Status::Error, Some(at)) => (Status::LeftOut, format!("wrong at {at} s")),
            (status, _) => (status, self.row.reason.clone()),
        };
        let mut row = std::mem::replace(&mut self.row, Row { status, reason, ..fresh });
        row.at = at.or(row.at);
        row.phases = medians(&std::mem::take(&mut self.phases));
        self.used = Duration::ZERO;
        row
    }
}

fn medians(runs: &[Vec<PhaseTime>]) -> Vec<(String, f64)> {
    let Some(first) = runs.first() else { return vec![] };
    let times = |name: &str| -> Vec<f64> {
        let seconds = |run: &Vec<PhaseTime>| Some(run.iter().find(|p| p.name == name)?.time.as_secs_f64());
        runs.iter().filter_map(seconds).collect()
    };
    first
        .iter()
        .map(|phase| (phase.name.to_owned(), Spread::from_values(&times(phase.name)).median))
        .collect()
}

fn is_refusal(error: &(dyn Error + 'static)) -> bool {
    use lazygrid::Error as E;
    if error.is::<Unavailable>() {
        return true;
    }
    matches!(
        error.downcast_ref::<E>(),
        Some(
            E::GpuUnavailable { .. }
                | E::NotOnBackend { .. }
                | E::NoAdapter { .. }
                | E::NoDevice { .. }
                | E::LimitExceeded { .. }
                | E::DeviceOutOfMemory { .. }
        )
    )
}

#[cfg(test)]
mod tests {
    use lazygrid::Pair;

    use super::*;
    use crate::figures::plan::SceneUpdate;
    use lazygrid_io::scenes::Scene;

    struct WrongFinder(Vec<Pair>);

    impl PairFinder for WrongFinder {
        fn run(&mut self, _: &[Sphere]) -> Result<Found<'_>, Box<dyn Error>> {
            Ok(Found::Pairs(&self.0))
        }
    }

    struct Broken;

    impl PairFinder for Broken {
        fn run(&mut self, _: &[Sphere]) -> Result<Found<'_>, Box<dyn Error>> {
            Err(lazygrid::Error::GpuUnavailable { reason: "it is gone".into() }.into())
        }
    }

    #[test]
    fn wrong_answer_is_an_error() {
        let point = DataPoint {
            figure: Figure::F3a,
            scene: Scene::Equal,
            n: 300,
            update: SceneUpdate::Fresh,
            contenders: vec![
                Contender::PlainCellList,
                Contender::Octree,
                Contender::Parry,
                Contender::SortAndSweep,
            ],
            runs: 3,
        };
        let spheres = Scene::Equal.spheres(300, 1);
        let limits = Limits { runs: 3, at_least: 3, time: Duration::ZERO, in_all: Duration::ZERO };
        let mut comparison =
            Comparison::new(&point, limits, |e| (e == Contender::SortAndSweep).then(|| "too slow".into()));
        comparison.runs[2].search = Some(Box::new(Broken));
        comparison.frame(&spheres, true).expect("the reference works");
        let mut pairs = lazygrid::detect(&spheres).expect("valid spheres");
        let last = pairs.pop().expect("some pairs");
        pairs.push(if last == Pair::new(298, 299) { Pair::new(0, 299) } else { Pair::new(298, 299) });
        comparison.runs[1].search = Some(Box::new(WrongFinder(pairs)));
        while !comparison.is_over() {
            comparison.frame(&spheres, false).expect("the reference works");
        }
        let rows = comparison.take_rows(None);
        let statuses: Vec<Status> = rows.iter().map(|row| row.status).collect();
        assert_eq!(statuses, [Status::Ok, Status::Error, Status::NotAvailable, Status::LeftOut]);
        assert!(rows[1].wall.is_empty() && rows[1].reason.contains("wrong answer"), "{}", rows[1].reason);
        assert_eq!(rows[0].wall.len(), 1);
    }
}
