pub mod any;
pub mod checkpoint;
mod edit;
mod queue;
pub mod replicas;
#[cfg(feature = "clap")]
pub mod run_args;
pub mod simulation;
pub mod sweep;

mod difference;
mod disk_space;
pub(crate) mod memory_estimate;
pub(crate) mod sealed;
mod single_run;
pub(crate) mod step_loop;
pub(crate) mod time_step_monitor;

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use lazygrid::{Algorithm, Backend};

use crate::output::append_file::FileRecord;
use crate::output::options::Output;
use crate::output::{self, Files, Lock};
use crate::run::checkpoint::Checkpoint;
use crate::run::memory_estimate::Sharing;
use crate::run::single_run::SingleRun;
use crate::scenario::Scenario;
use crate::{AnySimulation, Error, RunView, State};

#[derive(Clone, Debug)]
pub struct Run {
    /// After overrides.
    pub scenario: Scenario,
    /// For messages.
    pub path: PathBuf,
    pub directory: PathBuf,
    /// See [`AnySimulation::begin`].
    pub backend: Backend,
    /// For the CPU, without effect on the result.
    pub algorithm: Algorithm,
    /// `None` for all.
    pub threads: Option<usize>,
    pub resume: bool,
    pub overwrite: bool,
    /// Plots that a report may have; `None` without a report. Before it changes a file, a resumed run refuses foreign
    /// files that [`write_report`](crate::write_report) would replace.
    pub report: Option<&'static [&'static str]>,
    /// Refuses a run that will not fit the disk, and stops before the disk is full.
    pub space_check: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RunEnd {
    Finished,
    /// Can be resumed.
    Stopped,
}

