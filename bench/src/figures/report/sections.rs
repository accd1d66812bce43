//! Which sections the report has, and what all of them need.

use std::error::Error;

use super::super::plan::{Figure, Scale};
use super::super::row::{Results, Row, Status};
use super::document::{Cell, Document, Kind, Note, Section, Table};
use super::{growth, peers, sweeps};

/// The report of these results.
pub(super) fn document(results: &Results) -> Result<Document, Box<dyn Error>> {
    let results = &labelled(results);
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
            Figure::F5a | Figure::F5b => peers::burst(figure, &rows)?,
            Figure::Tau | Figure::Ratio | Figure::Threads => sweeps::section(figure, &rows)?,
            Figure::Memory => sweeps::memory(&rows),
        };
        section.notes.extend(remarks(&rows));
        sections.push(section);
    }
    Ok(Document { title: "lazygrid: results".to_owned(), sections })
}

/// The results, with engines on a software adapter named so.
fn labelled(results: &Results) -> Results {
    let mut results = results.clone();
    if results.environment.adapter.as_ref().is_some_and(|adapter| !adapter.is_hardware) {
        for row in &mut results.rows {
            row.engine = row.engine.replace("(GPU)", "(software GPU)");
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
            row("begun (UTC)", environment.date.clone()),
            row("took", format!("{:.1} minutes", results.seconds / 60.0)),
        ],
    };
    let text = vec![
        "Every answer was compared with the reference, by number of pairs and a checksum of the set, before its time \
         counted: naive up to 20 000 spheres, above that the plain cell list, which shares no code with the detectors. \
         Engines take turns on the same spheres, a warm-up is dropped, and times run until the pairs are in host \
         memory, in any order. All engines give exact pairs; only pairs within 4 ulp of tangency may fall either way on \
         a GPU, as the contract says, and where one did it is said."
            .to_owned(),
        format!("```sh\n{}\n```", command(results)),
    ];
    Section { title: "Machine and method".into(), text, tables: vec![table], ..Section::default() }
}

fn command(results: &Results) -> String {
    let settings = &results.settings;
    let mut command = "cargo run --release --features bullet -- figures".to_owned();
    match settings.scale {
        Scale::Smallest => command += " --smallest",
        Scale::Quick => command += " --quick",
        Scale::Full => command += &format!(" --budget-minutes {}", settings.minutes),
    }
    if settings.only.len() < Figure::ALL.len() {
        let names: Vec<&str> = settings.only.iter().map(|f| f.name()).collect();
        command += &format!(" --only {}", names.join(","));
    }
    settings.runs.map_or(command.clone(), |runs| format!("{command} --runs {runs}"))
}

fn errors(results: &Results) -> Option<Section> {
    let notes: Vec<Note> =
        results.errors().map(|row| Note { text: described(row), is_error: true }).collect();
    let text =
        vec!["These engines gave a wrong answer or failed. Nothing else about them counts.".to_owned()];
    (!notes.is_empty()).then(|| Section { title: "Errors".into(), text, notes, ..Section::default() })
}

fn described(row: &Row) -> String {
    let at = row.at.map_or_else(String::new, |at| format!(" at {at}"));
    format!("figure {}, {}, {} spheres{at}, {}: {}", row.figure, row.scene, row.n, row.engine, row.reason)
}

/// Why there is no time, once per engine and reason; and what a GPU rounded otherwise.
fn remarks(rows: &[&Row]) -> Vec<Note> {
    let mut notes: Vec<(String, &str, Status, Vec<usize>)> = vec![];
    for row in rows.iter().filter(|row| row.status != Status::Ok) {
        let reason =
            if row.status == Status::LeftOut { "left out as it would take too long" } else { &row.reason };
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

/// The pairs on which engines and the reference differ as the contract allows, engine by engine.
fn roundings<'a>(rows: &'a [&Row]) -> impl Iterator<Item = Note> + 'a {
    let most = |engine: &str| rows.iter().filter(|row| row.engine == engine).map(|row| row.tangent).max();
    let counts =
        engines(rows).into_iter().filter_map(move |engine| Some((engine, most(engine).filter(|&n| n > 0)?)));
    counts.map(|(engine, tangent)| Note {
        text: format!(
            "{engine}: up to {tangent} of a run's pairs are within 4 ulp of tangency and fell otherwise than in the \
             reference"
        ),
        is_error: false,
    })
}

