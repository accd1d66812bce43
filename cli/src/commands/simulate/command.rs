use std::num::NonZeroU32;
use std::path::Path;

use lazygrid::{Algorithm, Backend};
use lazygrid_io::arguments::shell_command;
use lazygrid_sim::run::Run;
use lazygrid_sim::run::run_args::RunArgs;

use crate::args::{ArrivalsFormat, Simulate};

pub(crate) fn report_command(
    args: &Simulate,
    run: &Run,
    scenario: &Path,
    replicas: Option<NonZeroU32>,
) -> String {
    let mut options = args.options.clone();
    (options.seed, options.steps) = (Some(run.scenario.seed), Some(run.scenario.steps));
    let mut command = CommandWords::simulate(scenario, &run.directory);
    command.overrides(args, &options);
    command.flag("--report", true);
    command.value("--replicas", replicas);
    shell_command(&command.0)
}

/// Returns the command that continues a stopped run.
pub(crate) fn resume_command(args: &Simulate, directory: &Path, is_begun: bool) -> String {
    let Simulate { ref options, replicas, ref sweep, report, .. } = *args;
    let mut command = CommandWords::simulate(&options.scenario, directory);
    command.overrides(args, options);
    command.value("--threads", args.threads);
    command.flag("--report", report);
    sweep.iter().for_each(|sweep| command.value("--sweep", Some(sweep)));
    command.value("--replicas", replicas);
    command.flag("--resume", is_begun);
    command.flag("--overwrite", options.overwrite && !is_begun);
    shell_command(&command.0)
}

struct CommandWords(Vec<String>);

impl CommandWords {
    fn simulate(scenario: &Path, directory: &Path) -> Self {
        let [scenario, directory] = [scenario, directory].map(|path| path.display().to_string());
        Self(vec!["lazygrid".into(), "simulate".into(), scenario, "--output".into(), directory])
    }

    fn overrides(&mut self, args: &Simulate, options: &RunArgs) {
        let Simulate { arrivals_format, backend, algorithm, .. } = *args;
        self.options(options);
        self.value("--arrivals-format", (arrivals_format == ArrivalsFormat::Arrow).then_some("arrow"));
        self.value("--backend", Some(backend).filter(|&backend| backend != Backend::Cpu));
        self.value("--algorithm", Some(algorithm).filter(|&algorithm| algorithm != Algorithm::default()));
    }

    fn options(&mut self, options: &RunArgs) {
        self.value("--seed", options.seed);
        self.value("--steps", options.steps);
        self.value("--series-every", options.series_every);
        self.value("--frames-every", options.frames_every);
        self.value("--checkpoint-every", options.checkpoint_every);
        self.flag("--animate", options.animate);
        self.value("--animate-every", options.animate_every);
        self.value("--animate-particles", options.animate.then_some(options.animate_particles));
        self.flag("--no-space-check", options.no_space_check);
    }

    fn value(&mut self, option: &str, value: Option<impl ToString>) {
        if let Some(value) = value {
            self.0.extend([option.to_owned(), value.to_string()]);
        }
    }

    fn flag(&mut self, option: &str, is_given: bool) {
        self.0.extend(is_given.then(|| option.to_owned()));
    }
}
