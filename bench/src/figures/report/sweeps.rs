//! τ, raster ratio, threads and memory.

use std::error::Error;

use super::super::plan::Figure;
use super::super::row::{Row, Status};
use super::document::{Cell, Kind, Plot, Section, Table};
use super::plot::{Axes, Series, lines};
use super::sections::{cell, count, engines, mark_best, scenes, sizes, time};

/// τ, raster ratio or threads.
pub(super) fn section(figure: Figure, rows: &[&Row]) -> Result<Section, Box<dyn Error>> {
    let varied = figure.varied().unwrap_or_default();
    let (title, text) = heading(figure);
    let mut section = Section { title: title.to_owned(), text: vec![text.to_owned()], ..Section::default() };
    for n in sizes(rows) {
        for scene in scenes(rows) {
            let rows: Vec<&Row> = rows.iter().copied().filter(|r| r.scene == scene && r.n == n).collect();
            if rows.is_empty() {
                continue;
            }
            let what = format!("{scene}, {} spheres", count(n));
            let axes = Axes { title: &what, x: varied, y: "median seconds of a step" };
            section.plots.extend(plot(&axes, &rows, format!("{figure}-{scene}-{n}"))?);
            section.tables.push(table(figure, &what, &rows));
        }
    }
    Ok(section)
}

const fn heading(figure: Figure) -> (&'static str, &'static str) {
    match figure {
        Figure::Tau => (
            "τ of the recursive grid",
            "A cell's smaller spheres go to a finer level only when they are more than τ. Median time of a step in \
             which every sphere moves by a tenth of its radius, all threads.",
        ),
        Figure::Ratio => (
            "Raster ratio of the paper's grids",
            "Cell edge over largest diameter. Median time of a step, all threads.",
        ),
        _ => (
            "Strong scaling over threads",
            "The same spheres on more threads; in brackets how many times as fast as one thread.",
        ),
    }
}

fn plot(axes: &Axes<'_>, rows: &[&Row], name: String) -> Result<Option<Plot>, Box<dyn Error>> {
    let of = |engine: &str| {
        let measured = rows.iter().filter(|row| row.engine == engine && !row.wall.is_empty());
        measured.map(|row| (row.at.unwrap_or_default(), row.median())).collect()
    };
    let line = |(colour, engine): (usize, &str)| Series {
        name: engine.to_owned(),
        points: of(engine),
        dashed: false,
        colour,
    };
    let series: Vec<Series> = engines(rows).into_iter().enumerate().map(line).collect();
    let caption = format!("{}; both axes logarithmic.", axes.title);
    Ok(lines(axes, &series)?.map(|svg| Plot { name, caption, svg }))
}

/// One row per engine, one column per value, the best of each row marked.
fn table(figure: Figure, what: &str, rows: &[&Row]) -> Table {
    let mut values: Vec<f64> = rows.iter().filter_map(|row| row.at).collect();
    values.sort_by(f64::total_cmp);
    values.dedup();
    let row = |engine: &str| {
        let at = |value: f64| rows.iter().copied().find(|r| r.engine == engine && r.at == Some(value));
        let first = values.first().and_then(|&value| at(value)).map_or(f64::NAN, Row::median);
        let shown = |row: &Row| match figure {
            Figure::Threads => format!("{} ({:.2} ×)", time(row.median()), first / row.median()),
            _ => time(row.median()),
        };
        let found: Vec<Option<&Row>> = values.iter().map(|&value| at(value)).collect();
        let mut cells: Vec<Cell> = found.iter().map(|row| cell(*row, shown)).collect();
        mark_best(&mut cells, &found, Row::median);
        std::iter::once(Cell::plain(engine)).chain(cells).collect()
    };
    let varied = figure.varied().unwrap_or_default();
    let header = std::iter::once(format!("engine, by {varied}")).chain(values.iter().map(f64::to_string));
    Table {
        caption: what.to_owned(),
        header: header.collect(),
        rows: engines(rows).into_iter().map(row).collect(),
    }
}

/// Bytes per sphere of each engine and scene.
pub(super) fn memory(rows: &[&Row]) -> Section {
    let columns: Vec<(usize, &str)> =
        sizes(rows).into_iter().flat_map(|n| scenes(rows).into_iter().map(move |scene| (n, scene))).collect();
    let row = |engine: &str| {
        let shown = |&(n, scene): &(usize, &str)| {
            let found = rows.iter().find(|r| r.engine == engine && r.n == n && r.scene == scene);
            match found {
                Some(row) if row.status == Status::Ok => {
                    Cell::plain(row.bytes.map_or("–".to_owned(), |bytes| format!("{bytes:.0}")))
                }
                Some(row) if row.status == Status::Error => {
                    Cell { text: "wrong".to_owned(), kind: Kind::Error }
                }
                _ => Cell { text: "–".to_owned(), kind: Kind::Absent },
            }
        };
        std::iter::once(Cell::plain(engine)).chain(columns.iter().map(shown)).collect()
    };
    let names = columns.iter().map(|(n, scene)| format!("{scene}, {}", count(*n)));
    let table = Table {
        caption: "Peak bytes per sphere besides input and result".to_owned(),
        header: std::iter::once("engine".to_owned()).chain(names).collect(),
        rows: engines(rows).into_iter().map(row).collect(),
    };
    let text = "Peak resident memory of a process that does nothing else, over a few steps, less the spheres (16 bytes \
                each) and the pairs (8 bytes each); one thread.";
    Section {
        title: "Memory per sphere".to_owned(),
        text: vec![text.to_owned()],
        tables: vec![table],
        ..Section::default()
    }
}
