use std::error::Error;

use lazygrid_report::plot::{Axes, PlotPoint, Series, lines};
use lazygrid_report::{Cell, Note, Plot, Quantity, Scale, Section, Table};
use lazygrid_results::bit_errors::BitErrors;
use lazygrid_results::channel::{Channels, link_name, spaced};
use lazygrid_results::columns::{ColumnGroup, groups};
use lazygrid_results::mean::RunningStats;
use lazygrid_sim::Model;

use super::Done;

/// Points of a line of a series, at most.
const POINTS: usize = 400;
/// Rows of a table of thresholds, at most.
const ROWS: usize = 40;

pub(super) fn all(done: &Done<'_>, channels: Option<&Channels>) -> Result<Vec<Section>, Box<dyn Error>> {
    let model = &done.run.scenario.model;
    let mut sections = vec![head(done), series(done)?];
    let Some(channels) = channels else {
        if !model.receivers.is_empty() {
            let text = "`arrivals = true` in the scenario's `[output]` adds impulse responses, inter-symbol interference \
                        and bit errors to this report.";
            sections[1].notes.push(Note { text: text.to_owned(), is_error: false });
        }
        return Ok(sections);
    };
    sections.push(responses(channels, model)?);
    if !channels.interference.is_empty() {
        sections.push(interference(channels, model)?);
    }
    if !channels.bit_errors.is_empty() {
        sections.push(bit_errors(channels, model)?);
    }
    Ok(sections)
}

fn head(done: &Done<'_>) -> Section {
    let scenario = &done.run.scenario;
    let time = f64::from(scenario.steps) * scenario.model.time_step;
    let rows = [
        ("scenario", done.run.path.display().to_string()),
        ("steps", format!("{} of {} s, {time} s in all", scenario.steps, scenario.model.time_step)),
        ("seed", scenario.seed.to_string()),
        ("replicas", done.runs.len().to_string()),
        ("lazygrid", env!("CARGO_PKG_VERSION").to_owned()),
    ];
    let rows = rows.map(|(name, value)| vec![Cell::plain(name), Cell::plain(value)]).to_vec();
    let mut text = vec![format!("```sh\n{}\n```", done.command)];
    if done.runs.len() > 1 {
        text.push("Means over replicas; bars and ± are one standard error of the mean.".to_owned());
    }
    let table = Table { header: vec!["what".into(), "value".into()], rows, ..Table::default() };
    Section { title: "The run".into(), text, tables: vec![table], ..Section::default() }
}

