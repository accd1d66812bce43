//! Figures 4 and 5: lazygrid beside others, and where the others are faster.

use std::error::Error;
use std::fmt;

use super::super::plan::Figure;
use super::super::row::{Row, Status};
use super::document::{Cell, Note, Plot, Section, Table};
use super::plot::{Axes, Series, lines};
use super::sections::{by_column, cell, count, engines, scenes, sizes, time};
use crate::measure::Spread;

/// Engines that are judged beside all others, by their names.
const OURS: [&str; 4] =
    ["recursive-grid", "CPU path's own choice", "lazy-grid (GPU)", "lazy-grid (software GPU)"];

/// One thread, small moves: the trees that keep their structure, and grids that are built anew.
pub(super) fn trees(rows: &[&Row]) -> Result<Section, Box<dyn Error>> {
    let mut section = Section {
        title: "Figure 4: one thread, beside trees that are kept from step to step".to_owned(),
        text: vec![
            "Every sphere moves by a tenth of its radius in a random direction at each step, up to 100 steps, fewer \
             where they take long. Bullet is the real library: one proxy per sphere, kept; as shipped, with a margin \
             of 0.05, and tuned, with a margin of 0.5 of the largest radius, for up to 30 000 equal spheres of 1. \
             parry3d is what a Rust program would take. The plain cell list is the yardstick. Ratios are of the total \
             time of all steps that both ran, as a tree with a margin is slow only now and then, when much of it is \
             written; few steps may miss that, in its favour. Above 1, lazygrid is faster."
                .to_owned(),
        ],
        ..Section::default()
    };
    for scene in scenes(rows) {
        let rows: Vec<&Row> = rows.iter().copied().filter(|row| row.scene == scene).collect();
        let title = format!("Figure 4: {scene}");
        let axes = Axes { title: &title, x: "spheres", y: "mean seconds of a step, one thread" };
        let by_size = |row: &Row| row.n as f64;
        section.plots.extend(plot(&axes, &rows, format!("figure-4-{scene}"), by_size)?);
        section.tables.push(per_sphere(scene, &rows));
        for ours in OURS {
            section.tables.extend(ratios(scene, &rows, ours));
        }
        section.notes.extend(verdicts(scene, &rows));
    }
    Ok(section)
}

/// Figure 5: one table of times, one of speed-ups, per burst.
pub(super) fn burst(figure: Figure, rows: &[&Row]) -> Result<Section, Box<dyn Error>> {
    let (title, text) = match figure {
        Figure::F5a => {
            ("Figure 5a: one burst over simulated time", "A burst of carriers of ten sizes from one point.")
        }
        _ => (
            "Figure 5b: bursts of several sizes at several moments",
            "Bursts as in figure 5a of several numbers of carriers; above 1, lazygrid is faster.",
        ),
    };
    let mut section = Section { title: title.to_owned(), text: vec![text.to_owned()], ..Section::default() };
    section.text.push(super::super::burst::DESCRIPTION.to_owned());
    for n in sizes(rows) {
        let rows: Vec<&Row> = rows.iter().copied().filter(|row| row.n == n).collect();
        let title = format!("{} carriers", count(n));
        let axes = Axes { title: &title, x: "simulated time", y: "mean seconds of a search" };
        let by_time = |row: &Row| row.at.unwrap_or_default();
        section.plots.extend(plot(&axes, &rows, format!("figure-{figure}-{n}"), by_time)?);
        section.tables.push(over_time(&title, &rows));
        for ours in OURS {
            section.tables.extend(speed_up(&title, &rows, ours));
        }
        section.notes.extend(verdicts(&format!("burst of {title}"), &rows));
    }
    Ok(section)
}

fn plot(
    axes: &Axes<'_>,
    rows: &[&Row],
    name: String,
    x: impl Fn(&Row) -> f64,
) -> Result<Option<Plot>, Box<dyn Error>> {
    let of = |engine: &str| {
        let points = rows.iter().filter(|row| row.engine == engine && !row.wall.is_empty());
        points.map(|row| (x(row), row.mean().0)).collect()
    };
    let series: Vec<Series> = engines(rows)
        .into_iter()
        .enumerate()
        .map(|(colour, engine)| Series {
            name: engine.to_owned(),
            points: of(engine),
            dashed: !OURS.contains(&engine),
            colour,
        })
        .collect();
    let caption = format!("{}; both axes logarithmic, lazygrid's own solid.", axes.title);
    Ok(lines(axes, &series)?.map(|svg| Plot { name, caption, svg }))
}

fn find<'a>(rows: &[&'a Row], engine: &str, n: usize) -> Option<&'a Row> {
    rows.iter().copied().find(|row| row.engine == engine && row.n == n)
}

/// Nanoseconds per sphere and step.
fn per_sphere(scene: &str, rows: &[&Row]) -> Table {
    let (engines, sizes) = (engines(rows), sizes(rows));
    let shown = |row: &Row| format!("{:.0} ({})", row.mean().0 * 1e9 / row.n as f64, row.wall.len());
    by_column(
        format!("{scene}: mean ns per sphere and step (steps run)"),
        &engines,
        &sizes.iter().map(|&n| (count(n), n)).collect::<Vec<_>>(),
        |engine, &n| find(rows, engine, n),
        shown,
    )
}

