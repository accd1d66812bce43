mod bit_errors;
mod sections;
pub(super) mod sweep;

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use lazygrid_report::{Document, Section, html};
use lazygrid_results::channel::Channels;
use lazygrid_results::mean::MeanSeries;
use lazygrid_results::series::Series;
use lazygrid_sim::run::Run;
use lazygrid_sim::{Model, write_atomically, write_report};

use crate::error::CliError;

pub(crate) struct Done<'a> {
    /// `run` has the directory of the report.
    pub(crate) run: &'a Run,
    pub(crate) mean: &'a MeanSeries,
    pub(crate) runs: Vec<(u64, PathBuf)>,
    pub(crate) command: String,
}

pub(crate) fn of_one(run: &Run) -> Result<MeanSeries, CliError> {
    let path = run.directory.join("series.csv");
    let mut mean = MeanSeries::default();
    mean.add(&Series::read(&path)?, &path)?;
    Ok(mean)
}

/// Returns the tables of channels, which it writes with `report.html` and its plots.
pub(crate) fn write(done: &Done<'_>) -> Result<Channels, CliError> {
    let channels = channels(done)?;
    let name = done.run.path.file_stem().unwrap_or_default().to_string_lossy();
    let title = format!("lazygrid simulate: {name}");
    // It refuses plots of others before tables are replaced.
    write_page(done.run.overwrite, &done.run.directory, title, || sections::all(done, &channels))?;
    tables(&channels, &done.run.scenario.model, &done.run.directory)?;
    Ok(channels)
}

pub(crate) fn channels(done: &Done<'_>) -> Result<Channels, CliError> {
    let (model, steps) = (&done.run.scenario.model, done.run.scenario.steps);
    let runs = done.runs.iter().map(|(seed, directory)| (*seed, directory.as_path()));
    Ok(Channels::of(model, steps, runs)?)
}

fn write_page(
    overwrite: bool,
    directory: &Path,
    title: String,
    sections: impl FnOnce() -> Result<Vec<Section>, Box<dyn std::error::Error>>,
) -> Result<(), CliError> {
    let failed = |error: Box<dyn std::error::Error>| CliError::Report {
        path: directory.join("report.html"),
        reason: error.to_string(),
    };
    let document = Document { title, sections: sections().map_err(failed)? };
    let plots = document.sections.iter().flat_map(|section| &section.plots);
    let plots: Vec<_> = plots.map(|plot| (plot.name.as_str(), plot.svg.as_str())).collect();
    Ok(write_report(directory, &html::page(&document), &plots, overwrite)?)
}

fn tables(channels: &Channels, model: &Model, directory: &Path) -> Result<(), lazygrid_sim::Error> {
    let table = |name: &str, is_empty: bool, content: &dyn Fn(&mut dyn Write) -> std::io::Result<()>| {
        let path = directory.join(name);
        match is_empty {
            // An earlier report may have had it.
            true if path.exists() => {
                fs::remove_file(&path).map_err(|source| lazygrid_sim::Error::Write { path, source })
            }
            true => Ok(()),
            false => write_atomically(&path, |out| content(out)),
        }
    };
    let Channels { by_symbol, interference, bit_errors, .. } = channels;
    table("impulse-response.csv", !model.logs_arrivals, &|mut out| {
        channels.write_responses(&mut out, model)
    })?;
    table("by-symbol.csv", by_symbol.is_empty(), &|mut out| channels.write_by_symbol(&mut out, model))?;
    table("interference.csv", interference.is_empty(), &|mut out| {
        channels.write_interference(&mut out, model)
    })?;
    table("bit-errors.csv", bit_errors.is_empty(), &|mut out| channels.write_bit_errors(&mut out, model))
}
