use std::error::Error;

use super::super::figure::Figure;
use super::super::row::Row;
use super::curves::{curves, logarithmic};
use super::table::{
    Column, by_engine, by_setting, cell, engines, find, groups, mark_best, median, scenes, sizes,
};
use lazygrid_report::number::count;
use lazygrid_report::plot::{Axes, PlotPoint, lines};
use lazygrid_report::{Cell, Note, Plot, Quantity, Section, Table};

/// Smallest speedup of more threads that counts as scaling.
const MIN_SPEEDUP: f64 = 1.05;

pub(super) fn section(figure: Figure, rows: &[&Row]) -> Result<Section, Box<dyn Error>> {
    let varied = figure.varied().unwrap_or_default();
    let (title, text) = heading(figure);
    let mut section = Section { title: title.to_owned(), text: vec![text.to_owned()], ..Section::default() };
    for (scene, n, what, rows) in groups(rows) {
        let y = ("median time of a step", Quantity::Time);
        let axes = logarithmic(&what, (varied, Quantity::Number), y);
        section.plots.extend(plot(&axes, &rows, format!("{figure}-{scene}-{n}"))?);
        section.tables.push(table(figure, &what, &rows));
        if figure == Figure::Threads {
            section.notes.extend(scaling(&what, &rows));
        }
    }
    Ok(section)
}

const fn heading(figure: Figure) -> (&'static str, &'static str) {
    match figure {
        Figure::Tau => (
            "τ of the recursive grid",
            "The smaller spheres of a cell move to a finer level only if there are more than τ. Time of a step in \
             which every sphere moves by a tenth of its radius, all threads.",
        ),
        Figure::Ratio => (
            "Cell ratio of the paper's grids",
            "Cell size over largest diameter. Time of a step, all threads.",
        ),
        _ => (
            "Strong scaling over threads",
            "The same spheres on more threads; × is the speed-up over one thread. Each search is repeated for 40 ms \
             before it is timed: threads that have just been woken may share a core for milliseconds.",
        ),
    }
}

pub(super) fn plot(axes: &Axes<'_>, rows: &[&Row], name: String) -> Result<Option<Plot>, Box<dyn Error>> {
    let point = |row: &Row| PlotPoint::new(row.at.unwrap_or_default(), row.median(), row.quartiles());
    let series = curves(rows, point, |_| false);
    let caption =
        format!("{}; both axes logarithmic, bars from the lower to the upper quartile.", axes.title);
    Ok(lines(axes, &series)?.map(|svg| Plot { name, caption, svg }))
}

fn table(figure: Figure, what: &str, rows: &[&Row]) -> Table {
    let columns = by_setting(rows, "");
    let shown = |row: &Row| {
        let text = median(&row.wall)?;
        let first = find(rows, &row.engine, *columns.first()?).filter(|first| !first.wall.is_empty());
        match (figure, first) {
            (Figure::Threads, Some(first)) => Some(format!("{text} {:.2} ×", first.median() / row.median())),
            _ => Some(text),
        }
    };
    let caption = format!("{what}: median (quartiles; steps)");
    let mut table = by_engine(caption, rows, &columns, shown);
    table.header[0] = format!("engine, by {}", figure.varied().unwrap_or_default());
    for (line, engine) in table.rows.iter_mut().zip(engines(rows)) {
        let found: Vec<Option<&Row>> = columns.iter().map(|&column| find(rows, engine, column)).collect();
        mark_best(&mut line[1..], &found, Row::median);
    }
    table
}

fn scaling(what: &str, rows: &[&Row]) -> Vec<Note> {
    let note = |engine: &str| {
        let times = by_setting(rows, "").into_iter().filter_map(|column| {
            let row = find(rows, engine, column).filter(|row| !row.wall.is_empty())?;
            Some((row.at?, row.median()))
        });
        let times: Vec<(f64, f64)> = times.collect();
        let (&(first, one), &(all, last)) = (times.first()?, times.last()?);
        (all > first).then(|| {
            let speed = one / last;
            Note {
                text: format!(
                    "{what}: {engine} is {speed:.2} × as fast on {all} threads as on {first}; {}.",
                    limit(&times)
                ),
                is_error: false,
            }
        })
    };
    engines(rows).into_iter().filter_map(note).collect()
}

/// Describes the scaling of `times`: threads and seconds, sorted by threads.
fn limit(times: &[(f64, f64)]) -> String {
    let best_after = |k: usize| times[k + 1..].iter().map(|t| t.1).fold(f64::INFINITY, f64::min);
    let stop = (0..times.len()).find(|&k| times[k].1 < MIN_SPEEDUP * best_after(k)).unwrap_or(0);
    match times[stop].0 {
        _ if stop + 1 == times.len() => "it scales up to there".to_owned(),
        1.0 => "more than one thread gains less than 5 %".to_owned(),
        threads => format!("more than {threads} threads gain less than 5 %"),
    }
}

pub(super) fn memory(rows: &[&Row]) -> Section {
    let columns: Vec<(usize, &str)> =
        sizes(rows).into_iter().flat_map(|n| scenes(rows).into_iter().map(move |scene| (n, scene))).collect();
    let row = |engine: &str| {
        let shown = |&(n, scene): &(usize, &str)| {
            let of_scene: Vec<&Row> = rows.iter().copied().filter(|row| row.scene == scene).collect();
            cell(find(&of_scene, engine, Column::Size(n)), |row| Some(format!("{:.0}", row.bytes?)))
        };
        std::iter::once(Cell::plain(engine)).chain(columns.iter().map(shown)).collect()
    };
    let names = columns.iter().map(|(n, scene)| format!("{scene}, {}", count(*n)));
    let table = Table {
        caption: "Peak bytes per sphere besides input and result".to_owned(),
        header: std::iter::once("engine".to_owned()).chain(names).collect(),
        rows: engines(rows).into_iter().map(row).collect(),
    };
    let text = "Peak resident memory of a process that does nothing else, over a few steps, less the spheres (16 \
                bytes each) and the pairs (8 bytes each); one thread.";
    Section {
        title: "Memory per sphere".to_owned(),
        text: vec![text.to_owned()],
        tables: vec![table],
        ..Section::default()
    }
}

#[cfg(test)]
mod tests {
    use super::limit;

    #[test]
    fn scaling_limit_of_threads() {
        assert_eq!(limit(&[(1.0, 8.0), (2.0, 4.0), (4.0, 2.0)]), "it scales up to there");
        assert_eq!(limit(&[(1.0, 8.0), (2.0, 4.0), (4.0, 3.9)]), "more than 2 threads gain less than 5 %");
        assert_eq!(limit(&[(1.0, 8.0), (2.0, 8.1)]), "more than one thread gains less than 5 %");
        assert_eq!(limit(&[(1.0, 8.0), (2.0, 8.1), (4.0, 2.0)]), "it scales up to there");
    }
}
