use std::error::Error;

use lazygrid::gpu;

use super::super::figure::Figure;
use super::super::fit::exponent;
use super::super::row::{Row, Status};
use super::curves::{curves, logarithmic};
use super::table::{Column, best_of_columns, by_engine, by_size, engines, find, gpu_times, mean};
use crate::SpeciesScene;
use lazygrid_report::number::{count, time};
use lazygrid_report::plot::{PlotPoint, Series, lines};
use lazygrid_report::{Cell, Plot, Quantity, Section, Table};

/// Smallest input of a fit; fixed costs hide the growth of smaller ones.
const FIT_FROM: usize = 1000;

pub(super) fn section(figure: Figure, rows: &[&Row], all: &[Row]) -> Result<Section, Box<dyn Error>> {
    let equal: Vec<&Row> = match figure {
        Figure::F3b => all.iter().filter(|row| row.figure == Figure::F3a.name()).collect(),
        _ => vec![],
    };
    let (title, text) = heading(figure);
    let plots = plots(figure, rows, &equal)?;
    let columns = by_size(rows);
    let mut tables = vec![means(rows, &columns)];
    tables.extend(gpu_times("By number of spheres: ", rows, &columns));
    tables.extend((!equal.is_empty()).then(|| relative_to_equal(rows, &equal, &columns)));
    tables.extend(phases(rows));
    Ok(Section { title: title.to_owned(), text: vec![text.to_owned()], plots, tables, notes: vec![] })
}

pub(super) fn species(rows: &[&Row]) -> Section {
    let table = |scene: SpeciesScene| {
        let scene_rows: Vec<&Row> = rows.iter().copied().filter(|row| row.scene == scene.name()).collect();
        let table = means(&scene_rows, &by_size(&scene_rows));
        Table { caption: format!("{}: {}", scene.name(), table.caption), ..table }
    };
    let text = "Spheres of equal size. `rare-partner`: a burst of one species, with one sphere in a thousand of its \
                only partner; `distant-partner`: a crowd that pairs within a diameter, with one in a thousand of a \
                partner within a thousand diameters; `enzymes`: one among 25 substrate molecules each, all within a \
                few diameters; `target`: one in a crowd of its only partner; `ring`: four species that each pair \
                with two others, 5 % filling; `all-pair`: the same, all of which pair; `disjoint-pairs`: three \
                disjoint pairs of species, 5 % filling; `disjoint-pairs-crowd`: the same pairs, all within a few \
                diameters; `ten-species`: a burst of one of ten species in five disjoint pairs, with one sphere in a \
                thousand of the others.";
    Section {
        title: "Species that rarely pair".to_owned(),
        text: vec![text.to_owned()],
        tables: SpeciesScene::ALL.map(table).into(),
        ..Section::default()
    }
}

const fn heading(figure: Figure) -> (&'static str, &'static str) {
    match figure {
        Figure::F3b => (
            "Figure 3b: five sizes",
            "Radii 1, ½ … 1⁄16, equally frequent, centers uniform in a ball of which the spheres fill 5 %. Each run \
             has a new sample.",
        ),
        Figure::Point => (
            "All spheres at one point",
            "Ten sizes; every sphere touches every other, so the lower bound is the time to write n(n−1)/2 pairs.",
        ),
        _ => (
            "Figure 3a: equal sizes",
            "Radius 1, centers uniform in a ball of which the spheres fill 5 %. Each run has a new sample; all \
             threads of the machine.",
        ),
    }
}