/// Plots each group of the series, and tabulates the last values.
fn series(done: &Done<'_>) -> Result<Section, Box<dyn Error>> {
    let (model, mean) = (&done.run.scenario.model, done.mean);
    let mut section = Section { title: "Series".into(), ..Section::default() };
    for ColumnGroup { name, axis, columns } in groups(model) {
        let line = |(colour, column): (usize, usize)| {
            let rows = (0..mean.steps.len()).step_by(mean.steps.len().div_ceil(POINTS).max(1));
            let point = |row: usize| {
                let sample = mean.row(row)[column];
                mark(mean.times[row], sample.mean(), sample.standard_error())
            };
            Series {
                name: mean.names[column].clone(),
                points: rows.map(point).collect(),
                dashed: false,
                colour,
            }
        };
        let happens = |column: &usize| (0..mean.steps.len()).any(|row| mean.row(row)[*column].mean() > 0.0);
        let all: Vec<Series> = columns.into_iter().filter(happens).enumerate().map(line).collect();
        section.plots.extend(plot((name, name), ("time, s", axis), &all)?);
    }
    if let Some(last) = mean.steps.len().checked_sub(1) {
        let row = |(name, sample): (&String, &lazygrid_results::mean::IntegerStats)| {
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
        "Which part of the particles that a transmitter releases arrives how long after their release; particles count \
         for times that lie before the end of the run. `impulse-response.csv` has the numbers."
            .to_owned(),
    );
    let mut densities = Vec::new();
    let mut sums = Vec::new();
    let mut rows = Vec::new();
    for (colour, response) in channels.responses.iter().enumerate() {
        let stretch = f64::from(response.width) * model.time_step;
        let point = |k: usize, moments: &RunningStats, by: f64, at: f64| {
            mark((k as f64 + at) * stretch, moments.mean() / by, moments.standard_error().map(|e| e / by))
        };
        let name = link_name(response.link, model);
        let density = response.parts.iter().enumerate().map(|(k, part)| point(k, part, stretch, 0.5));
        densities.push(Series { name: name.clone(), points: density.collect(), dashed: false, colour });
        let cumulative = response.cumulative.iter().enumerate().map(|(k, part)| point(k, part, 1.0, 1.0));
        sums.push(Series { name: name.clone(), points: cumulative.collect(), dashed: false, colour });
        let seen = response.cumulative.iter().rposition(|part| part.count() > 0);
        if let Some(last) = seen {
            let part = &response.cumulative[last];
            let until = (last + 1) as f64 * stretch;
            let cells = [name, format!("{until:.4} s"), written(part.mean(), part.standard_error())];
            rows.push(cells.map(Cell::plain).to_vec());
        }
    }
    let of = ("impulse-response", "Impulse response");
    section.plots.extend(plot(of, ("time since release, s", "arrivals per particle and s"), &densities)?);
    let of = ("arrived", "Part that has arrived");
    section.plots.extend(plot(of, ("time since release, s", "part of the particles"), &sums)?);
    section.tables.push(Table {
        caption: "part that has arrived".into(),
        header: vec!["way".into(), "within".into(), "part".into()],
        rows,
    });
    Ok(section)
}

fn interference(channels: &Channels, model: &Model) -> Result<Section, Box<dyn Error>> {
    let mut section = Section { title: "Inter-symbol interference".into(), ..Section::default() };
    section.text.push(
        "Which part of a symbol's particles arrives in its own slot (0), in the next one (1) and so on. What comes \
         after its own slot interferes with later symbols. `interference.csv` has the numbers."
            .to_owned(),
    );
    let (mut all, mut rows) = (Vec::new(), Vec::new());
    for (colour, own) in channels.interference.iter().enumerate() {
        let point =
            |(slot, part): (usize, &RunningStats)| mark(slot as f64, part.mean(), part.standard_error());
        let name = link_name(own.link, model);
        let points = own.by_lag.iter().enumerate().map(point).collect();
        all.push(Series { name: name.clone(), points, dashed: false, colour });
        let mut cells = vec![Cell::plain(name)];
        cells.extend(own.by_lag.iter().map(|part| Cell::plain(written(part.mean(), part.standard_error()))));
        cells.push(Cell::plain(written(own.late.mean(), own.late.standard_error())));
        rows.push(cells);
    }
    let of = ("interference", "Inter-symbol interference");
    section.plots.extend(plot(of, ("slots after the release", "part of the particles"), &all)?);
    let lags = channels.interference.first().map_or(0, |own| own.by_lag.len());
    let header = ["way".to_owned()].into_iter().chain((0..lags).map(|lag| lag.to_string()));
    section.tables.push(Table {
        caption: "part by slot, and how much of all that arrives in these slots is late".into(),
        header: header.chain(["late".to_owned()]).collect(),
        rows,
    });
    Ok(section)
}

fn bit_errors(channels: &Channels, model: &Model) -> Result<Section, Box<dyn Error>> {
    let mut section = Section { title: "Bit errors".into(), ..Section::default() };
    section.text.push(
        "A receiver counts the arrivals of the sent species in each slot, from any transmitter. On–off keying is read \
         as 1 at or above a threshold, concentration shift keying as the next higher level at or above each of several; \
         molecule shift keying as the species with the most arrivals. Slots begin with their symbols, or later by quarters \
         of a symbol's time, up to two of these; for on–off keying the first delay and the one with the fewest errors are \
         shown. `bit-errors.csv` has all delays and thresholds."
            .to_owned(),
    );
    let mut all = Vec::new();
    let ways =
        || channels.bit_errors.chunk_by(|a, b| (a.transmitter, a.receiver) == (b.transmitter, b.receiver));
    for (colour, errors) in ways().filter(|of| of[0].thresholds() == 1).flat_map(shown).enumerate() {
        let mut name = errors.name(model);
        if errors.delay > 0 {
            name += &format!(", {:.4} s later", f64::from(errors.delay) * model.time_step);
        }
        let point = |threshold: u64| {
            let (rate, _) = errors.at(&[threshold]);
            mark(threshold as f64, rate.mean(), rate.standard_error())
        };
        let points = thresholds(errors, POINTS).map(point).collect();
        all.push(Series { name: name.clone(), points, dashed: false, colour });
        section.tables.push(by_threshold(errors, &name));
        let best = errors.best();
        let (rate, wrong) = errors.at(&best);
        let text = format!(
            "{name}: fewest errors at a threshold of {}, {wrong} of {} bits, a rate of {}.",
            spaced(&best),
            errors.bits,
            written(rate.mean(), rate.standard_error())
        );
        section.notes.push(Note { text, is_error: false });
    }
    let others = ways().filter(|of| of[0].thresholds() != 1);
    section.tables.extend(others.map(|of| by_delay(of, &of[0].name(model), model)));
    let of = ("bit-errors", "Bit errors by threshold");
    section.plots.extend(plot(of, ("threshold, arrivals in a slot", "part of the bits"), &all)?);
    Ok(section)
}

fn shown(of: &[BitErrors]) -> impl Iterator<Item = &BitErrors> {
    let found = of.iter().min_by(|a, b| a.least().total_cmp(&b.least()));
    of.iter().take(1).chain(found.filter(|errors| errors.delay != of[0].delay))
}

/// A row for each delay, for several thresholds or molecule shift keying.
fn by_delay(of: &[BitErrors], name: &str, model: &Model) -> Table {
    let least = of.iter().map(BitErrors::least).fold(f64::INFINITY, f64::min);
    let row = |errors: &BitErrors| {
        let best = errors.best();
        let (rate, wrong) = errors.at(&best);
        let delay = f64::from(errors.delay) * model.time_step;
        let told = if best.is_empty() { "by species".to_owned() } else { spaced(&best) };
        let rate = written(rate.mean(), rate.standard_error());
        let is_least = errors.least() <= least;
        row_of([format!("{delay:.4} s"), told, wrong.to_string(), errors.bits.to_string(), rate], is_least)
    };
    Table {
        caption: format!(
            "{name}: by how much later slots begin, with the thresholds that leave the fewest errors"
        ),
        header: ["delay", "thresholds", "errors", "bits", "rate"].map(str::to_owned).to_vec(),
        rows: of.iter().map(row).collect(),
    }
}

fn by_threshold(errors: &BitErrors, name: &str) -> Table {
    let best = errors.best()[0];
    let row = |threshold: u64| {
        let (rate, wrong) = errors.at(&[threshold]);
        let rate = written(rate.mean(), rate.standard_error());
        row_of([threshold.to_string(), wrong.to_string(), rate], threshold == best)
    };
    let mut shown: Vec<u64> = thresholds(errors, ROWS).chain([best]).collect();
    shown.sort_unstable();
    shown.dedup();
    Table {
        caption: format!("{name}: {} bits, {} of them 1", errors.bits, errors.ones),
        header: ["threshold", "errors", "rate"].map(str::to_owned).to_vec(),
        rows: shown.into_iter().map(row).collect(),
    }
}

fn row_of<const N: usize>(cells: [String; N], is_best: bool) -> Vec<Cell> {
    let mut cells = cells.map(Cell::plain).to_vec();
    if is_best {
        cells.iter_mut().for_each(|cell| cell.kind = lazygrid_report::Kind::Best);
    }
    cells
}

fn thresholds(errors: &BitErrors, most: usize) -> impl Iterator<Item = u64> {
    let last = errors.most() + 1;
    let step = (last / most as u64 + 1) as usize;
    (0..=last).step_by(step)
}

/// A plot of these lines, if they have points, under a file's name and a title.
pub(super) fn plot(
    (name, title): (&str, &str),
    (x, y): (&str, &str),
    series: &[Series],
) -> Result<Option<Plot>, Box<dyn Error>> {
    plot_scaled((name, title), [(x, Scale::Linear), (y, Scale::Linear)], series)
}

/// A plot with these scales of its axes.
pub(super) fn plot_scaled(
    (name, title): (&str, &str),
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

/// A mean with its standard error, as far as it goes.
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
