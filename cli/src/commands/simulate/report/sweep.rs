use std::error::Error;

use lazygrid_report::plot::{PlotPoint, Series};
use lazygrid_report::{Cell, Note, Scale, Section, Table};
use lazygrid_results::channel::link_name;
use lazygrid_results::response::Response;
use lazygrid_results::sweep::{BIT_ERRORS, SweepResult, SweepRow};
use lazygrid_sim::run::sweep::SweepRuns;

use super::sections::{mark, plot, plot_scaled};
use super::write_page;
use crate::error::CliError;

/// The legend holds no more.
const MAX_LINES: usize = 20;

pub(crate) fn write(
    sweep: &SweepRuns,
    rows: &[SweepRow],
    responses: &[Vec<Response>],
) -> Result<(), CliError> {
    let title = sweep.points.first().map_or_else(String::new, |point| point.run.path.display().to_string());
    let title = format!("lazygrid simulate: sweep of {title}");
    write_page(&sweep.directory, sweep.overwrites(), title, Vec::new(), || {
        let mut sections = vec![points(sweep, rows)];
        sections.extend(curves(sweep, rows)?);
        sections.extend(response_section(sweep, responses)?);
        Ok(sections)
    })
}

fn points(sweep: &SweepRuns, rows: &[SweepRow]) -> Section {
    let paths = sweep.keys.iter().map(|key| key.path.clone());
    let header = ["point".to_owned()].into_iter().chain(paths).chain(["replicas".to_owned()]);
    let row = |(k, row): (usize, &SweepRow)| {
        let cells = [k.to_string()].into_iter().chain(row.values.iter().cloned());
        cells.chain([row.replicas.to_string()]).map(Cell::plain).collect()
    };
    let table = Table {
        caption: "points".into(),
        header: header.collect(),
        rows: rows.iter().enumerate().map(row).collect(),
    };
    let text = "Each point has a directory with its scenario, its replicas and a report of its own. `sweep.csv` has all results. \
                Bars are one standard error over replicas, and 95 % intervals (Wilson) of bit error rates.";
    Section {
        title: "The sweep".into(),
        text: vec![text.to_owned()],
        tables: vec![table],
        ..Section::default()
    }
}

fn axis(rows: &[SweepRow], keys: usize) -> Option<(usize, Vec<f64>)> {
    let numbers =
        |key: usize| rows.iter().map(|row| row.values[key].parse().ok()).collect::<Option<Vec<f64>>>();
    (0..keys).find_map(|key| Some((key, numbers(key)?)))
}

fn others(sweep: &SweepRuns, values: &[String], but: usize) -> String {
    let named = sweep.keys.iter().zip(values).enumerate().filter(|&(key, _)| key != but);
    named.map(|(_, (key, value))| format!(", {} = {value}", key.path)).collect()
}

fn curves(sweep: &SweepRuns, rows: &[SweepRow]) -> Result<Option<Section>, Box<dyn Error>> {
    let Some((key, numbers)) = axis(rows, sweep.keys.len()) else { return Ok(None) };
    let x = &sweep.keys[key].path;
    let mut section = Section { title: format!("Results by {x}"), ..Section::default() };
    let results = || rows.iter().flat_map(|row| &row.results);
    let mut groups: Vec<&str> = results().map(|result| result.group).collect();
    groups.sort_unstable();
    groups.dedup();
    let mut points: Vec<(f64, &SweepRow)> = numbers.into_iter().zip(rows).collect();
    points.sort_by(|(a, _), (b, _)| a.total_cmp(b));
    for group in groups {
        let mut lines: Vec<Series> = Vec::new();
        for &(at, row) in &points {
            let shown = row.results.iter().filter(|result| result.group == group);
            for SweepResult { name, value, bounds, .. } in shown {
                let name = format!("{name}{}", others(sweep, &row.values, key));
                let point =
                    PlotPoint::new(at, *value, bounds.map_or((*value, *value), |[low, high]| (low, high)));
                match lines.iter_mut().find(|line| line.name == name) {
                    Some(line) => line.points.push(point),
                    None => {
                        lines.push(Series { name, points: vec![point], dashed: false, color: lines.len() })
                    }
                }
            }
        }
        let file = group.replace(' ', "-");
        let y = if group == BIT_ERRORS { Scale::Logarithmic } else { Scale::Linear };
        if lines.len() > MAX_LINES {
            let text =
                format!("{group}: {} curves are too many to be drawn; `sweep.csv` has them.", lines.len());
            section.notes.push(Note { text, is_error: false });
            continue;
        }
        section.plots.extend(plot_scaled(&file, group, [(x, Scale::Linear), (group, y)], &lines)?);
    }
    Ok(Some(section))
}

fn response_section(
    sweep: &SweepRuns,
    responses: &[Vec<Response>],
) -> Result<Option<Section>, Box<dyn Error>> {
    let (mut densities, mut momentary) = (Vec::new(), Vec::new());
    for ((point, values), responses) in sweep.points.iter().zip(&sweep.values).zip(responses) {
        let model = &point.run.scenario.model;
        for response in responses {
            let bin = f64::from(response.width) * model.time_step;
            let (lines, by) = match model.receivers[response.link.receiver].is_momentary() {
                true => (&mut momentary, 1.0),
                false => (&mut densities, bin),
            };
            let points = response.fractions.iter().enumerate().map(|(k, fraction)| {
                mark(
                    (k as f64 + 0.5) * bin,
                    fraction.mean() / by,
                    fraction.standard_error().map(|error| error / by),
                )
            });
            let name = format!("{}{}", link_name(response.link, model), others(sweep, values, usize::MAX));
            lines.push(Series { name, points: points.collect(), dashed: false, color: lines.len() });
        }
    }
    let mut section = Section { title: "Impulse responses".into(), ..Section::default() };
    let title = "Impulse responses of all points";
    for (file, title, axis, lines) in [
        ("impulse-responses", title.to_owned(), "arrivals per particle and s", densities),
        (
            "impulse-responses-inside",
            format!("{title}: fraction inside"),
            "fraction of the particles",
            momentary,
        ),
    ] {
        if lines.len() <= MAX_LINES {
            section.plots.extend(plot(file, &title, "time since release, s", axis, &lines)?);
        }
    }
    Ok((!section.plots.is_empty()).then_some(section))
}