/// How many times as fast `ours` is, step by step.
fn ratios(scene: &str, rows: &[&Row], ours: &str) -> Option<Table> {
    let sizes = sizes(rows);
    rows.iter().find(|row| row.engine == ours)?;
    let peers = engines(rows).into_iter().filter(|engine| !OURS.contains(engine));
    let row = |peer: &str| {
        let ratio = |n: &usize| {
            cell(find(rows, peer, *n), |peer| {
                find(rows, ours, *n)
                    .and_then(|ours| over(peer, ours))
                    .map_or("–".to_owned(), |r| r.to_string())
            })
        };
        std::iter::once(Cell::plain(peer)).chain(sizes.iter().map(ratio)).collect()
    };
    Some(Table {
        caption: format!("{scene}: {ours} is this many times as fast as (range of single steps)"),
        header: std::iter::once("peer".to_owned()).chain(sizes.iter().map(|&n| count(n))).collect(),
        rows: peers.map(row).collect(),
    })
}

/// How many times as long `peer` took as `ours`.
struct Times {
    /// In all the steps that both ran: a tree that is written only now and then is slow only now and then.
    total: f64,
    by_step: Spread,
}

impl fmt::Display for Times {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.2} ({:.2}–{:.2})", self.total, self.by_step.low, self.by_step.high)
    }
}

fn over(peer: &Row, ours: &Row) -> Option<Times> {
    let both = || peer.wall.iter().zip(&ours.wall);
    let ratios: Vec<f64> = both().map(|(p, o)| p / o).collect();
    let (theirs, mine) = both().fold((0.0, 0.0), |(theirs, mine), (p, o)| (theirs + p, mine + o));
    (!ratios.is_empty()).then(|| Times { total: theirs / mine, by_step: Spread::of(&ratios) })
}

/// A sentence for each place where somebody else is faster than lazygrid, or one that says that nobody is.
fn verdicts(what: &str, rows: &[&Row]) -> Vec<Note> {
    let mut notes = vec![];
    let mut judged = vec![];
    for ours in rows.iter().filter(|row| OURS.contains(&row.engine.as_str()) && !row.wall.is_empty()) {
        if !judged.contains(&ours.engine.as_str()) {
            judged.push(ours.engine.as_str());
        }
        let same = |peer: &&&Row| peer.n == ours.n && peer.at == ours.at && peer.status == Status::Ok;
        for peer in rows.iter().filter(same).filter(|peer| !OURS.contains(&peer.engine.as_str())) {
            let Some(ratio) = over(peer, ours) else { continue };
            if ratio.total < 1.0 {
                let at = ours.at.map_or_else(String::new, |at| format!(" at {at} s"));
                // A burst already says how many there are.
                let n = if at.is_empty() { format!(", {}", count(ours.n)) } else { String::new() };
                let (peer, times) = (&peer.engine, 1.0 / ratio.total);
                let ours = &ours.engine;
                notes.push(format!("{what}{n}{at}: {peer} is {times:.2} × as fast as {ours}."));
            }
        }
    }
    if notes.is_empty() && !judged.is_empty() {
        notes.push(format!("{what}: no peer that was measured is faster than {}.", judged.join(" or ")));
    }
    notes.into_iter().map(|text| Note { text, is_error: false }).collect()
}

/// Times by simulated time, and how many pairs there are.
fn over_time(title: &str, rows: &[&Row]) -> Table {
    let moments = moments(rows);
    let mut table = by_column(
        format!("{title}: mean time of a search, by simulated time"),
        &engines(rows),
        &moments,
        |engine, &at| rows.iter().copied().find(|row| row.engine == engine && row.at == Some(at)),
        |row| time(row.mean().0),
    );
    let pairs = |&(_, at): &(String, f64)| {
        let found = rows.iter().find(|row| row.at == Some(at) && row.status == Status::Ok);
        Cell::plain(found.map_or("–".to_owned(), |row| row.pairs.to_string()))
    };
    table.rows.push(std::iter::once(Cell::plain("(pairs)")).chain(moments.iter().map(pairs)).collect());
    table
}

/// How many times as fast `ours` is, by simulated time.
fn speed_up(title: &str, rows: &[&Row], ours: &str) -> Option<Table> {
    let at = |engine: &str, at: f64| rows.iter().copied().find(|r| r.engine == engine && r.at == Some(at));
    rows.iter().find(|row| row.engine == ours && !row.wall.is_empty())?;
    let moments = moments(rows);
    let ratio = |peer: &Row, moment: f64| Some(over(peer, at(ours, moment)?)?.to_string());
    let row = |peer: &str| {
        let cells = moments.iter().map(|&(_, moment)| {
            cell(at(peer, moment), |peer| ratio(peer, moment).unwrap_or_else(|| "–".to_owned()))
        });
        std::iter::once(Cell::plain(peer)).chain(cells).collect()
    };
    let names = moments.iter().map(|(name, _)| name.clone());
    Some(Table {
        caption: format!("{title}: {ours} is this many times as fast as (range of single steps)"),
        header: std::iter::once("peer".to_owned()).chain(names).collect(),
        rows: engines(rows).into_iter().filter(|engine| !OURS.contains(engine)).map(row).collect(),
    })
}

fn moments(rows: &[&Row]) -> Vec<(String, f64)> {
    let mut moments: Vec<f64> = rows.iter().filter_map(|row| row.at).collect();
    moments.sort_by(f64::total_cmp);
    moments.dedup();
    moments.into_iter().map(|at| (format!("{at} s"), at)).collect()
}
