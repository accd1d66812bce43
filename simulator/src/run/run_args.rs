//! Arguments of commands that run scenarios.

use std::num::NonZeroU32;
use std::path::PathBuf;

use crate::Error;
use crate::run::Run;
use crate::scenario::{Overrides, Scenario};

/// The scenario, its output, and overrides.
#[derive(Clone, Debug, clap::Args)]
#[non_exhaustive]
pub struct RunArgs {
    /// The scenario, a TOML file
    pub scenario: PathBuf,
    /// The directory to write to [default: the scenario's name without .toml]
    #[arg(long, short, value_name = "DIR")]
    pub output: Option<PathBuf>,
    /// The seed of the random numbers [default: the scenario's]
    #[arg(long, value_name = "S")]
    pub seed: Option<u64>,
    /// Number of steps of the whole run [default: the scenario's]
    #[arg(long, value_name = "N")]
    pub steps: Option<u32>,
    /// Write a row of the series after every N steps [default: the scenario's]
    #[arg(long, value_name = "N")]
    pub series_every: Option<NonZeroU32>,
    /// Write a frame after every N steps [default: the scenario's]
    #[arg(long, value_name = "N")]
    pub frames_every: Option<NonZeroU32>,
    /// Write a checkpoint after every N steps, in addition to the one at the end [default: the scenario's]
    #[arg(long, value_name = "N")]
    pub checkpoint_every: Option<NonZeroU32>,
    /// Write animation.html, a page that plays the run in three dimensions in any browser
    #[arg(long)]
    pub animate: bool,
    /// Add a frame to the animation after every N steps [default: a two-hundredth of the scenario's steps]
    #[arg(long, value_name = "N", requires = "animate")]
    pub animate_every: Option<NonZeroU32>,
    /// Draw at most N particles in the animation, chosen by their ids; each takes 8 bytes of every frame
    #[arg(long, value_name = "N", requires = "animate", default_value = "20000")]
    pub animate_particles: NonZeroU32,
    /// Resume from the checkpoint in the output directory
    #[arg(long, conflicts_with = "overwrite")]
    pub resume: bool,
    /// Replace the run in the output directory
    #[arg(long)]
    pub overwrite: bool,
    /// Run without checking the free space of the disk
    #[arg(long)]
    pub no_space_check: bool,
}

impl RunArgs {
    /// Reads the scenario and applies the overrides.
    ///
    /// # Errors
    /// See [`Scenario::read`].
    pub fn read(&self) -> Result<Run, Error> {
        let scenario = Scenario::read(&self.scenario)?;
        self.warn_of_frames([&scenario]);
        Ok(self.run(scenario))
    }

    /// Warns if [`frames_every`](Self::frames_every) has no effect, because no scenario writes frames.
    pub fn warn_of_frames<'a>(&self, scenarios: impl IntoIterator<Item = &'a Scenario>) {
        let writes = |scenario: &Scenario| scenario.output.xyz || scenario.output.npy;
        if self.frames_every.is_some() && !scenarios.into_iter().any(writes) {
            log::warn!(
                "--frames-every has no effect, because the scenario writes no frames; set frames = [\"xyz\"] or [\"npy\"] in \
                 its [output]"
            );
        }
    }

    /// Returns the run of a scenario with the overrides, as [`Run::new`] for other options.
    pub fn run(&self, mut scenario: Scenario) -> Run {
        scenario.change(&Overrides {
            seed: self.seed,
            steps: self.steps,
            every: self.series_every,
            frames_every: self.frames_every,
            checkpoint_every: self.checkpoint_every,
            animated: self.animate.then_some(self.animate_particles),
            animate_every: self.animate_every,
        });
        let directory = self.output.clone().unwrap_or_else(|| Run::directory_of(&self.scenario));
        Run {
            resume: self.resume,
            overwrite: self.overwrite,
            space_check: !self.no_space_check,
            ..Run::new(scenario, &self.scenario, directory)
        }
    }
}
