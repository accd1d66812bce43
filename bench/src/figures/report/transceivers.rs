use std::error::Error;

use super::super::figure::Figure;
use super::super::fit::exponent;
use super::super::row::{Row, Status};
use super::curves::logarithmic;
use super::ratios::{NEAR, Times, verdicts};
use super::sweeps::plot;
use super::table::{Column, best_of_columns, by_engine, by_setting, engines, find, groups, median, pairs};
use lazygrid::Algorithm;
use lazygrid_report::{Cell, Note, Quantity, Section, Table};

const OURS: &str = Algorithm::RecursiveGrid.name();
const ONE_LEVEL: &str = Algorithm::ArrayGrid.name();

pub(super) fn section(figure: Figure, rows: &[&Row]) -> Result<Section, Box<dyn Error>> {
    let varied = figure.varied().unwrap_or_default();
    let (title, text) = heading(figure);
    let text = [text, MOTION].map(str::to_owned).into();
    let mut section = Section { title: title.to_owned(), text, ..Section::default() };
    for (scene, n, what, rows) in groups(rows) {
        let columns = by_setting(&rows, "");
        let y = ("median time of a step, one thread", Quantity::Time);
        let axes = logarithmic(&what, (varied, Quantity::Number), y);
        section.plots.extend(plot(&axes, &rows, format!("figure-{figure}-{scene}-{n}"))?);
        section.tables.push(medians(figure, &what, &rows, &columns));
        section.tables.push(compared(&what, &rows, &columns));
        section.notes.extend(verdict(figure, &what, &rows, &columns));
        section.notes.extend((figure == Figure::SizeRatio).then(|| growth(&what, &rows)).flatten());
        section.notes.extend(verdicts(&what, &rows, &columns));
    }
    Ok(section)
}

const fn heading(figure: Figure) -> (&'static str, &'static str) {
    match figure {
        Figure::SizeRatio => (
            "Growth with the ratio of sizes",
            "Ten transceivers among carriers, with centers uniform in a ball of which all fill 5 %. Transceivers are \
             from as large as carriers to many times as large, and the number of spheres is constant. The paper's \
             bound is a time in proportion to n·(log₂ ratio + 1), so that k = 1 if time grows as (log₂ ratio + 1)ᵏ; \
             k is fitted to the medians. If transceivers fill most of the 5 %, the ball grows with them, the number \
             of carriers per cell no longer grows, and time is constant.",
        ),
        _ => (
            "Transceivers among carriers",
            "Several numbers of transceivers that are 10, 100 or 1000 times as large as the carriers around them, \
             with centers uniform in a ball of which all fill 5 %, so that a carrier is inside a transceiver with a \
             probability of at most 5 %. Transceivers determine the cell size: the fewer there are, the more \
             carriers are in a cell, which the recursive grid splits. If no cell has more than τ carriers, it is \
             equivalent to the array grid; if cells have only slightly more, splitting costs more than it saves.",
        ),
    }
}

const MOTION: &str = "Every sphere moves by a tenth of its radius in a random direction at each step, two warm-up \
    steps are dropped, and all engines use one thread, because trees cannot use more. Ratios are of the same steps \
    in the same run.";

fn medians(figure: Figure, what: &str, rows: &[&Row], columns: &[Column]) -> Table {
    let caption = format!("{what}: median time of a step (quartiles; steps)");
    let mut table = by_engine(caption, rows, columns, |row| median(&row.wall));
    table.header[0] = format!("engine, by {}", figure.varied().unwrap_or_default());
    best_of_columns(&mut table, rows, columns, Row::median);
    table.rows.push(pairs(rows, columns));
    if figure == Figure::SizeRatio {
        table.header.push("growth (log₂ ratio + 1)ᵏ".to_owned());
        let fitted = engines(rows).into_iter().map(|engine| fitted(rows, engine));
        for (line, k) in table.rows.iter_mut().zip(fitted.chain([None])) {
            line.push(Cell::plain(k.map_or_else(|| "–".to_owned(), |k| format!("{k:.2}"))));
        }
    }
    table
}

fn fitted(rows: &[&Row], engine: &str) -> Option<f64> {
    let measured = rows.iter().filter(|row| row.engine == engine && row.status == Status::Ok);
    exponent(measured.filter_map(|row| Some((row.at?.log2() + 1.0, row.median()))))
}

fn compared(what: &str, rows: &[&Row], columns: &[Column]) -> Table {
    let others: Vec<&Row> = rows.iter().copied().filter(|row| row.engine != OURS).collect();
    let ratio = |row: &Row| {
        let column = columns.iter().find(|column| column.holds(row))?;
        let times = Times::new(row, find(rows, OURS, *column)?)?;
        let (low, high) = times.quartiles();
        Some(format!("{:.2} ({low:.2}–{high:.2})", times.median()))
    };
    let caption =
        format!("{what}: {OURS} is this many times as fast, in the median of the steps (quartiles)");
    by_engine(caption, &others, columns, ratio)
}

