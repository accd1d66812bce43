use std::fmt;

use super::super::row::{Row, Status, quartiles};
use super::table::{Column, by_engine, engines, find};
use crate::measure::Spread;
use lazygrid_report::{Note, Table};

pub(super) const ON_SOFTWARE: &str = "(software GPU)";

pub(super) const OURS: [&str; 7] = [
    "recursive-grid",
    "cell-list",
    "CPU path's own choice",
    "lazy-grid (GPU)",
    "lazy-grid (software GPU)",
    "auto (GPU)",
    "auto (software GPU)",
];

/// Range of time ratios that is inconclusive if single steps differ in both directions.
pub(super) const NEAR: std::ops::RangeInclusive<f64> = 0.9..=1.1;

pub(super) struct Times {
    /// Ratio of the totals of all common steps, as trees are slow only occasionally.
    pub(super) total: f64,
    pub(super) by_step: Vec<f64>,
}

impl Times {
    pub(super) fn new(peer: &Row, ours: &Row) -> Option<Self> {
        let both = || peer.wall.iter().zip(&ours.wall);
        let by_step: Vec<f64> = both().map(|(p, o)| p / o).collect();
        let (theirs, mine) = both().fold((0.0, 0.0), |(theirs, mine), (p, o)| (theirs + p, mine + o));
        (!by_step.is_empty()).then(|| Self { total: theirs / mine, by_step })
    }

    pub(super) fn median(&self) -> f64 {
        Spread::from_values(&self.by_step).median
    }

    pub(super) fn quartiles(&self) -> (f64, f64) {
        quartiles(&self.by_step)
    }

    fn is_even(&self) -> bool {
        let Spread { low, high, .. } = Spread::from_values(&self.by_step);
        NEAR.contains(&self.total) && low <= 1.0 && high >= 1.0
    }
}

impl fmt::Display for Times {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Spread { low, high, .. } = Spread::from_values(&self.by_step);
        match self.by_step.len() {
            1 => write!(f, "{:.2} (1 step)", self.total),
            _ => write!(f, "{:.2} ({low:.2}–{high:.2})", self.total),
        }
    }
}

pub(super) fn peers<'a>(rows: &[&'a Row]) -> Vec<&'a str> {
    engines(rows).into_iter().filter(|engine| !OURS.contains(engine)).collect()
}

pub(super) fn ours(rows: &[&Row]) -> impl Iterator<Item = &'static str> {
    OURS.into_iter().filter(|&ours| rows.iter().any(|row| row.engine == ours && !row.wall.is_empty()))
}

pub(super) fn table(what: &str, rows: &[&Row], columns: &[Column], ours: &str) -> Table {
    let others: Vec<&Row> = rows.iter().copied().filter(|row| !OURS.contains(&row.engine.as_str())).collect();
    let ratio = |peer: &Row| {
        let column = columns.iter().find(|column| column.holds(peer))?;
        Some(Times::new(peer, find(rows, ours, *column)?)?.to_string())
    };
    let caption = format!("{what}: {ours} is this many times as fast, in total (range of single steps)");
    let mut table = by_engine(caption, &others, columns, ratio);
    table.header[0] = "peer".to_owned();
    table
}

pub(super) fn verdicts(what: &str, rows: &[&Row], columns: &[Column]) -> Vec<Note> {
    let mut notes = vec![];
    let mut unbeaten = vec![];
    for ours in self::ours(rows) {
        if ours.ends_with(ON_SOFTWARE) {
            notes.push(on_software(what, rows, columns, ours));
            continue;
        }
        let beaten = peers(rows).into_iter().filter_map(|peer| verdict(what, rows, columns, (peer, ours)));
        let before = notes.len();
        notes.extend(beaten);
        if notes.len() == before {
            unbeaten.push(ours);
        }
    }
    if !unbeaten.is_empty() {
        notes.push(format!("{what}: no peer that was measured is as fast as {}.", unbeaten.join(" or ")));
    }
    notes.into_iter().map(|text| Note { text, is_error: false }).collect()
}

fn ratios<'a>(
    rows: &'a [&Row],
    columns: &'a [Column],
    peer: &'a str,
    ours: &'a str,
) -> impl Iterator<Item = (Column, Times)> + 'a {
    columns.iter().filter_map(move |&column| {
        let peer = find(rows, peer, column).filter(|row| row.status == Status::Ok)?;
        Some((column, Times::new(peer, find(rows, ours, column)?)?))
    })
}

fn verdict(what: &str, rows: &[&Row], columns: &[Column], pair: (&str, &str)) -> Option<String> {
    let (peer, ours) = pair;
    let (mut faster, mut even) = (vec![], vec![]);
    for (column, times) in ratios(rows, columns, peer, ours) {
        if times.is_even() {
            even.push(column.name());
        } else if times.total < 1.0 {
            faster.push(format!("{:.2} × as fast at {}", 1.0 / times.total, column.name()));
        }
    }
    if !even.is_empty() {
        faster.push(format!("about as fast at {}", even.join(", ")));
    }
    (!faster.is_empty()).then(|| format!("{what}: {peer} over {ours}: {}.", faster.join(", ")))
}

fn on_software(what: &str, rows: &[&Row], columns: &[Column], ours: &str) -> String {
    let measured = |column: &&Column| find(rows, ours, **column).is_some_and(|row| !row.wall.is_empty());
    let slower = |column: &&Column| {
        let is_faster =
            |peer| ratios(rows, std::slice::from_ref(*column), peer, ours).any(|(_, t)| t.total < 1.0);
        peers(rows).into_iter().any(is_faster)
    };
    let all = columns.iter().filter(measured).count();
    let slower = columns.iter().filter(slower).count();
    format!(
        "{what}: {ours} is slower than a peer at {slower} of {all} points; a software adapter runs on the CPU and says \
         nothing about GPUs."
    )
}

#[cfg(test)]
mod tests {
    use super::super::super::row::tests::row;
    use super::*;

    fn engine(name: &str, n: usize, wall: &[f64]) -> Row {
        Row { engine: name.to_owned(), n, ..row(wall) }
    }

    #[test]
    fn faster_peers_are_noted_once_without_noise() {
        let rows = [
            engine("recursive-grid", 10, &[1.0, 1.0]),
            engine("recursive-grid", 100, &[1.0, 1.0]),
            engine("CPU path's own choice", 10, &[0.1]),
            engine("lazy-grid (software GPU)", 10, &[9.0]),
            engine("tree", 10, &[0.5, 0.5]),
            engine("tree", 100, &[0.9, 1.2]),
        ];
        let rows: Vec<&Row> = rows.iter().collect();
        let columns = super::super::table::by_size(&rows);
        let notes: Vec<String> = verdicts("equal", &rows, &columns).into_iter().map(|n| n.text).collect();
        assert_eq!(notes.len(), 3, "{notes:?}");
        assert_eq!(notes[0], "equal: tree over recursive-grid: 2.00 × as fast at 10, about as fast at 100.");
        assert!(notes[1].contains("slower than a peer at 1 of 1 points"), "{}", notes[1]);
        assert!(notes[2].ends_with("is as fast as CPU path's own choice."), "{}", notes[2]);
    }
}
