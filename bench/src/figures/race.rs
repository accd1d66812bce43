//! Engines in turn on the same spheres, each answer held against the reference.

use std::error::Error;
use std::hint::black_box;
use std::time::{Duration, Instant};

use lazygrid::{Phase, Sphere};
use thiserror::Error;

use super::judge::Reference;
use super::plan::Point;
use super::row::{Row, Status};
use super::{Engine, Figure};
use crate::measure::{Contender, Digest, Found, Search, Spread, turns};

/// For how many times the time that it has an engine may go on until it has run often enough.
const MORE: u32 = 3;

/// For how long an engine searches before it is timed, where its threads are what is compared: the threads of a pool sleep
/// while others have their turn, and a system may leave those that it has just woken on one core for milliseconds.
const WAKING: Duration = Duration::from_millis(40);

/// Why a peer cannot take part.
#[derive(Clone, Copy, Debug, Error)]
#[error("{0}")]
pub(super) struct Unavailable(&'static str);

impl Unavailable {
    #[cfg(not(feature = "bullet"))]
    pub(super) const BULLET: Self = Self("not built in; build with --features bullet");
    pub(super) const LAMMPS: Self = Self("set LAZYGRID_LAMMPS to the path of liblammps.so");

    /// A contender that never comes to search.
    pub(super) fn contender(self, name: String) -> Contender {
        Contender::new(name, move || Err::<Nothing, _>(self.into()))
    }
}

/// A search that there is not.
enum Nothing {}

impl Search for Nothing {
    fn run(&mut self, _: &[Sphere]) -> Result<Found<'_>, Box<dyn Error>> {
        match *self {}
    }
}

/// When an engine has run enough.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// No more runs than this.
    pub(super) runs: usize,
    /// Fewer only where they take [`MORE`] times as long as they may.
    pub(super) at_least: usize,
    /// No further run after this much time of its own.
    pub(super) time: Duration,
    /// Nor after all engines and what lies between their runs have taken this long.
    pub(super) in_all: Duration,
}

/// The engines of a point on their way through its runs.
pub(super) struct Race<'a> {
    point: &'a Point,
    limits: Limits,
    lanes: Vec<Lane>,
    frames: usize,
    /// When the runs that count began.
    began: Option<Instant>,
}

struct Lane {
    engine: Engine,
    search: Option<Box<dyn Search>>,
    phases: Vec<Vec<Phase>>,
    used: Duration,
    last: Option<Digest>,
    has_worked: bool,
    row: Row,
}

impl<'a> Race<'a> {
    /// All engines of the point; `left_out` says which take no part and why.
    pub(super) fn new(point: &'a Point, limits: Limits, left_out: impl Fn(Engine) -> Option<String>) -> Self {
        let lane = |&engine: &Engine| {
            let mut lane = Lane::new(point, engine);
            match left_out(engine) {
                Some(reason) => lane.leave(Status::LeftOut, reason),
                None => match (engine.contender(point.scene, point.n, point.moves()).make)() {
                    Ok(search) => lane.search = Some(search),
                    Err(error) => lane.fail(error.as_ref()),
                },
            }
            lane
        };
        Self { point, limits, lanes: point.engines.iter().map(lane).collect(), frames: 0, began: None }
    }

    /// Whether nobody has anything left to run.
    pub(super) fn is_over(&self) -> bool {
        self.lanes.iter().all(|lane| lane.is_done(self.limits, self.is_late()))
    }

    /// Whether all engines together have had their time.
    fn is_late(&self) -> bool {
        self.began.is_some_and(|began| began.elapsed() >= self.limits.in_all)
    }

    /// Lets everybody who has not done enough find the pairs of these spheres, and holds every answer against the
    /// reference. The time of a warm-up is dropped.
    ///
    /// # Errors
    /// Where the reference fails.
    pub(super) fn frame(&mut self, spheres: &[Sphere], warm_up: bool) -> Result<(), Box<dyn Error>> {
        if !warm_up {
            self.began.get_or_insert_with(Instant::now);
        }
        let (lanes, limits, is_late) = (self.lanes.len(), self.limits, self.is_late());
        for turn in turns(lanes, self.frames as u64) {
            let lane = &mut self.lanes[turn];
            lane.last = None;
            if warm_up || !lane.is_done(limits, is_late) {
                lane.wake(self.point, spheres);
                lane.run(spheres, warm_up);
            }
        }
        self.frames += 1;
        if self.lanes.iter().any(|lane| lane.last.is_some()) {
            let reference = Reference::of(spheres)?;
            self.lanes.iter_mut().for_each(|lane| lane.judge(&reference, spheres));
        }
        Ok(())
    }

    /// The rows so far, marked with `at`; the engines begin new ones.
    pub(super) fn take_rows(&mut self, at: Option<f64>) -> Vec<Row> {
        let point = self.point;
        self.began = None;
        self.lanes.iter_mut().map(|lane| lane.take_row(point, at)).collect()
    }
}

