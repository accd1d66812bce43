//! What a run leaves for people: `results.json`, `results.csv`, plots, `report.html` and `RESULTS.md`.

mod csv;
mod document;
mod growth;
mod html;
mod markdown;
mod peers;
mod plot;
mod sections;
mod sweeps;

use std::error::Error;
use std::fs;
use std::path::Path;

use super::row::Results;

/// Writes everything into `folder`.
///
/// # Errors
/// Where a file cannot be written.
pub fn write(results: &Results, folder: &Path) -> Result<(), Box<dyn Error>> {
    let document = sections::document(results)?;
    let plots = folder.join("plots");
    let mut files = vec![
        (folder.join("results.json"), serde_json::to_string_pretty(results)?),
        (folder.join("results.csv"), csv::table(results)),
        (folder.join("report.html"), html::page(&document)),
        (folder.join("RESULTS.md"), markdown::text(&document)),
    ];
    for plot in document.sections.iter().flat_map(|section| &section.plots) {
        files.push((plots.join(format!("{}.svg", plot.name)), plot.svg.clone()));
    }
    fs::create_dir_all(&plots).map_err(|e| format!("{}: cannot create: {e}", plots.display()))?;
    for (path, text) in files {
        fs::write(&path, text).map_err(|e| format!("{}: cannot write: {e}", path.display()))?;
    }
    Ok(())
}
