mod csv;
mod curves;
mod growth;
mod markdown;
mod peers;
mod ratios;
mod sections;
mod sweeps;
mod table;
mod transceivers;

use std::error::Error;
use std::fs;
use std::path::Path;

use lazygrid_io::write::AtomicFile;
use lazygrid_report::html;

use super::row::Results;

/// `results.json` names the adapter; the other files label engines on a software adapter.
pub fn write(results: &Results, folder: &Path) -> Result<(), Box<dyn Error>> {
    let labelled = sections::labelled(results);
    let document = sections::document(&labelled)?;
    let plots = folder.join("plots");
    let mut files = vec![
        (folder.join("results.json"), serde_json::to_string_pretty(results)?),
        (folder.join("results.csv"), csv::table(&labelled)),
        (folder.join("report.html"), html::page(&document)),
        (folder.join("results.md"), markdown::text(&document)),
    ];
    for plot in document.sections.iter().flat_map(|section| &section.plots) {
        files.push((plots.join(format!("{}.svg", plot.name)), plot.svg.clone()));
    }
    fs::create_dir_all(&plots).map_err(|e| format!("{}: cannot create: {e}", plots.display()))?;
    let mut drafts = Vec::new();
    for (path, text) in files {
        let mut draft = AtomicFile::create(path)?;
        draft.write_with(|out| out.write_all(text.as_bytes()))?;
        drafts.push(draft);
    }
    Ok(AtomicFile::commit_all(drafts)?)
}
