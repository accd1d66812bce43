//! Figures 3a and 3b, and the burst at one point: time against the number of spheres.

use std::error::Error;

use super::super::fit::exponent;
use super::super::plan::Figure;
use super::super::row::{Row, Status};
use super::document::{Cell, Plot, Section, Table};
use super::plot::{Axes, Series, lines};
use super::sections::{by_column, cell, count, engines, sizes, time};
use crate::measure::Spread;

/// Below this many spheres fixed costs hide how time grows.
const FIT_FROM: usize = 1000;

/// One of these figures. `all` are the rows of all figures.
pub(super) fn section(figure: Figure, rows: &[&Row], all: &[Row]) -> Result<Section, Box<dyn Error>> {
    let equal: Vec<&Row> = match figure {
        Figure::F3b => all.iter().filter(|row| row.figure == Figure::F3a.name()).collect(),
        _ => vec![],
    };
    let (title, text) = heading(figure);
    let mut series = series(rows, false);
    series.extend(self::series(&equal, true));
    let axes = Axes { title, x: "spheres", y: "mean seconds of a run" };
    let plots = lines(&axes, &series)?.map(|svg| Plot {
        name: format!("figure-{figure}"),
        caption: "Both axes logarithmic; wall time until the pairs are in host memory.".to_owned(),
        svg,
    });
    let mut tables = vec![means(rows)];
    tables.extend(gpu_times(rows));
    tables.extend((!equal.is_empty()).then(|| beside_equal(rows, &equal)));
    tables.extend(phases(rows));
    Ok(Section {
        title: title.to_owned(),
        text: vec![text.to_owned()],
        plots: plots.into_iter().collect(),
        tables,
        notes: vec![],
    })
}

const fn heading(figure: Figure) -> (&'static str, &'static str) {
    match figure {
        Figure::F3b => (
            "Figure 3b: five sizes",
            "Radii 1, ½ … 1⁄16, equally frequent, centres uniform in a ball of which the spheres fill 5 %. Each run has \
             another sample. Dashed in the plot: equal sizes, from figure 3a.",
        ),
        Figure::Point => (
            "All spheres at one point",
            "Ten sizes, every sphere touching every other: nothing can be faster than writing n(n−1)/2 pairs.",
        ),
        _ => (
            "Figure 3a: equal sizes",
            "Radius 1, centres uniform in a ball of which the spheres fill 5 %. Each run has another sample; all \
             threads of the machine.",
        ),
    }
}

fn series(rows: &[&Row], dashed: bool) -> Vec<Series> {
    let of = |engine: &str| {
        let points = rows.iter().filter(|row| row.engine == engine && row.status == Status::Ok);
        points.map(|row| (row.n as f64, row.mean().0)).collect()
    };
    let name = |engine: &str| if dashed { format!("{engine}, equal") } else { engine.to_owned() };
    let engines = engines(rows).into_iter().enumerate();
    engines.map(|(colour, e)| Series { name: name(e), points: of(e), dashed, colour }).collect()
}

fn find<'a>(rows: &[&'a Row], engine: &str, n: usize) -> Option<&'a Row> {
    rows.iter().copied().find(|row| row.engine == engine && row.n == n)
}

/// Mean and standard deviation, and the exponent of growth.
fn means(rows: &[&Row]) -> Table {
    let (engines, sizes) = (engines(rows), sizes(rows));
    let shown = |row: &Row| {
        let (mean, sd) = row.mean();
        format!("{} ± {:.0} % ({})", time(mean), 100.0 * sd / mean, row.wall.len())
    };
    let fitted = |engine: &str| {
        let points = rows.iter().filter(|row| row.engine == engine && row.status == Status::Ok);
        let points: Vec<(usize, f64)> = points.map(|row| (row.n, row.median())).collect();
        exponent(&points, FIT_FROM).map_or_else(|| "–".to_owned(), |k| format!("{k:.2}"))
    };
    let columns: Vec<(String, usize)> = sizes.iter().map(|&n| (count(n), n)).collect();
    let caption = format!(
        "Mean wall time of a run ± standard deviation (runs), and k fitted from {FIT_FROM} spheres on"
    );
    let mut table = by_column(caption, &engines, &columns, |e, &n| find(rows, e, n), shown);
    table.header.push("growth nᵏ".to_owned());
    for (row, engine) in table.rows.iter_mut().zip(engines) {
        row.push(Cell::plain(fitted(engine)));
    }
    table
}

/// By the GPU's own clock, where it has one.
fn gpu_times(rows: &[&Row]) -> Option<Table> {
    let timed: Vec<&Row> = rows.iter().copied().filter(|row| !row.gpu.is_empty()).collect();
    let sizes = sizes(&timed);
    let row = |engine: &str| {
        let shown = |n: &usize| cell(find(&timed, engine, *n), |row| time(Spread::of(&row.gpu).median));
        std::iter::once(Cell::plain(engine)).chain(sizes.iter().map(shown)).collect()
    };
    let header = std::iter::once("engine".to_owned()).chain(sizes.iter().map(|&n| count(n)));
    (!timed.is_empty()).then(|| Table {
        caption: "Median GPU time of a run, by the GPU's own clock, without transfers".to_owned(),
        header: header.collect(),
        rows: engines(&timed).into_iter().map(row).collect(),
    })
}

/// Five sizes over one.
fn beside_equal(rows: &[&Row], equal: &[&Row]) -> Table {
    let sizes = sizes(rows);
    let row = |engine: &str| {
        let ratio = |n: &usize| {
            cell(find(rows, engine, *n), |row| match find(equal, engine, *n) {
                Some(one) if !one.wall.is_empty() => format!("{:.2}", row.median() / one.median()),
                _ => "–".to_owned(),
            })
        };
        std::iter::once(Cell::plain(engine)).chain(sizes.iter().map(ratio)).collect()
    };
    Table {
        caption: "Median time with five sizes over that with equal ones".to_owned(),
        header: std::iter::once("engine".to_owned()).chain(sizes.iter().map(|&n| count(n))).collect(),
        rows: engines(rows).into_iter().map(row).collect(),
    }
}

/// Where the time goes, at the largest size of each engine.
fn phases(rows: &[&Row]) -> Option<Table> {
    let mut cells = vec![];
    for engine in engines(rows) {
        let measured = rows.iter().filter(|row| row.engine == engine && !row.phases.is_empty());
        let Some(row) = measured.max_by_key(|row| row.n) else { continue };
        let phases: Vec<String> = row.phases.iter().map(|(name, t)| format!("{name} {}", time(*t))).collect();
        cells.push(vec![Cell::plain(engine), Cell::plain(count(row.n)), Cell::plain(phases.join(", "))]);
    }
    (!cells.is_empty()).then(|| Table {
        caption: "Median time of each phase at the engine's largest size".to_owned(),
        header: ["engine", "spheres", "phases"].map(str::to_owned).into(),
        rows: cells,
    })
}
