use std::error::Error;

use super::super::figure::Figure;
use super::super::row::Row;
use super::curves::{curves, logarithmic};
use super::ratios::{self, OURS, Times, peers, verdicts};
use super::table::{
    Column, best_of_columns, by_engine, by_setting, by_size, find, gpu_times, groups, mean, median, pairs,
    scenes, sizes,
};
use lazygrid_report::number::count;
use lazygrid_report::plot::{Axes, PlotPoint, Series, lines};
use lazygrid_report::{Plot, Quantity, Section, Table};

type PointOfRow = fn(&Row) -> PlotPoint;

pub(super) fn trees(rows: &[&Row]) -> Result<Section, Box<dyn Error>> {
    let mut section = Section {
        title: "Figure 4: one thread, trees with state between steps".to_owned(),
        text: vec![
            "Every sphere moves by a tenth of its radius in a random direction at each step. There are up to 100 \
             steps, fewer for slow engines; the number is in brackets. Two warm-up steps are dropped, because trees \
             write all their boxes with the margin in the second. Bullet is the library itself, with one proxy per \
             sphere that is kept: as shipped, with a margin of 0.05, and tuned, with a margin of the largest radius \
             for equal spheres and half of it for five sizes. parry3d is the usual choice of Rust programs. The \
             plain cell list, with cells chosen for the scene, is the baseline; the Verlet list, with a skin chosen \
             for the scene, keeps pairs that may soon overlap. lazygrid's cell-list searches from scratch at every \
             step; the CPU path's own choice keeps candidates if it expects this to save time."
                .to_owned(),
            "Ratios are of the total time of all steps that both ran, because a tree with a margin is slow only in \
             some steps: the boxes of Bullet tuned are all written at the start and again after spheres have moved \
             by about the margin. A run of few steps may miss this, in Bullet's favor. Above 1, lazygrid is faster."
                .to_owned(),
        ],
        ..Section::default()
    };
    for scene in scenes(rows) {
        let rows: Vec<&Row> = rows.iter().copied().filter(|row| row.scene == scene).collect();
        let columns = by_size(&rows);
        let title = format!("Figure 4: {scene}");
        let by_size = |row: &Row| PlotPoint::new(row.n as f64, row.mean().0, row.quartiles());
        let one = |row: &Row| PlotPoint::new(row.n as f64, row.mean().0, row.quartiles()).over(row.n as f64);
        let spheres = ("spheres", Quantity::Count);
        let axes = logarithmic(&title, spheres, ("mean time of a step, one thread", Quantity::Time));
        section.plots.extend(plot(&axes, &rows, format!("figure-4-{scene}"), by_size)?);
        let title = format!("Figure 4: {scene}, per sphere");
        let axes = logarithmic(&title, spheres, ("mean time of a step per sphere", Quantity::Time));
        section.plots.extend(plot(&axes, &rows, format!("figure-4-{scene}-per-sphere"), one)?);
        section.tables.push(per_sphere(scene, &rows, &columns));
        section.tables.extend(ratios::ours(&rows).map(|ours| ratios::table(scene, &rows, &columns, ours)));
        section.notes.extend(verdicts(scene, &rows, &columns));
    }
    Ok(section)
}

pub(super) fn step_length(rows: &[&Row]) -> Result<Section, Box<dyn Error>> {
    let text = "As figure 4, with steps of three lengths, in radii. The Verlet list and LAMMPS keep pairs within a \
                skin that is chosen for the length of the steps; lazygrid chooses its own. LAMMPS uses doubles and \
                also computes forces and energies, from which the number of pairs is derived; the transfer of the \
                coordinates to LAMMPS is not timed. It is included if the environment variable LAZYGRID_LAMMPS_LIB \
                is the path of its library. Ratios are of the total time of all steps that both ran.";
    let mut section = Section {
        title: "Figure 4, shorter steps: one thread, lists with a skin".to_owned(),
        text: vec![text.to_owned()],
        ..Section::default()
    };
    for (scene, n, what, rows) in groups(rows) {
        let columns = by_setting(&rows, "");
        let shown = |row: &Row| {
            PlotPoint::new(row.at.unwrap_or_default(), row.mean().0, row.quartiles()).over(row.n as f64)
        };
        let x = ("step in radii", Quantity::Number);
        let axes = logarithmic(&what, x, ("mean time of a step per sphere", Quantity::Time));
        section.plots.extend(plot(&axes, &rows, format!("figure-step-length-{scene}-{n}"), shown)?);
        section.tables.push(per_sphere(&what, &rows, &columns));
        section.tables.extend(ratios::ours(&rows).map(|ours| ratios::table(&what, &rows, &columns, ours)));
        section.notes.extend(verdicts(&what, &rows, &columns));
    }
    Ok(section)
}

