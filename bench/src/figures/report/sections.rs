use std::error::Error;

use super::super::figure::Figure;
use super::super::row::{Results, Row, Status};
use super::ratios::ON_SOFTWARE;
use super::table::engines;
use super::{growth, peers, sweeps, transceivers};
use lazygrid_report::number::count;
use lazygrid_report::{Cell, Document, Note, Section, Table};

const TOO_LONG_NOTE: &str = "left out: a run would take";

pub(super) fn document(results: &Results) -> Result<Document, Box<dyn Error>> {
    let mut sections = vec![environment(results)];
    sections.extend(errors(results));
    for figure in Figure::ALL {
        let rows: Vec<&Row> = results.rows.iter().filter(|row| row.figure == figure.name()).collect();
        if rows.is_empty() {
            continue;
        }
        let mut section = match figure {
            Figure::F3a | Figure::F3b | Figure::Point => growth::section(figure, &rows, &results.rows)?,
            Figure::F4 => peers::trees(&rows)?,
            Figure::StepLength => peers::step_length(&rows)?,
            Figure::F5a | Figure::F5b => peers::burst(figure, &rows)?,
            Figure::Transceivers | Figure::SizeRatio => transceivers::section(figure, &rows)?,
            Figure::Tau | Figure::Ratio | Figure::Threads => sweeps::section(figure, &rows)?,
            Figure::Memory => sweeps::memory(&rows),
            Figure::Species => growth::species(&rows),
        };
        section.notes.extend(remarks(&rows));
        sections.push(section);
    }
    Ok(Document { title: "lazygrid: results".to_owned(), sections })
}

pub(super) fn labelled(results: &Results) -> Results {
    let mut results = results.clone();
    if results.environment.adapter.as_ref().is_some_and(|adapter| !adapter.is_hardware) {
        for row in &mut results.rows {
            row.engine = row.engine.replace("(GPU)", ON_SOFTWARE);
        }
    }
    results
}

fn environment(results: &Results) -> Section {
    let environment = &results.environment;
    let versions: Vec<String> = environment.versions.iter().map(|(name, v)| format!("{name} {v}")).collect();
    let row = |name: &str, value: String| vec![Cell::plain(name), Cell::plain(value)];
    let table = Table {
        caption: String::new(),
        header: vec!["what".into(), "value".into()],
        rows: vec![
            row("machine", environment.machine()),
            row("GPU adapter", environment.graphics()),
            row("versions", versions.join(", ")),
            row("commit", environment.commit.clone()),
            row("start (UTC)", environment.date.clone()),
            row("duration", format!("{:.1} minutes", results.seconds / 60.0)),
        ],
    };
    let mut text = vec![
        "Every answer was compared with a reference, by number of pairs and a checksum of the set, before its time \
         was recorded. The reference is naive with species and up to 20 000 spheres; above that, it is the plain \
         cell list, which shares no code with the detectors. Engines run alternately on the same spheres, a warm-up \
         is dropped, and times end when the pairs are in host memory, in any order. All engines return exact pairs, \
         with one documented exception: on a GPU, pairs within 4 ulp of tangency may be found or missed. A note \
         lists each such difference."
            .to_owned(),
        "An engine has at most 200 runs (figure 4: 100 steps; figure 5: 10 steps per time; `--quick`: 20 and 5). \
         Slow engines have fewer; the number is in brackets. Plots are in `report.html` and, as SVG, in `plots/` of \
         the folder of results."
            .to_owned(),
    ];
    if !results.settings.command.is_empty() {
        text.push(format!("```sh\n{}\n```", results.settings.command));
    }
    if !results.missing.is_empty() {
        text.push(format!("There was no time left for {}.", results.missing.join(", ")));
    }
    Section { title: "Machine and method".into(), text, tables: vec![table], ..Section::default() }
}

fn errors(results: &Results) -> Option<Section> {
    let notes: Vec<Note> =
        results.errors().map(|row| Note { text: described(row), is_error: true }).collect();
    let text =
        vec!["These engines gave a wrong answer or failed; their other results are invalid.".to_owned()];
    (!notes.is_empty()).then(|| Section { title: "Errors".into(), text, notes, ..Section::default() })
}

fn described(row: &Row) -> String {
    let at = row.at.map_or_else(String::new, |at| format!(" at {at}"));
    format!("figure {}, {}, {} spheres{at}, {}: {}", row.figure, row.scene, row.n, row.engine, row.reason)
}

fn remarks(rows: &[&Row]) -> Vec<Note> {
    let mut notes: Vec<(String, &str, Status, Vec<usize>)> = vec![];
    for row in rows.iter().filter(|row| row.status != Status::Ok) {
        // The predicted time differs between sizes.
        let is_slow = row.status == Status::LeftOut && row.reason.starts_with(TOO_LONG_NOTE);
        let reason = if is_slow { "left out because it would take too long" } else { &row.reason };
        match notes.iter_mut().find(|(engine, why, ..)| *engine == row.engine && *why == reason) {
            Some((.., sizes)) => sizes.push(row.n),
            None => notes.push((row.engine.clone(), reason, row.status, vec![row.n])),
        }
    }
    let note = |(engine, reason, status, mut sizes): (String, &str, Status, Vec<usize>)| {
        sizes.sort_unstable();
        sizes.dedup();
        let sizes: Vec<String> = sizes.into_iter().map(count).collect();
        let what = if status == Status::NotAvailable { "not available: " } else { "" };
        Note {
            text: format!("{engine}, {} spheres: {what}{reason}", sizes.join(", ")),
            is_error: status == Status::Error,
        }
    };
    notes.into_iter().map(note).chain(roundings(rows)).collect()
}

fn roundings<'a>(rows: &'a [&Row]) -> impl Iterator<Item = Note> + 'a {
    let most = |engine: &str| rows.iter().filter(|row| row.engine == engine).map(|row| row.tangent).max();
    let counts =
        engines(rows).into_iter().filter_map(move |engine| Some((engine, most(engine).filter(|&n| n > 0)?)));
    counts.map(|(engine, tangent)| Note {
        text: format!(
            "{engine}: up to {tangent} of a run's pairs are within 4 ulp of tangency and were decided differently \
             from the reference"
        ),
        is_error: false,
    })
}