impl Lane {
    fn new(point: &Point, engine: Engine) -> Self {
        let row = Row::new(point, engine);
        Self {
            engine,
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
        let enough = runs >= limits.at_least || self.used >= MORE * limits.time;
        let out_of_time = runs > 0 && enough && (is_late || self.used >= limits.time);
        self.search.is_none() || runs >= limits.runs || out_of_time
    }

    /// Searches until the engine's threads are at work on cores of their own.
    fn wake(&mut self, point: &Point, spheres: &[Sphere]) {
        let Some(search) = self.search.as_mut().filter(|_| point.figure == Figure::Threads) else { return };
        let begun = Instant::now();
        while begun.elapsed() < WAKING {
            // What goes wrong here goes wrong again where it is judged.
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
            Ok(found) => Digest::of(&found),
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

    fn judge(&mut self, reference: &Reference<'_>, spheres: &[Sphere]) {
        let Some(found) = self.last else { return };
        let verdict = match (reference.check(found), &mut self.search) {
            // The list again, pair by pair: a GPU may round otherwise than the reference.
            (Err(reason), Some(search)) if self.engine.rounds_freely() => match search.run(spheres) {
                Ok(again) if Digest::of(&again) != found => Err("another answer when asked again".to_owned()),
                Ok(Found::Pairs(pairs)) => reference.tangent(pairs),
                Ok(Found::Count(_)) => Err(reason),
                Err(error) => Err(error.to_string()),
            },
            (verdict, _) => verdict.map(|()| 0),
        };
        match verdict {
            Ok(tangent) => self.row.tangent = self.row.tangent.max(tangent),
            Err(reason) => self.leave(Status::Error, reason),
        }
    }

    fn fail(&mut self, error: &(dyn Error + 'static)) {
        // What has worked before is not refused but fails.
        let refused = !self.has_worked && is_refusal(error);
        self.leave(if refused { Status::NotAvailable } else { Status::Error }, error.to_string());
    }

    fn leave(&mut self, status: Status, reason: String) {
        (self.row.status, self.row.reason) = (status, reason);
        self.search = None;
        self.last = None;
        self.row.wall.clear();
        self.row.gpu.clear();
        self.phases.clear();
    }

    fn take_row(&mut self, point: &Point, at: Option<f64>) -> Row {
        let fresh = Self::new(point, self.engine).row;
        let (status, reason) = match (self.row.status, at) {
            // It takes no further part.
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

/// Median of each phase, in the order they ran.
fn medians(runs: &[Vec<Phase>]) -> Vec<(String, f64)> {
    let Some(first) = runs.first() else { return vec![] };
    let times = |name: &str| -> Vec<f64> {
        let of = |run: &Vec<Phase>| Some(run.iter().find(|p| p.name == name)?.time.as_secs_f64());
        runs.iter().filter_map(of).collect()
    };
    first.iter().map(|phase| (phase.name.to_owned(), Spread::of(&times(phase.name)).median)).collect()
}

/// Whether an engine said in advance that it does not do this here, which is no mistake.
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
    use crate::figures::plan::Motion;
    use lazygrid_io::scenes::Scene;

    struct Liar(Vec<Pair>);

    impl Search for Liar {
        fn run(&mut self, _: &[Sphere]) -> Result<Found<'_>, Box<dyn Error>> {
            Ok(Found::Pairs(&self.0))
        }
    }

    struct Broken;

    impl Search for Broken {
        fn run(&mut self, _: &[Sphere]) -> Result<Found<'_>, Box<dyn Error>> {
            Err(lazygrid::Error::GpuUnavailable { reason: "it is gone".into() }.into())
        }
    }

    /// A wrong answer is an error whoever else agrees with it and whenever it comes, and others go on.
    #[test]
    fn a_wrong_answer_is_an_error() {
        let point = Point {
            figure: Figure::F3a,
            scene: Scene::Equal,
            n: 300,
            motion: Motion::Fresh,
            engines: vec![Engine::PlainCellList, Engine::Octree, Engine::Parry, Engine::SortAndSweep],
            runs: 3,
        };
        let spheres = Scene::Equal.spheres(300, 1);
        // No time at all, in which everybody runs once.
        let limits = Limits { runs: 3, at_least: 3, time: Duration::ZERO, in_all: Duration::ZERO };
        let mut race = Race::new(&point, limits, |e| (e == Engine::SortAndSweep).then(|| "too slow".into()));
        race.lanes[2].search = Some(Box::new(Broken));
        race.frame(&spheres, true).expect("the reference works");
        // As many pairs as there are, and another one in place of the last.
        let mut pairs = lazygrid::detect(&spheres).expect("valid spheres");
        let last = pairs.pop().expect("some pairs");
        pairs.push(if last == Pair::new(298, 299) { Pair::new(0, 299) } else { Pair::new(298, 299) });
        race.lanes[1].search = Some(Box::new(Liar(pairs)));
        while !race.is_over() {
            race.frame(&spheres, false).expect("the reference works");
        }
        let rows = race.take_rows(None);
        let statuses: Vec<Status> = rows.iter().map(|row| row.status).collect();
        assert_eq!(statuses, [Status::Ok, Status::Error, Status::NotAvailable, Status::LeftOut]);
        assert!(rows[1].wall.is_empty() && rows[1].reason.contains("wrong answer"), "{}", rows[1].reason);
        assert_eq!(rows[0].wall.len(), 1);
    }
}
