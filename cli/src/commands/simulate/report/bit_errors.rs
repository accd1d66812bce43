use std::error::Error;

use lazygrid_report::plot::{PlotPoint, Series};
use lazygrid_report::{Cell, Note, Scale, Section, Table};
use lazygrid_results::bit_errors::{BitErrors, SymbolDetector};
use lazygrid_results::channel::{Channels, spaced};
use lazygrid_sim::Model;

use super::sections::{POINTS, plot_scaled};

/// Maximum rows of a table of thresholds.
const ROWS: usize = 40;

pub(super) fn bit_errors(channels: &Channels, model: &Model) -> Result<Section, Box<dyn Error>> {
    let mut section = Section { title: "Bit errors".into(), ..Section::default() };
    section.text.push(
        "An absorbing receiver counts the arrivals in each slot, of the species that are sent and from any transmitter. A receiver with \
         a momentary count looks at it in each row of the series: at its peak, at its energy (the sum of squares) and at its strength \
         (the sum). In on–off keying a slot reads as 1 if its count reaches the threshold; in concentration shift keying each \
         threshold that it reaches raises the level by one; in molecule shift keying the species with the most counts wins. Slots \
         begin with their symbols, or later by quarters of a symbol's time, up to two of these. Bars are 95 % intervals (Wilson), with errors of successive bits taken as \
         independent. Thresholds are the best for these very bits, so rates are a little too low if bits are few. `bit-errors.csv` has \
         all delays, and all thresholds at which errors may change."
            .to_owned(),
    );
    let (mut by_delay, mut by_threshold) = (Vec::new(), Vec::new());
    let same = |a: &BitErrors, b: &BitErrors| {
        (a.transmitter, a.receiver, a.detector) == (b.transmitter, b.receiver, b.detector)
    };
    for (color, all) in channels.bit_errors.chunk_by(same).enumerate() {
        let name = all[0].name(model);
        let point = |errors: &BitErrors| {
            rate_point(f64::from(errors.delay) * model.time_step, errors, errors.at(&errors.best()).1)
        };
        let points = all.iter().map(point).collect();
        by_delay.push(Series { name: name.clone(), points, dashed: false, color });
        section.tables.push(table_by_delay(all, &name, model));
        if (all[0].thresholds(), all[0].detector) == (1, SymbolDetector::Arrivals) {
            for errors in shown(all) {
                let mut name = name.clone();
                if errors.delay > 0 {
                    name += &format!(", {:.4} s later", f64::from(errors.delay) * model.time_step);
                }
                let point = |threshold: u64| rate_point(threshold as f64, errors, errors.at(&[threshold]).1);
                let (points, color) = (thresholds(errors, POINTS).map(point).collect(), by_threshold.len());
                section.tables.push(table_by_threshold(errors, &name));
                by_threshold.push(Series { name, points, dashed: false, color });
            }
        }
    }
    for errors in channels.least_errors() {
        let wrong = errors.at(&errors.best()).1;
        let text = format!(
            "{}, {:.4} s later: fewest errors, {wrong} of {} bits, a rate of {}.",
            errors.name(model),
            f64::from(errors.delay) * model.time_step,
            errors.bits,
            rate(errors, wrong)
        );
        section.notes.push(Note { text, is_error: false });
    }
    for (file, title, x, lines) in [
        ("bit-errors", "Bit errors by threshold", "threshold, arrivals in a slot", &by_threshold),
        ("bit-errors-by-delay", "Fewest bit errors by delay", "delay of the slots, s", &by_delay),
    ] {
        let axes = [(x, Scale::Linear), ("fraction of the bits", Scale::Logarithmic)];
        section.plots.extend(plot_scaled(file, title, axes, lines)?);
    }
    Ok(section)
}

fn rate_point(x: f64, errors: &BitErrors, wrong: u64) -> PlotPoint {
    let [low, high] = errors.interval(wrong);
    PlotPoint::new(x, wrong as f64 / errors.bits as f64, (low, high))
}

fn rate(errors: &BitErrors, wrong: u64) -> String {
    let [low, high] = errors.interval(wrong);
    format!("{:.4} ({low:.4} to {high:.4})", wrong as f64 / errors.bits as f64)
}

/// The first delay, and the one with the fewest errors.
fn shown(by_delay: &[BitErrors]) -> impl Iterator<Item = &BitErrors> {
    let found = by_delay.iter().min_by(|a, b| a.lowest_rate().total_cmp(&b.lowest_rate()));
    by_delay.iter().take(1).chain(found.filter(|errors| errors.delay != by_delay[0].delay))
}

fn table_by_delay(by_delay: &[BitErrors], name: &str, model: &Model) -> Table {
    let lowest = by_delay.iter().map(BitErrors::lowest_rate).fold(f64::INFINITY, f64::min);
    let row = |errors: &BitErrors| {
        let best = errors.best();
        let wrong = errors.at(&best).1;
        let delay = f64::from(errors.delay) * model.time_step;
        let thresholds = if best.is_empty() { "by species".to_owned() } else { spaced(&best) };
        let cells = [
            format!("{delay:.4} s"),
            thresholds,
            wrong.to_string(),
            errors.bits.to_string(),
            rate(errors, wrong),
        ];
        row_of(cells, errors.lowest_rate() <= lowest)
    };
    Table {
        caption: format!("{name}: fewest errors by the delay of the slots"),
        header: ["delay", "thresholds", "errors", "bits", "rate"].map(str::to_owned).to_vec(),
        rows: by_delay.iter().map(row).collect(),
    }
}

fn table_by_threshold(errors: &BitErrors, name: &str) -> Table {
    let best = errors.best()[0];
    let row = |threshold: u64| {
        let wrong = errors.at(&[threshold]).1;
        row_of([threshold.to_string(), wrong.to_string(), rate(errors, wrong)], threshold == best)
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
        cells.iter_mut().for_each(|cell| cell.kind = lazygrid_report::CellKind::Best);
    }
    cells
}

fn thresholds(errors: &BitErrors, most: usize) -> impl Iterator<Item = u64> {
    let last = errors.max_seen() + 1;
    let step = (last / most as u64 + 1) as usize;
    (0..=last).step_by(step)
}
