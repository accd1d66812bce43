use std::error::Error;

use lazygrid_report::plot::{Axes, PlotPoint, Series, lines};
use lazygrid_report::{Cell, Note, Plot, Quantity, Scale, Section, Table};
use lazygrid_results::by_symbol::CountsBySymbol;
use lazygrid_results::channel::{Channels, link_name};
use lazygrid_results::columns::{ColumnGroup, groups};
use lazygrid_results::mean::{IntegerStats, RunningStats};
use lazygrid_sim::Model;

use super::ReportInput;
use super::bit_errors::bit_errors;

pub(super) const POINTS: usize = 400;

pub(super) fn all(input: &ReportInput<'_>, channels: &Channels) -> Result<Vec<Section>, Box<dyn Error>> {
    let model = &input.run.scenario.model;
    let mut sections = vec![head(input), series(input)?];
    if !model.logs_arrivals && !model.receivers.is_empty() {
        let text = "`arrivals = true` in the scenario's `[output]` adds impulse responses, inter-symbol interference and bit errors of \
                    absorbing receivers to this report.";
        sections[1].notes.push(Note { text: text.to_owned(), is_error: false });
    }
    if !channels.by_symbol.is_empty() {
        sections.push(by_symbol(channels, model)?);
    }
    if !channels.responses.is_empty() {
        sections.push(responses(channels, model)?);
    }
    if !channels.interference.is_empty() {
        sections.push(interference(channels, model)?);
    }
    if !channels.bit_errors.is_empty() {
        sections.push(bit_errors(channels, model)?);
    }
    Ok(sections)
}

fn by_symbol(channels: &Channels, model: &Model) -> Result<Section, Box<dyn Error>> {
    let mut section = Section { title: "Counts by symbol".into(), ..Section::default() };
    section.text.push(
        "Mean counts within the slots of each symbol, over slots and replicas; bars are one standard error. The bars of the series \
         above include the scatter of random symbols, these do not, except that of the symbols before. Arrivals count from the \
         beginning of a slot. `by-symbol.csv` has the numbers."
            .to_owned(),
    );
    for (file, axis, momentary) in
        [("inside-by-symbol", "inside or bound", true), ("arrivals-by-symbol", "arrived in the slot", false)]
    {
        let is_own =
            |counts: &&CountsBySymbol| model.receivers[counts.link.receiver].is_momentary() == momentary;
        let mut lines = Vec::new();
        for counts in channels.by_symbol.iter().filter(is_own) {
            for (symbol, by_time) in &counts.symbols {
                let point = |(&lag, sample): (&u32, &IntegerStats)| {
                    mark(f64::from(lag) * model.time_step, sample.mean(), sample.standard_error())
                };
                let name = format!("{}, symbol {symbol}", link_name(counts.link, model));
                let points = by_time.iter().map(point).collect();
                lines.push(Series { name, points, dashed: false, color: lines.len() });
            }
        }
        section.plots.extend(plot(file, "Counts by symbol", "time since the symbol, s", axis, &lines)?);
    }
    Ok(section)
}

fn head(input: &ReportInput<'_>) -> Section {
    let scenario = &input.run.scenario;
    let time = f64::from(scenario.steps) * scenario.model.time_step;
    let rows = [
        ("scenario", input.run.path.display().to_string()),
        ("steps", format!("{} of {} s, {time} s in all", scenario.steps, scenario.model.time_step)),
        ("seed", scenario.seed.to_string()),
        ("replicas", input.runs.len().to_string()),
        ("lazygrid", env!("CARGO_PKG_VERSION").to_owned()),
    ];
    let rows = rows.map(|(name, value)| vec![Cell::plain(name), Cell::plain(value)]).to_vec();
    let mut text = vec![format!("```sh\n{}\n```", input.command)];
    if input.runs.len() > 1 {
        text.push("Means over replicas; bars and ± are one standard error of the mean.".to_owned());
    }
    let table = Table { header: vec!["what".into(), "value".into()], rows, ..Table::default() };
    Section { title: "The run".into(), text, tables: vec![table], ..Section::default() }
}

