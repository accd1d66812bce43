use std::fs;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::num::NonZeroU32;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use crate::output::options::Output;
use crate::output::{self, Lock};
use crate::random::philox::{Key, Purpose};
use crate::run::checkpoint::{Checkpoint, FileRecord};
use crate::run::{Run, RunEnd, is_same_text, queue};
use crate::{AnySimulation, Error};

pub(super) const SEEDS: &str = "replicas.csv";
const HEADER: &str = "replica,seed\n";
const BYTES_PER_ROW: u64 = 28;
const ROWS_PER_QUESTION: u32 = 1 << 16;

/// Runs of one scenario, each in its own directory, as if run by itself.
#[derive(Clone, Debug)]
pub struct Replicas {
    /// Scenario, parent directory, and the seed of the replicas' seeds.
    pub run: Run,
    pub count: NonZeroU32,
}

#[derive(Clone, Debug)]
pub struct ReplicaResults {
    /// [`RunEnd::Finished`] if all are done.
    pub end: RunEnd,
    /// Ascending.
    pub finished: Vec<u32>,
}

pub fn seed_of(seed: u64, replica: u32) -> u64 {
    let [low, high, ..] = Key::new(seed).draw(replica, 0, 0, Purpose::Replica);
    u64::from(low) | u64::from(high) << 32
}

impl Replicas {
    /// Does all replicas, one per thread at once, and writes `mean.csv`. Files do not depend on threads.
    ///
    /// Calls `watch` like [`Run::run`], from several threads; a break stops all. [`Run::resume`] continues stopped
    /// replicas and begins others.
    ///
    /// # Errors
    /// See [`Run::run`], as [`Error::Replica`] for one replica. The others then have checkpoints.
    pub fn run(
        &self,
        watch: impl Fn(u32, &AnySimulation) -> ControlFlow<()> + Sync,
    ) -> Result<ReplicaResults, Error> {
        let results = self.run_unless(|| false, watch)?;
        Ok(results.unwrap_or(ReplicaResults { end: RunEnd::Stopped, finished: Vec::new() }))
    }

    /// Does [`run`](Self::run), and asks `is_cancelled` while the seeds are written, which takes minutes for
    /// billions of replicas. Returns `None` if cancelled then.
    ///
    /// # Errors
    /// See [`run`](Self::run).
    pub fn run_unless(
        &self,
        is_cancelled: impl Fn() -> bool + Sync,
        watch: impl Fn(u32, &AnySimulation) -> ControlFlow<()> + Sync,
    ) -> Result<Option<ReplicaResults>, Error> {
        let Some(_lock) = self.prepare(&is_cancelled)? else { return Ok(None) };
        let is_outdated = self.is_outdated()?;
        let watch = |_: usize, replica: u32, simulation: &AnySimulation| watch(replica, simulation);
        let mut all = queue::run_all(std::slice::from_ref(self), &watch).map_err(|(_, error)| error)?;
        if is_outdated {
            output::remove_report(&self.run.directory)?;
        }
        Ok(Some(all.remove(0)))
    }

    /// Returns `true` if a table of seeds exists, as [`Run::resume`] needs.
    pub fn is_begun(&self) -> bool {
        self.run.directory.join(SEEDS).exists()
    }

    pub fn directory_of(&self, replica: u32) -> PathBuf {
        output::replica_directory(&self.run.directory, replica)
    }

    fn begun_replicas(&self) -> Result<Vec<u32>, Error> {
        let mut begun = output::numbered(&self.run.directory, "replica-")?;
        begun.retain(|&replica| replica < self.count.get());
        Ok(begun)
    }

    /// Looks only at directories that exist, because the replicas may be billions.
    pub(super) fn checkpoint_count(&self) -> Result<u32, Error> {
        let has_one = |replica: &u32| self.directory_of(*replica).join("checkpoint").exists();
        Ok(self.begun_replicas()?.iter().filter(|replica| has_one(replica)).count() as u32)
    }

    /// Returns `true` if replicas have steps to do.
    pub(super) fn is_outdated(&self) -> Result<bool, Error> {
        let begun = self.begun_replicas()?;
        if !self.run.resume || begun.len() < self.count.get() as usize {
            return Ok(true);
        }
        for replica in begun {
            if finished(&self.replica(replica))?.is_none() {
                return Ok(true);
            }
        }
        Ok(false)
    }

