use std::time::Duration;

use indicatif::{HumanDuration, ProgressBar, ProgressStyle};
use lazygrid_bench::figures::{self, Figure, Progress, Results, RunScale, Settings};

use crate::command::args::{Figures, MeasureMemory};
use crate::command::failure::Failure;
use crate::command::invocation;
use crate::print;

pub(crate) fn run(args: &Figures) -> Result<(), Failure> {
    let settings = settings(args);
    let program = std::env::current_exe().map_err(|e| Failure::Figures(e.to_string()))?;
    let bar = ProgressBar::new(0).with_style(style());
    bar.enable_steady_tick(Duration::from_millis(500));
    let show = |progress: &Progress| {
        bar.set_length(progress.points as u64);
        bar.set_position(progress.done as u64);
        let left = HumanDuration(progress.left);
        bar.set_message(format!("{}, about {left} left", progress.next));
        log::info!("{} of {}: {}, about {left} left", progress.done, progress.points, progress.next);
    };
    let failure = |e: Box<dyn std::error::Error>| Failure::Figures(e.to_string());
    let results = figures::run(&settings, &args.out, &program, show).map_err(failure)?;
    bar.finish_and_clear();
    figures::write_report(&results, &args.out).map_err(failure)?;
    let verdict = match results.errors().count() {
        0 => Ok(()),
        errors => Err(Failure::WrongAnswers { errors, report: args.out.join("report.html") }),
    };
    // The exit code must show the verdict even if standard output is closed.
    let printed = print(summary(&results, args));
    verdict.and(printed)
}

fn settings(args: &Figures) -> Settings {
    let scale = match (args.quick, args.smoke) {
        (_, true) => RunScale::Smoke,
        (true, _) => RunScale::Quick,
        _ => RunScale::Full,
    };
    let mut only = if args.only.is_empty() { Figure::ALL.to_vec() } else { args.only.clone() };
    only.sort();
    only.dedup();
    let minutes = args.budget_minutes.unwrap_or(if scale == RunScale::Full { 30.0 } else { 1.75 });
    let command = invocation::command();
    Settings { scale, only, runs: args.runs.map(Into::into), minutes, seed: 1, command }
}

fn style() -> ProgressStyle {
    ProgressStyle::with_template("{wide_bar} {pos}/{len} {msg}")
        .unwrap_or_else(|_| ProgressStyle::default_bar())
}

fn summary(results: &Results, args: &Figures) -> String {
    format!(
        "{} measurements, {} with a wrong answer or failure, {:.1} minutes\nreport     {}\nresults    {}\n",
        results.rows.len(),
        results.errors().count(),
        results.seconds / 60.0,
        args.out.join("report.html").display(),
        args.out.join("results.json").display(),
    )
}

pub(crate) fn measure_memory(args: &MeasureMemory) -> Result<(), Failure> {
    let sample = figures::measure_memory(&args.engine, args.scene, args.n, args.steps);
    let sample = sample.map_err(|e| Failure::Figures(e.to_string()))?;
    let text = serde_json::to_string(&sample).map_err(|e| Failure::Figures(e.to_string()))?;
    print(text + "\n")
}