/// The engines in the order of the rows.
pub(super) fn engines<'a>(rows: &[&'a Row]) -> Vec<&'a str> {
    let mut names: Vec<&str> = vec![];
    for row in rows {
        if !names.contains(&row.engine.as_str()) {
            names.push(&row.engine);
        }
    }
    names
}

/// The scenes in the order of the rows.
pub(super) fn scenes<'a>(rows: &[&'a Row]) -> Vec<&'a str> {
    let mut names: Vec<&str> = vec![];
    for row in rows {
        if !names.contains(&row.scene.as_str()) {
            names.push(&row.scene);
        }
    }
    names
}

/// The numbers of spheres, ascending.
pub(super) fn sizes(rows: &[&Row]) -> Vec<usize> {
    let mut sizes: Vec<usize> = rows.iter().map(|row| row.n).collect();
    sizes.sort_unstable();
    sizes.dedup();
    sizes
}

/// A number of spheres as it is written in tables.
pub(super) fn count(n: usize) -> String {
    match n {
        1_000_000.. if n.is_multiple_of(100_000) => format!("{} M", n as f64 / 1e6),
        1000.. if n.is_multiple_of(100) => format!("{} k", n as f64 / 1e3),
        _ => n.to_string(),
    }
}

/// Seconds with a unit and three figures.
pub(super) fn time(seconds: f64) -> String {
    let (value, unit) = match seconds {
        s if s < 1e-6 => (s * 1e9, "ns"),
        s if s < 1e-3 => (s * 1e6, "µs"),
        s if s < 1.0 => (s * 1e3, "ms"),
        s => (s, "s"),
    };
    let digits = if value < 10.0 { 2 } else { usize::from(value < 100.0) };
    format!("{value:.digits$} {unit}")
}

/// A cell for a row, by `show` where it was measured.
pub(super) fn cell(row: Option<&Row>, show: impl Fn(&Row) -> String) -> Cell {
    let (text, kind) = match row {
        None => ("–".to_owned(), Kind::Absent),
        Some(row) => match row.status {
            Status::Ok if row.wall.is_empty() => ("–".to_owned(), Kind::Absent),
            Status::Ok => (show(row), Kind::Plain),
            Status::Error => ("wrong".to_owned(), Kind::Error),
            Status::NotAvailable => ("not available".to_owned(), Kind::Absent),
            Status::LeftOut => ("left out".to_owned(), Kind::Absent),
        },
    };
    Cell { text, kind }
}

/// Marks the best of some measured cells, by what they show.
pub(super) fn mark_best(cells: &mut [Cell], rows: &[Option<&Row>], by: fn(&Row) -> f64) {
    let value = |row: &Option<&Row>| row.filter(|r| r.status == Status::Ok).map_or(f64::NAN, by);
    let values: Vec<f64> = rows.iter().map(value).collect();
    let best = values.iter().copied().fold(f64::INFINITY, f64::min);
    for (cell, value) in cells.iter_mut().zip(values) {
        if value == best && cell.kind == Kind::Plain {
            cell.kind = Kind::Best;
        }
    }
}

/// A table of mean times with one row per engine and one column per value of `columns`, the best of each marked.
pub(super) fn by_column<'a, T>(
    caption: String,
    engines: &[&str],
    columns: &[(String, T)],
    find: impl Fn(&str, &T) -> Option<&'a Row>,
    show: impl Fn(&Row) -> String,
) -> Table {
    let cells = |(_, column): &(String, T)| {
        let found: Vec<Option<&Row>> = engines.iter().map(|engine| find(engine, column)).collect();
        let mut cells: Vec<Cell> = found.iter().map(|row| cell(*row, &show)).collect();
        mark_best(&mut cells, &found, |row| row.mean().0);
        cells
    };
    let columns_of_cells: Vec<Vec<Cell>> = columns.iter().map(cells).collect();
    let row = |(k, engine): (usize, &&str)| {
        let cells = columns_of_cells.iter().map(|column| column[k].clone());
        std::iter::once(Cell::plain(*engine)).chain(cells).collect()
    };
    let names = columns.iter().map(|(name, _)| name.clone());
    Table {
        caption,
        header: std::iter::once("engine".to_owned()).chain(names).collect(),
        rows: engines.iter().enumerate().map(row).collect(),
    }
}