    pub fn replica(&self, replica: u32) -> Run {
        let mut run = self.run.clone();
        run.scenario.seed = seed_of(run.scenario.seed, replica);
        run.directory = self.directory_of(replica);
        run.report = None;
        run.scenario.output = self.output_of(replica);
        if run.resume && !run.checkpoint_path().exists() {
            // The table of seeds identifies the directory, and a mark its files.
            (run.resume, run.overwrite) = (false, output::has_begun(&run.directory, run.scenario.seed));
        }
        run
    }

    fn output_of(&self, replica: u32) -> Output {
        let output = self.run.scenario.output;
        Output { animation: output.animation.filter(|_| replica == 0), ..output }
    }

    /// Writes the seeds; `None` if cancelled.
    pub(crate) fn prepare(&self, is_cancelled: &impl Fn() -> bool) -> Result<Option<Lock>, Error> {
        let directory = &self.run.directory;
        let path = directory.join(SEEDS);
        let lock = match self.run.resume {
            false => {
                let lock = output::prepare(directory, self.run.overwrite)?;
                self.check_table_fits()?;
                if self.run.overwrite {
                    output::remove_results(directory)?;
                    // Replicas of a former run could count as done.
                    output::remove_replicas(directory)?;
                }
                lock
            }
            true => {
                if !self.check_seeds(&path, is_cancelled)? {
                    return Ok(None);
                }
                let lock = Lock::acquire(directory)?;
                self.refuse_foreign()?;
                self.check_table_fits()?;
                lock
            }
        };
        match output::write_atomically(&path, |out| self.write_seeds(out, is_cancelled)) {
            Err(_) if is_cancelled() => Ok(None),
            written => written.map(|()| Some(lock)),
        }
    }

    pub(super) fn refuse_foreign(&self) -> Result<(), Error> {
        let directory = &self.run.directory;
        output::refuse_other_table(directory, output::MEAN, "step,time,replicas")?;
        for replica in self.begun_replicas()? {
            output::refuse_other_derived(&self.directory_of(replica), &self.output_of(replica))?;
        }
        let Some(plots) = self.run.report else { return Ok(()) };
        let former = output::refuse_foreign_page(directory)?;
        match output::refuse_foreign_files(directory, &former, plots, &output::TABLES) {
            // If no step is left, the tables may equal those to be written, which their writer sees.
            Err(error) if self.is_outdated()? => Err(error),
            _ => Ok(()),
        }
    }

    fn write_seeds(&self, out: &mut impl Write, is_cancelled: &impl Fn() -> bool) -> io::Result<()> {
        out.write_all(HEADER.as_bytes())?;
        for replica in 0..self.count.get() {
            if replica.is_multiple_of(ROWS_PER_QUESTION) && is_cancelled() {
                return Err(io::Error::other("cancelled"));
            }
            writeln!(out, "{replica},{}", seed_of(self.run.scenario.seed, replica))?;
        }
        Ok(())
    }

    /// Returns `false` if cancelled. The table follows from the seed, so it needs no checksum.
    fn check_seeds(&self, path: &Path, is_cancelled: &impl Fn() -> bool) -> Result<bool, Error> {
        let read = |source| Error::Read { path: path.to_owned(), source };
        let mut lines = BufReader::new(fs::File::open(path).map_err(read)?);
        let refused = |message: String| Err(Error::Checkpoint { path: path.to_owned(), message });
        let mut line = String::new();
        for row in 0_u64.. {
            line.clear();
            if lines.by_ref().take(64).read_line(&mut line).map_err(read)? == 0 && row > 0 {
                return Ok(true);
            }
            if row.is_multiple_of(ROWS_PER_QUESTION.into()) && is_cancelled() {
                return Ok(false);
            }
            let replica = row.checked_sub(1).map(|replica| replica as u32);
            let expected = match replica {
                None => HEADER.to_owned(),
                Some(replica) => format!("{replica},{}\n", seed_of(self.run.scenario.seed, replica)),
            };
            if line != expected {
                return refused(
                    "its replicas have other seeds, or it is damaged; give the --seed that they were begun with, restore \
                     it from a copy, or start over with --overwrite in place of --resume"
                        .to_owned(),
                );
            }
            if row > u64::from(self.count.get()) {
                let rows = 1 + lines.lines().count() as u64;
                return refused(format!("there are {} replicas; give as many or more", row - 1 + rows));
            }
        }
        Ok(true)
    }

    fn check_table_fits(&self) -> Result<(), Error> {
        self.check_table_fits_into(&self.run.directory)
    }