/// Ignores blank lines, which the section of a sweep leaves.
fn is_same_text(a: &str, b: &str) -> bool {
    let [a, b] = [a, b].map(|text| text.lines().filter(|line| !line.trim().is_empty()));
    a.eq(b)
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct ReplicaSlot {
    pub(crate) index: u32,
    pub(crate) count: u32,
    pub(crate) at_once: u32,
}

impl ReplicaSlot {
    pub(crate) const NONE: Self = Self { index: 0, count: 1, at_once: 1 };

    fn sharing(self) -> Sharing {
        Sharing { runs: self.at_once, machines: 1 }
    }
}

impl Run {
    /// Returns a run on the CPU with the default algorithm and all threads, which replaces no other run.
    pub fn new(scenario: Scenario, path: impl Into<PathBuf>, directory: impl Into<PathBuf>) -> Self {
        Self {
            scenario,
            path: path.into(),
            directory: directory.into(),
            backend: Backend::Cpu,
            algorithm: Algorithm::Auto,
            threads: None,
            resume: false,
            overwrite: false,
            report: None,
            space_check: true,
        }
    }

    /// Does all steps. Calls `watch` before the first and after each (several on a GPU) until it breaks. Ends with a
    /// checkpoint.
    ///
    /// # Errors
    /// [`Error::Write`] before the first step if the directory is not writable or the disk too small, later from the
    /// system. [`Error::Read`], [`Error::Checkpoint`], [`Error::CheckpointVersion`] or [`Error::Damaged`] if the run
    /// cannot be resumed. Those of [`AnySimulation::advance`], after which a GPU run has a checkpoint of the state
    /// before the failed step; [`Error::StoppedOnGpu`] if the CPU can resume it.
    pub fn run(
        &self,
        watch: impl FnMut(&AnySimulation) -> ControlFlow<()> + Send,
    ) -> Result<(RunEnd, AnySimulation), Error> {
        match self.threads {
            None => self.run_here(ReplicaSlot::NONE, watch),
            Some(threads) => {
                lazygrid::thread_pool(threads)?.install(|| self.run_here(ReplicaSlot::NONE, watch))
            }
        }
    }

    /// Uses the current thread pool. The first replica logs common messages.
    pub(crate) fn run_here(
        &self,
        slot: ReplicaSlot,
        mut watch: impl FnMut(&AnySimulation) -> ControlFlow<()>,
    ) -> Result<(RunEnd, AnySimulation), Error> {
        self.check_formats()?;
        if slot.index == 0 {
            self.log_warnings();
        }
        let mut run = match self.resume {
            true => SingleRun::resume(self, slot)?,
            false => SingleRun::begin(self, slot)?,
        };
        let end = self.do_steps(&mut run, |run| watch(&run.simulation))?;
        run.files.convert(run.simulation.model())?;
        Ok((end, run.simulation))
    }

    pub(crate) fn log_warnings(&self) {
        self.scenario.run_warnings().iter().for_each(|message| log::warn!("{message}"));
    }

    pub(crate) fn check_formats(&self) -> Result<(), Error> {
        let Scenario { model, output, .. } = &self.scenario;
        if output.arrow && !cfg!(feature = "arrow") {
            return Err(Error::NoArrow);
        }
        if output.arrow && !model.logs_arrivals {
            let message = "the scenario logs no arrivals, so that there is nothing to write as Arrow; set \
                           arrivals = true in its [output]";
            return Err(Error::Model(message.to_owned()));
        }
        Ok(())
    }

    /// Returns the scenario's file name without extension.
    pub fn directory_of(scenario: &Path) -> PathBuf {
        PathBuf::from(scenario.file_stem().unwrap_or(scenario.as_os_str()))
    }

    pub fn title(&self) -> String {
        let name = self.path.file_stem().unwrap_or_default().to_string_lossy();
        format!("{name}, seed {}", self.scenario.seed)
    }

    pub(crate) fn steps_to_next(&self, step: u32) -> u32 {
        let output = self.scenario.output;
        let frames = (output.xyz || output.npy).then_some(output.frames_every);
        let animated = output.animation.map(|animation| animation.every);
        let logged = self.scenario.model.logs_arrivals.then_some(output::LOGGED_STEPS);
        let every = [Some(output.every), frames, animated, output.checkpoint_every, logged];
        let left = every.into_iter().flatten().map(|every| every - step % every);
        left.fold(self.scenario.steps - step, u32::min)
    }

    pub(crate) fn create_files(&self, run: &impl RunView, slot: ReplicaSlot) -> Result<Files, Error> {
        let Scenario { model, seed, output, .. } = &self.scenario;
        let lock = output::prepare(&self.directory, self.overwrite)?;
        self.check_disk_space(run, slot)?;
        if self.overwrite {
            output::remove_results(&self.directory)?;
        }
        lock.mark_begun(*seed)?;
        Files::create(&self.directory, *output, model, *seed, lock)
    }

    pub(crate) fn lock(&self) -> Result<Lock, Error> {
        match Lock::acquire(&self.directory) {
            Err(Error::Write { source, .. }) if source.kind() == std::io::ErrorKind::NotFound => {
                Err(Error::Read { path: self.checkpoint_path(), source })
            }
            lock => lock,
        }
    }

    pub(crate) fn warn_of_backends(&self, step_count: u32, before: &str, now: Backend) {
        log::warn!(
            "the first {step_count} steps were done on the {before}, those to come are on the {now}: they round differently, so \
             that the run has the same statistics as one on either, and is the same as neither"
        );
    }

    pub(crate) fn check_continues(&self, path: &Path, checkpoint: &Checkpoint) -> Result<(), Error> {
        let Checkpoint { scenario, seed, every, state, .. } = checkpoint;
        let refused = |message: String| Err(Error::Checkpoint { path: path.to_owned(), message });
        let own_scenario = &self.scenario;
        if !is_same_text(scenario, &own_scenario.text) {
            let name = self.path.display();
            let differs = match difference::first_difference(scenario, &own_scenario.text) {
                Some(what) => format!(": {what}"),
                None => String::new(),
            };
            return refused(format!(
                "it is of another scenario than {name}{differs}; restore the scenario, or start again with --overwrite"
            ));
        }
        checkpoint.check_flow_field(path, &own_scenario.model)?;
        if *seed != own_scenario.seed {
            return refused(format!(
                "it is of seed {seed} and not {}; give --seed {seed}",
                own_scenario.seed
            ));
        }
        if *every != intervals(own_scenario.output) {
            let now = intervals(own_scenario.output);
            let names = ["--series-every", "--frames-every", "--animate-every"];
            let options = names.into_iter().zip(every.iter().zip(now)).filter(|(_, (was, is))| *was != is);
            let differences = options.map(|(name, (was, is))| match (was, is, name) {
                (0, _, "--animate-every") => "it has no animation; leave out --animate".to_owned(),
                (was, 0, "--animate-every") => {
                    format!("it has an animation; give --animate --animate-every {was}")
                }
                _ => format!("{name} is {was} there and {is} now; give {name} {was}"),
            });
            return refused(differences.collect::<Vec<_>>().join(", and "));
        }
        if own_scenario.steps < state.step {
            return refused(format!(
                "{} steps are done and the run is to have {} in all; give --steps {} or more",
                state.step, own_scenario.steps, state.step
            ));
        }
        Ok(())
    }

    pub(crate) fn checkpoint(&self, backend: Backend, files: Vec<FileRecord>, state: State) -> Checkpoint {
        let Scenario { model, text, seed, output, .. } = &self.scenario;
        Checkpoint {
            scenario: text.clone(),
            seed: *seed,
            flow_field: model.flow_field().map(|field| field.checksum()),
            backend: backend.name().to_owned(),
            every: intervals(*output),
            files,
            parts: Vec::new(),
            state,
        }
    }

    pub(crate) fn checkpoint_path(&self) -> PathBuf {
        self.directory.join("checkpoint")
    }

    pub fn summary(&self, standing: &impl RunView) -> String {
        let (model, totals) = (standing.model(), standing.totals());
        let mut lines = vec![
            format!("steps      {} ({} s)", standing.step_count(), standing.time()),
            format!("seed       {}", self.scenario.seed),
        ];
        for (species, (present, released)) in
            model.species.iter().zip(totals.present.iter().zip(&totals.released))
        {
            lines.push(format!("species    {}: {present} of {released} released", species.name));
        }
        let named = model.reactions.iter().map(|r| &r.name).chain(model.decays.iter().map(|d| &d.name));
        for (name, count) in named.zip(totals.reacted.iter().chain(&totals.decayed)) {
            lines.push(format!("reaction   {name}: {count}"));
        }
        for (receiver, counts) in model.receivers.iter().zip(standing.received()) {
            for (species, count) in model.species.iter().zip(counts).filter(|(_, count)| *count > 0) {
                lines.push(format!("receiver   {}: {count} {}", receiver.name, species.name));
            }
        }
        lines.push(format!("output     {}", self.directory.display()));
        lines.join("\n") + "\n"
    }
}

fn intervals(output: Output) -> [u32; 3] {
    [output.every, output.frames_every, output.animation.map_or(0, |animation| animation.every)]
}