pub(super) fn burst(figure: Figure, rows: &[&Row]) -> Result<Section, Box<dyn Error>> {
    let (title, text) = match figure {
        Figure::F5a => {
            ("Figure 5a: one burst over simulated time", "A burst of carriers of ten sizes from one point.")
        }
        _ => (
            "Figure 5b: bursts of several sizes at several moments",
            "Bursts as in figure 5a, with several numbers of carriers; above 1, lazygrid is faster.",
        ),
    };
    let mut section = Section { title: title.to_owned(), text: vec![text.to_owned()], ..Section::default() };
    section.text.push(super::super::burst::DESCRIPTION.to_owned());
    if figure == Figure::F5b {
        for ours in ratios::ours(rows) {
            section.plots.extend(speed_up(rows, ours)?);
        }
    }
    for n in sizes(rows) {
        let rows: Vec<&Row> = rows.iter().copied().filter(|row| row.n == n).collect();
        let columns = by_setting(&rows, "s");
        let title = format!("{} carriers", count(n));
        if figure == Figure::F5a {
            let y = ("median time of a search", Quantity::Time);
            let axes = logarithmic(&title, ("simulated time", Quantity::Time), y);
            let shown = |row: &Row| PlotPoint::new(row.at.unwrap_or_default(), row.median(), row.quartiles());
            section.plots.extend(plot(&axes, &rows, format!("figure-{figure}-{n}"), shown)?);
        }
        section.tables.push(over_time(&title, &rows, &columns));
        section.tables.extend(gpu_times(&format!("{title}: "), &rows, &columns));
        section.tables.extend(ratios::ours(&rows).map(|ours| ratios::table(&title, &rows, &columns, ours)));
        section.notes.extend(verdicts(&format!("burst of {title}"), &rows, &columns));
    }
    Ok(section)
}

fn plot(
    axes: &Axes<'_>,
    rows: &[&Row],
    name: String,
    shown: PointOfRow,
) -> Result<Option<Plot>, Box<dyn Error>> {
    let series = curves(rows, shown, |engine| !OURS.contains(&engine));
    let caption = format!(
        "{}; both axes logarithmic, lazygrid's curves solid, bars from the lower to the upper quartile.",
        axes.title
    );
    Ok(lines(axes, &series)?.map(|svg| Plot { name, caption, svg }))
}

fn speed_up(rows: &[&Row], ours: &str) -> Result<Option<Plot>, Box<dyn Error>> {
    let mut series = vec![];
    for (k, peer) in peers(rows).into_iter().enumerate() {
        for (color, moment) in by_setting(rows, "s").into_iter().enumerate() {
            let now: Vec<&Row> = rows.iter().copied().filter(|row| moment.holds(row)).collect();
            let at = |n: usize| {
                let row_of = |engine| find(&now, engine, Column::Size(n));
                let times = Times::new(row_of(peer)?, row_of(ours)?)?;
                Some(PlotPoint::new(n as f64, times.total, times.quartiles()))
            };
            let name = format!("{}, {peer}", moment.name());
            let points = sizes(&now).into_iter().filter_map(at).collect();
            series.push(Series { name, points, dashed: k > 0, color });
        }
    }
    let title = format!("{ours}: how many times as fast, by carriers and simulated time");
    let y = ("peer's time / lazygrid's", Quantity::Number);
    let axes = logarithmic(&title, ("carriers", Quantity::Count), y);
    let name: String = ours.chars().filter(|c| c.is_ascii_alphanumeric() || matches!(c, ' ' | '-')).collect();
    Ok(lines(&axes, &series)?.map(|svg| Plot {
        name: format!("figure-5b-{}", name.to_lowercase().replace(' ', "-")),
        caption: format!(
            "Speed-up of {ours} over {}, both axes logarithmic; above 1, lazygrid is faster. Ratios of total times, \
             bars from the lower to the upper quartile of single steps.",
            listed(&peers(rows))
        ),
        svg,
    }))
}

fn listed(peers: &[&str]) -> String {
    let named = |(k, peer): (usize, &&str)| match k {
        0 => format!("{peer} (solid)"),
        _ => format!("{peer} (dashed)"),
    };
    peers.iter().enumerate().map(named).collect::<Vec<_>>().join(" and ")
}

fn per_sphere(scene: &str, rows: &[&Row], columns: &[Column]) -> Table {
    let caption = format!("{scene}: mean ns per sphere and step ± standard deviation (steps run)");
    let shown = |row: &Row| mean(row, |seconds| format!("{:.0}", seconds * 1e9 / row.n as f64));
    let mut table = by_engine(caption, rows, columns, shown);
    best_of_columns(&mut table, rows, columns, |row| row.mean().0);
    table
}

fn over_time(title: &str, rows: &[&Row], columns: &[Column]) -> Table {
    let caption = format!("{title}: median wall time of a search (quartiles; steps), by simulated time");
    let mut table = by_engine(caption, rows, columns, |row| median(&row.wall));
    best_of_columns(&mut table, rows, columns, Row::median);
    table.rows.push(pairs(rows, columns));
    table
}