fn verdict(figure: Figure, what: &str, rows: &[&Row], columns: &[Column]) -> Option<Note> {
    let (mut faster, mut even, mut slower) = (vec![], vec![], vec![]);
    for &column in columns {
        let row_of = |engine| find(rows, engine, column).filter(|row| row.status == Status::Ok);
        let Some(times) = row_of(ONE_LEVEL).zip(row_of(OURS)).and_then(|(peer, ours)| Times::new(peer, ours))
        else {
            continue;
        };
        let ratio = times.median();
        let group = match ratio {
            _ if NEAR.contains(&ratio) => &mut even,
            _ if ratio > 1.0 => &mut faster,
            _ => &mut slower,
        };
        group.push(format!("{ratio:.2} at {}", column.name()));
    }
    let groups = [("faster", faster), ("about as fast", even), ("slower", slower)];
    let said = groups.into_iter().filter(|(_, at)| !at.is_empty());
    let said: Vec<String> = said.map(|(how, at)| format!("{how} ({})", at.join(", "))).collect();
    let varied = figure.varied().unwrap_or_default();
    (!said.is_empty()).then(|| Note {
        text: format!(
            "{what}: compared with {ONE_LEVEL}, {OURS} is, by {varied}, {}; how many times as fast.",
            said.join(", ")
        ),
        is_error: false,
    })
}

fn growth(what: &str, rows: &[&Row]) -> Option<Note> {
    let (ours, without) = (fitted(rows, OURS)?, fitted(rows, ONE_LEVEL)?);
    let verdict = if ours <= 1.0 { "within" } else { "beyond" };
    Some(Note {
        text: format!(
            "{what}: the time of {OURS} grows as (log₂ ratio + 1)^{ours:.2}, {verdict} the paper's bound of 1; that \
             of {ONE_LEVEL} as (log₂ ratio + 1)^{without:.2}."
        ),
        is_error: false,
    })
}

#[cfg(test)]
mod tests {
    use super::super::super::row::tests::row;
    use super::*;

    fn at(engine: &str, at: f64, wall: &[f64]) -> Row {
        Row { engine: engine.to_owned(), at: Some(at), ..row(wall) }
    }

    #[test]
    fn recursion_is_evaluated_by_medians_of_steps() {
        let rows = [
            at(OURS, 1.0, &[1.0, 2.0, 1.0]),
            at(ONE_LEVEL, 1.0, &[3.0, 2.0, 4.0]),
            at(OURS, 10.0, &[1.0]),
            at(ONE_LEVEL, 10.0, &[0.95]),
            at(OURS, 100.0, &[1.0]),
            at(ONE_LEVEL, 100.0, &[0.5]),
            at(OURS, 1000.0, &[1.0]),
        ];
        let rows: Vec<&Row> = rows.iter().collect();
        let note = verdict(Figure::Transceivers, "s", &rows, &by_setting(&rows, "")).expect("a note");
        assert_eq!(
            note.text,
            "s: compared with array-grid, recursive-grid is, by transceivers, faster (3.00 at 1), about as fast \
             (0.95 at 10), slower (0.50 at 100); how many times as fast."
        );
        let table = compared("s", &rows, &by_setting(&rows, ""));
        assert_eq!((table.rows.len(), table.rows[0][1].text.as_str()), (1, "3.00 (2.00–3.50)"));
    }

    #[test]
    fn growth_is_fitted_to_the_logarithm_of_the_ratio() {
        let rows_of = |engine: &str, k: f64| {
            let time = |ratio: f64| (ratio.log2() + 1.0).powf(k);
            [1.0, 4.0, 32.0, 1024.0].map(|ratio| at(engine, ratio, &[time(ratio)]))
        };
        let rows = [rows_of(OURS, 0.8), rows_of(ONE_LEVEL, 2.0)].concat();
        let rows: Vec<&Row> = rows.iter().collect();
        let note = growth("s", &rows).expect("a fit");
        assert!(note.text.contains("+ 1)^0.80, within the paper's bound of 1"), "{}", note.text);
        assert!(note.text.ends_with("(log₂ ratio + 1)^2.00."), "{}", note.text);
        let table = medians(Figure::SizeRatio, "s", &rows, &by_setting(&rows, ""));
        let last: Vec<&str> = table.rows.iter().map(|line| line[5].text.as_str()).collect();
        assert_eq!(last, ["0.80", "2.00", "–"]);
        assert!(growth("s", &rows[..2]).is_none());
    }
}