fn series(input: &ReportInput<'_>) -> Result<Section, Box<dyn Error>> {
    let (model, mean) = (&input.run.scenario.model, input.mean);
    let mut section = Section { title: "Series".into(), ..Section::default() };
    for ColumnGroup { name, axis, columns } in groups(model) {
        let line = |(color, column): (usize, usize)| {
            let rows = (0..mean.steps.len()).step_by(mean.steps.len().div_ceil(POINTS).max(1));
            let point = |row: usize| {
                let sample = mean.row(row)[column];
                mark(mean.times[row], sample.mean(), sample.standard_error())
            };
            Series {
                name: mean.names[column].clone(),
                points: rows.map(point).collect(),
                dashed: false,
                color,
            }
        };
        let happens = |column: &usize| (0..mean.steps.len()).any(|row| mean.row(row)[*column].mean() > 0.0);
        let all: Vec<Series> = columns.into_iter().filter(happens).enumerate().map(line).collect();
        section.plots.extend(plot(name, name, "time, s", axis, &all)?);
    }
    if let Some(last) = mean.steps.len().checked_sub(1) {
        let row = |(name, sample): (&String, &IntegerStats)| {
            vec![Cell::plain(name), Cell::plain(written(sample.mean(), sample.standard_error()))]
        };
        let caption = format!("after {} s", mean.times[last]);
        let rows = mean.names.iter().zip(mean.row(last)).map(row).collect();
        section.tables.push(Table { caption, header: vec!["count".into(), "mean".into()], rows });
    }
    Ok(section)
}

fn responses(channels: &Channels, model: &Model) -> Result<Section, Box<dyn Error>> {
    let mut section = Section { title: "Impulse response".into(), ..Section::default() };
    section.text.push(
        "The fraction of the particles that arrives, or is inside, by the time since their release; particles count for \
         times that lie before the end of the run. `impulse-response.csv` has the numbers."
            .to_owned(),
    );
    let (mut densities, mut momentary) = (Vec::new(), Vec::new());
    let mut sums = Vec::new();
    let mut rows = Vec::new();
    for (color, response) in channels.responses.iter().enumerate() {
        let stretch = f64::from(response.width) * model.time_step;
        let point = |k: usize, moments: &RunningStats, by: f64, at: f64| {
            mark((k as f64 + at) * stretch, moments.mean() / by, moments.standard_error().map(|e| e / by))
        };
        let name = link_name(response.link, model);
        if model.receivers[response.link.receiver].is_momentary() {
            let points = response
                .fractions
                .iter()
                .enumerate()
                .map(|(k, fraction)| point(k, fraction, 1.0, 0.5))
                .collect();
            momentary.push(Series { name, points, dashed: false, color });
            continue;
        }
        let density =
            response.fractions.iter().enumerate().map(|(k, fraction)| point(k, fraction, stretch, 0.5));
        densities.push(Series { name: name.clone(), points: density.collect(), dashed: false, color });
        let cumulative =
            response.cumulative.iter().enumerate().map(|(k, fraction)| point(k, fraction, 1.0, 1.0));
        sums.push(Series { name: name.clone(), points: cumulative.collect(), dashed: false, color });
        let seen = response.cumulative.iter().rposition(|fraction| fraction.count() > 0);
        if let Some(last) = seen {
            let fraction = &response.cumulative[last];
            let until = (last + 1) as f64 * stretch;
            let cells = [name, format!("{until:.4} s"), written(fraction.mean(), fraction.standard_error())];
            rows.push(cells.map(Cell::plain).to_vec());
        }
    }
    let time = "time since release, s";
    let density = "arrivals per particle and s";
    section.plots.extend(plot("impulse-response", "Impulse response", time, density, &densities)?);
    let axis = "fraction of the particles";
    let title = "Impulse response: fraction inside";
    section.plots.extend(plot("impulse-response-inside", title, time, axis, &momentary)?);
    section.plots.extend(plot("arrived", "Fraction that has arrived", time, axis, &sums)?);
    section.tables.push(Table {
        caption: "fraction that has arrived".into(),
        header: vec!["link".into(), "within".into(), "fraction".into()],
        rows,
    });
    Ok(section)
}

