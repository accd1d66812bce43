mod bit_errors;
mod sections;
pub(super) mod sweep;

use std::path::{Path, PathBuf};

use lazygrid_report::{Document, Section, html};
use lazygrid_results::channel::Channels;
use lazygrid_results::mean::MeanSeries;
use lazygrid_results::series::Series;
use lazygrid_sim::run::Run;
use lazygrid_sim::{Model, Report, TableWriter, write_report};

use crate::error::CliError;

pub(super) const PLOTS: &[&str] = &[
    "particles",
    "reactions",
    "arrivals",
    "inside",
    "pairs",
    "inside-by-symbol",
    "arrivals-by-symbol",
    "impulse-response",
    "impulse-response-inside",
    "arrived",
    "interference",
    "bit-errors",
    "bit-errors-by-delay",
    "peak-time",
    "arrived-fraction",
    "late-fraction",
    "impulse-responses",
    "impulse-responses-inside",
];

pub(crate) struct ReportInput<'a> {
    /// Holds the directory of the report.
    pub(crate) run: &'a Run,
    pub(crate) mean: &'a MeanSeries,
    pub(crate) runs: Vec<(u64, PathBuf)>,
    pub(crate) command: String,
}

pub(crate) fn mean_of_run(run: &Run) -> Result<MeanSeries, CliError> {
    let path = run.directory.join("series.csv");
    let mut mean = MeanSeries::default();
    mean.add(&Series::read(&path)?, &path)?;
    Ok(mean)
}

pub(crate) fn write(input: &ReportInput<'_>) -> Result<Channels, CliError> {
    let channels = channels(input)?;
    let name = input.run.path.file_stem().unwrap_or_default().to_string_lossy();
    let title = format!("lazygrid simulate: {name}");
    let tables = tables(&channels, &input.run.scenario.model);
    write_page(&input.run.directory, input.run.overwrite, title, tables, || sections::all(input, &channels))?;
    Ok(channels)
}

pub(crate) fn channels(input: &ReportInput<'_>) -> Result<Channels, CliError> {
    let (model, steps) = (&input.run.scenario.model, input.run.scenario.steps);
    let runs = input.runs.iter().map(|(seed, directory)| (*seed, directory.as_path()));
    Ok(Channels::from_runs(model, steps, runs)?)
}

fn write_page(
    directory: &Path,
    overwrite: bool,
    title: String,
    tables: Vec<(&str, TableWriter<'_>)>,
    sections: impl FnOnce() -> Result<Vec<Section>, Box<dyn std::error::Error>>,
) -> Result<(), CliError> {
    let failed = |error: Box<dyn std::error::Error>| CliError::Report {
        path: directory.join("report.html"),
        reason: error.to_string(),
    };
    let document = Document { title, sections: sections().map_err(failed)? };
    let plots = document.sections.iter().flat_map(|section| &section.plots);
    let plots: Vec<_> = plots.map(|plot| (plot.name.as_str(), plot.svg.as_str())).collect();
    debug_assert!(plots.iter().all(|(name, _)| PLOTS.contains(name)), "a plot is missing from the list");
    let page = html::page(&document);
    Ok(write_report(directory, &Report { page: &page, plots, tables }, overwrite)?)
}

fn tables<'a>(channels: &'a Channels, model: &'a Model) -> Vec<(&'a str, TableWriter<'a>)> {
    let Channels { by_symbol, interference, bit_errors, .. } = channels;
    let all: [(&str, bool, TableWriter<'a>); 4] = [
        (
            "impulse-response.csv",
            model.logs_arrivals,
            Box::new(|mut out| channels.write_responses(&mut out, model)),
        ),
        (
            "by-symbol.csv",
            !by_symbol.is_empty(),
            Box::new(|mut out| channels.write_by_symbol(&mut out, model)),
        ),
        (
            "interference.csv",
            !interference.is_empty(),
            Box::new(|mut out| channels.write_interference(&mut out, model)),
        ),
        (
            "bit-errors.csv",
            !bit_errors.is_empty(),
            Box::new(|mut out| channels.write_bit_errors(&mut out, model)),
        ),
    ];
    let made = all.into_iter().filter(|(_, has_rows, _)| *has_rows);
    made.map(|(name, _, write)| (name, write)).collect()
}