    /// `path` is the directory, or one that exists on the same disk.
    pub(super) fn check_table_fits_into(&self, path: &Path) -> Result<(), Error> {
        let refused = |source| Error::Write { path: self.run.directory.clone(), source };
        let free = fs4::available_space(path).map_err(refused)?;
        let bytes = u64::from(self.count.get()) * BYTES_PER_ROW;
        if !self.run.space_check || bytes <= free {
            return Ok(());
        }
        let message = format!(
            "the table of the seeds of {} replicas has about {} MB and the disk has {} MB left; do fewer replicas",
            self.count,
            bytes >> 20,
            free >> 20
        );
        Err(refused(io::Error::new(io::ErrorKind::StorageFull, message)))
    }

    pub(crate) fn results(&self, ended: &[u32]) -> Result<ReplicaResults, Error> {
        let mut finished = Vec::new();
        for replica in self.begun_replicas()? {
            if ended.binary_search(&replica).is_ok() || is_finished(&self.replica(replica))? {
                finished.push(replica);
            }
        }
        let end = if ended.len() == self.count.get() as usize { RunEnd::Finished } else { RunEnd::Stopped };
        Ok(ReplicaResults { end, finished })
    }
}

fn is_finished(replica: &Run) -> Result<bool, Error> {
    match finished(replica)? {
        None => Ok(false),
        Some(files) => output::check(&replica.directory, &files).map(|()| true),
    }
}

/// Returns the files of a replica whose steps are done; `None` for another scenario or seed.
fn finished(replica: &Run) -> Result<Option<Vec<FileRecord>>, Error> {
    let path = replica.checkpoint_path();
    if !path.exists() {
        return Ok(None);
    }
    let Checkpoint { scenario, seed, state, files, .. } = Checkpoint::read(&path)?;
    let own_scenario = &replica.scenario;
    let is_own = seed == own_scenario.seed && is_same_text(&scenario, &own_scenario.text);
    Ok((is_own && state.step >= own_scenario.steps).then_some(files))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::RunView;
    use crate::scenario::Scenario;

    #[test]
    fn replicas_have_distinct_seeds() {
        let seeds = [0, 1, 2].into_iter().flat_map(|seed| (0..1000).map(move |k| seed_of(seed, k)));
        let mut seeds: Vec<u64> = seeds.chain([0, 1, 2]).collect();
        seeds.sort_unstable();
        seeds.dedup();
        assert_eq!(seeds.len(), 3003);
    }

    fn scenario(text: &str) -> Scenario {
        Scenario::parse(Path::new("s.toml"), text.to_owned()).expect("a scenario")
    }

    const TEXT: &str = "time-step = 0.1\nsteps = 3\n[[species]]\nname = \"A\"\ndiffusion = 1\n\
                        [[transmitter]]\nname = \"tx\"\nrelease = [{ species = \"A\", count = 5 }]\n";

    #[test]
    fn replicas_of_another_scenario_or_seed_are_not_finished() {
        let directory = tempfile::tempdir().expect("a directory");
        let replicas = |text: &str, seed: u64| {
            let mut run = Run::new(scenario(text), "s.toml", directory.path());
            run.scenario.seed = seed;
            Replicas { run, count: NonZeroU32::new(2).expect("two") }
        };
        replicas(TEXT, 7).run(|_, _| ControlFlow::Continue(())).expect("a run");
        let finished = |replicas: Replicas| replicas.results(&[]).expect("checkpoints").finished;
        assert_eq!(finished(replicas(TEXT, 7)), [0, 1]);
        assert_eq!(finished(replicas(&TEXT.replace("= 1", "= 2"), 7)), [0; 0]);
        assert_eq!(finished(replicas(TEXT, 8)), [0; 0]);
        assert_eq!(finished(replicas(&TEXT.replace("[[t", "\n\n[[t"), 7)), [0, 1]);
    }

    #[test]
    fn stop_in_the_last_step_ends_nothing() {
        let directory = tempfile::tempdir().expect("a directory");
        let run = |name: &str, last: u32| {
            let run = Run::new(scenario(TEXT), "s.toml", directory.path().join(name));
            let watch = |simulation: &AnySimulation| match simulation.step_count() == last {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            };
            run.run(watch).expect("a run").0
        };
        assert_eq!([run("a", 2), run("b", 3)], [RunEnd::Stopped, RunEnd::Finished]);
    }
}