fn interference(channels: &Channels, model: &Model) -> Result<Section, Box<dyn Error>> {
    let mut section = Section { title: "Inter-symbol interference".into(), ..Section::default() };
    section.text.push(
        "The fraction of a symbol's particles that arrives, or is inside on average, in its own slot (0), in the next one \
         (1) and so on. Later slots interfere with later symbols. `interference.csv` has the numbers."
            .to_owned(),
    );
    let (mut all, mut rows) = (Vec::new(), Vec::new());
    for (color, interference) in channels.interference.iter().enumerate() {
        let point = |(slot, fraction): (usize, &RunningStats)| {
            mark(slot as f64, fraction.mean(), fraction.standard_error())
        };
        let name = link_name(interference.link, model);
        let points = interference.by_lag.iter().enumerate().map(point).collect();
        all.push(Series { name: name.clone(), points, dashed: false, color });
        let mut cells = vec![Cell::plain(name)];
        cells.extend(
            interference
                .by_lag
                .iter()
                .map(|fraction| Cell::plain(written(fraction.mean(), fraction.standard_error()))),
        );
        cells.push(Cell::plain(written(interference.late.mean(), interference.late.standard_error())));
        rows.push(cells);
    }
    section.plots.extend(plot(
        "interference",
        "Inter-symbol interference",
        "slots after the release",
        "fraction of the particles",
        &all,
    )?);
    let lags = channels.interference.first().map_or(0, |interference| interference.by_lag.len());
    let header = ["link".to_owned()].into_iter().chain((0..lags).map(|lag| lag.to_string()));
    section.tables.push(Table {
        caption: "fraction by slot, and how much of all that arrives in these slots is late".into(),
        header: header.chain(["late".to_owned()]).collect(),
        rows,
    });
    Ok(section)
}

pub(super) fn plot(
    name: &str,
    title: &str,
    x: &str,
    y: &str,
    series: &[Series],
) -> Result<Option<Plot>, Box<dyn Error>> {
    plot_scaled(name, title, [(x, Scale::Linear), (y, Scale::Linear)], series)
}

pub(super) fn plot_scaled(
    name: &str,
    title: &str,
    [x, y]: [(&str, Scale); 2],
    series: &[Series],
) -> Result<Option<Plot>, Box<dyn Error>> {
    let axes = Axes { title, x: (x.0, Quantity::Number), y: (y.0, Quantity::Number), scales: [x.1, y.1] };
    Ok(lines(&axes, series)?.map(|svg| Plot { name: name.to_owned(), caption: String::new(), svg }))
}

pub(super) fn mark(x: f64, mean: f64, error: Option<f64>) -> PlotPoint {
    let error = error.unwrap_or(0.0);
    PlotPoint::new(x, mean, (mean - error, mean + error))
}

fn written(mean: f64, error: Option<f64>) -> String {
    match error.filter(|error| *error > 0.0) {
        _ if mean.is_nan() => "–".to_owned(),
        Some(error) => {
            let digits = (1.0 - error.log10().floor()).clamp(0.0, 9.0) as usize;
            format!("{mean:.digits$} ± {error:.digits$}")
        }
        None if mean.fract() == 0.0 => mean.to_string(),
        None => format!("{mean:.4}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mean_has_the_digits_of_its_error() {
        let cases = [
            (1.23456, Some(0.0123), "1.235 ± 0.012"),
            (5123.4, Some(37.2), "5123 ± 37"),
            (0.5, None, "0.5000"),
            (7.0, Some(0.0), "7"),
            (f64::NAN, None, "–"),
        ];
        for (mean, error, expected) in cases {
            assert_eq!(written(mean, error), expected);
        }
    }
}
