//! A run from a scenario to its files.

use std::ops::ControlFlow;
use std::path::PathBuf;

use lazygrid::{Algorithm, Backend};

use crate::checkpoint::Checkpoint;
use crate::output::{self, Files};
use crate::scenario::Scenario;
use crate::{Error, Simulator};

/// What is to be run, and where it is written.
#[derive(Clone, Debug)]
pub struct Run {
    /// The scenario, with its seed, steps and output as they are wanted.
    pub scenario: Scenario,
    /// The file that the scenario is from, for messages.
    pub path: PathBuf,
    /// Where the files go.
    pub directory: PathBuf,
    /// Where it runs; see [`Simulator::begin`].
    pub backend: Backend,
    /// How the CPU finds pairs; that does not change the result.
    pub algorithm: Algorithm,
    /// Threads; by default all.
    pub threads: Option<usize>,
    /// Whether to go on from the checkpoint in the directory.
    pub resume: bool,
    /// Whether to replace a run that is in the directory.
    pub overwrite: bool,
}

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// All steps are done.
    Finished,
    /// It was stopped, and can go on.
    Stopped,
}

impl Run {
    /// Does all steps and calls `watch` before the first and after each, or on a GPU after several, until it breaks. However it ends, the files
    /// are closed and there is a checkpoint to go on from.
    ///
    /// # Errors
    /// [`Error::Write`] before anything is computed where the directory cannot be written or the disk is too small,
    /// and at any time where the system refuses to write; [`Error::Checkpoint`] where there is nothing to go on from;
    /// and whatever [`Simulator::advance`] says.
    pub fn run(
        &self,
        watch: impl FnMut(&Simulator) -> ControlFlow<()> + Send,
    ) -> Result<(End, Simulator), Error> {
        match self.threads {
            None => self.run_here(watch),
            Some(threads) => {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
                let refused = |error: rayon::ThreadPoolBuildError| Error::Threads {
                    threads,
                    reason: error.to_string(),
                };
                pool.map_err(refused)?.install(|| self.run_here(watch))
            }
        }
    }

    fn run_here(
        &self,
        mut watch: impl FnMut(&Simulator) -> ControlFlow<()>,
    ) -> Result<(End, Simulator), Error> {
        let (mut simulation, mut files) = if self.resume { self.go_on()? } else { self.begin()? };
        let mut end = End::Finished;
        if watch(&simulation).is_break() {
            end = End::Stopped;
        }
        while end == End::Finished && simulation.step_count() < self.scenario.steps {
            simulation.advance(self.steps_to_next(simulation.step_count()))?;
            files.record(&simulation)?;
            let due = |every: u32| simulation.step_count().is_multiple_of(every);
            if self.scenario.output.checkpoint_every.is_some_and(due) {
                self.save(&simulation, &mut files)?;
            }
            if watch(&simulation).is_break() {
                end = End::Stopped;
            }
        }
        self.save(&simulation, &mut files)?;
        Ok((end, simulation))
    }

    /// How many steps there are until something is written.
    fn steps_to_next(&self, step: u32) -> u32 {
        let output = self.scenario.output;
        let frames = (output.xyz || output.npy).then_some(output.frames_every);
        let every = [Some(output.every), frames, output.checkpoint_every];
        let left = every.into_iter().flatten().map(|every| every - step % every);
        left.fold(self.scenario.steps - step, u32::min)
    }

    fn begin(&self) -> Result<(Simulator, Files), Error> {
        let Scenario { model, steps, seed, output, .. } = &self.scenario;
        let simulation = Simulator::begin(model, *seed, self.backend, self.algorithm, None)?;
        output::prepare(&self.directory, self.overwrite)?;
        self.check_room(output::estimate(*output, model, *steps))?;
        let mut files = Files::create(&self.directory, *output, model)?;
        files.record(&simulation)?;
        // What cannot be written shows now.
        self.save(&simulation, &mut files)?;
        Ok((simulation, files))
    }

    /// Refuses a run whose files will not fit.
    fn check_room(&self, needed: u64) -> Result<(), Error> {
        let write = |source| Error::Write { path: self.directory.clone(), source };
        let free = fs4::available_space(&self.directory).map_err(write)?;
        if needed <= free {
            return Ok(());
        }
        let message = format!(
            "the run is going to write about {} MB and the disk has {} MB left; write frames less often or choose \
             another directory",
            needed >> 20,
            free >> 20
        );
        Err(write(std::io::Error::new(std::io::ErrorKind::StorageFull, message)))
    }

    fn go_on(&self) -> Result<(Simulator, Files), Error> {
        let path = self.directory.join("checkpoint");
        let Checkpoint { scenario, seed, every, lengths, state } = Checkpoint::read(&path)?;
        let refused = |message: String| Err(Error::Checkpoint { path: path.clone(), message });
        let own = &self.scenario;
        if scenario != own.text {
            let name = self.path.display();
            return refused(format!(
                "it is of another scenario than {name}; give that one, or start the run anew"
            ));
        }
        if seed != own.seed {
            return refused(format!("it is of seed {seed} and not {}; give --seed {seed}", own.seed));
        }
        if every != [own.output.every, own.output.frames_every] {
            let [rows, frames] = every;
            return refused(format!(
                "its series goes by --every {rows} and its frames by --frames-every {frames}"
            ));
        }
        let simulation = Simulator::begin(&own.model, seed, self.backend, self.algorithm, Some(state))?;
        Ok((simulation, Files::reopen(&self.directory, own.output, &lengths)?))
    }

    fn save(&self, simulation: &Simulator, files: &mut Files) -> Result<(), Error> {
        let Scenario { text, seed, output, .. } = &self.scenario;
        let checkpoint = Checkpoint {
            scenario: text.clone(),
            seed: *seed,
            every: [output.every, output.frames_every],
            lengths: files.sync()?,
            state: simulation.state()?.into_owned(),
        };
        checkpoint.write(&self.directory.join("checkpoint"))
    }
}