fn plots(figure: Figure, rows: &[&Row], equal: &[&Row]) -> Result<Vec<Plot>, Box<dyn Error>> {
    let (title, _) = heading(figure);
    let (unit, divisor): (_, fn(&Row) -> f64) = match figure {
        Figure::Point => ("pair", |row| row.pairs as f64),
        _ => ("sphere", |row| row.n as f64),
    };
    let dashed = if equal.is_empty() { "" } else { " Dashed: equal sizes, from figure 3a." };
    let plot = |name: String, what: &str, caption: &str, divisor: fn(&Row) -> f64| {
        let point =
            |row: &Row| PlotPoint::new(row.n as f64, row.mean().0, row.quartiles()).over(divisor(row));
        let mut series = curves(rows, point, |_| false);
        let equal = curves(equal, point, |_| true).into_iter();
        series.extend(equal.map(|curve| Series { name: format!("{}, equal", curve.name), ..curve }));
        let axes = logarithmic(title, ("spheres", Quantity::Count), (what, Quantity::Time));
        let caption =
            format!("{caption} Bars from the lower to the upper quartile, both axes logarithmic.{dashed}");
        Ok::<_, Box<dyn Error>>(lines(&axes, &series)?.map(|svg| Plot { name, caption, svg }))
    };
    let whole = plot(
        format!("figure-{figure}"),
        "mean time of a run",
        "Wall time until the pairs are in host memory.",
        |_| 1.0,
    )?;
    let per_unit = plot(
        format!("figure-{figure}-per-{unit}"),
        &format!("mean time per {unit}"),
        &format!(
            "The same times per {unit}: a time in proportion to the number of {unit}s is a horizontal line."
        ),
        divisor,
    )?;
    Ok(whole.into_iter().chain(per_unit).collect())
}

fn means(rows: &[&Row], columns: &[Column]) -> Table {
    let fitted = |engine: &str| {
        let points = rows.iter().filter(|row| row.engine == engine && row.status == Status::Ok);
        let points = points.filter(|row| row.n >= FIT_FROM).map(|row| (row.n as f64, row.median()));
        exponent(points).map_or_else(|| "–".to_owned(), |k| format!("{k:.2}"))
    };
    let caption = format!(
        "Mean wall time of a run ± standard deviation (runs); k is fitted to the medians of at least {FIT_FROM} spheres"
    );
    let mut table = by_engine(caption, rows, columns, |row| mean(row, time));
    best_of_columns(&mut table, rows, columns, |row| row.mean().0);
    table.header.push("growth nᵏ".to_owned());
    for (line, engine) in table.rows.iter_mut().zip(engines(rows)) {
        line.push(Cell::plain(fitted(engine)));
    }
    table
}

fn relative_to_equal(rows: &[&Row], equal: &[&Row], columns: &[Column]) -> Table {
    let ratio = |row: &Row| {
        let one = find(equal, &row.engine, Column::Size(row.n)).filter(|one| !one.wall.is_empty())?;
        Some(format!("{:.2}", row.median() / one.median()))
    };
    by_engine("Median time with five sizes relative to equal sizes".to_owned(), rows, columns, ratio)
}

fn phases(rows: &[&Row]) -> Option<Table> {
    let mut cells = vec![];
    for engine in engines(rows) {
        let measured = rows.iter().filter(|row| row.engine == engine && !row.phases.is_empty());
        let Some(row) = measured.max_by_key(|row| row.n) else { continue };
        cells.push(vec![Cell::plain(engine), Cell::plain(count(row.n)), Cell::plain(listed(&row.phases))]);
    }
    (!cells.is_empty()).then(|| Table {
        caption: "Median time of each phase at the engine's largest size".to_owned(),
        header: ["engine", "spheres", "phases"].map(str::to_owned).into(),
        rows: cells,
    })
}

/// GPU phases are part of the phase in which the host waits.
fn listed(phases: &[(String, f64)]) -> String {
    let has_waited = phases.iter().any(|(name, _)| name == "wait");
    let on_device = |name: &str| has_waited && gpu::GpuPhase::ALL.iter().any(|phase| phase.name() == name);
    let shown = |device: bool| {
        let selected = phases.iter().filter(move |(name, _)| on_device(name) == device);
        selected.map(|(name, seconds)| (name.as_str(), format!("{name} {}", time(*seconds))))
    };
    let device: Vec<String> = shown(true).map(|(_, text)| text).collect();
    let host = shown(false).map(|(name, text)| match name {
        "wait" if !device.is_empty() => format!("{text} (of which {})", device.join(", ")),
        _ => text,
    });
    host.collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::listed;

    #[test]
    fn gpu_phases_are_listed_within_the_wait() {
        let phases = |names: &[&str]| listed(&names.iter().map(|&n| (n.to_owned(), 1.0)).collect::<Vec<_>>());
        assert_eq!(
            phases(&["upload", "wait", "survey", "search", "read"]),
            "upload 1.00 s, wait 1.00 s (of which survey 1.00 s, search 1.00 s), read 1.00 s"
        );
        assert_eq!(phases(&["survey", "search"]), "survey 1.00 s, search 1.00 s");
    }
}
