use super::super::row::{Row, Status, quartiles};
use crate::measure::Spread;
use lazygrid_report::number::{count, three_figures, time, unit};
use lazygrid_report::{Cell, CellKind, Table};

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Column {
    Size(usize),
    Setting(f64, &'static str),
}

impl Column {
    pub(super) fn holds(self, row: &Row) -> bool {
        match self {
            Self::Size(n) => row.n == n,
            Self::Setting(at, _) => row.at == Some(at),
        }
    }

    pub(super) fn name(self) -> String {
        match self {
            Self::Size(n) => count(n),
            Self::Setting(at, "") => at.to_string(),
            Self::Setting(at, "s") => {
                let (factor, unit) = unit(at);
                format!("{} {unit}", (at * factor * 1e3).round() / 1e3)
            }
            Self::Setting(at, unit) => format!("{at} {unit}"),
        }
    }
}

pub(super) fn by_size(rows: &[&Row]) -> Vec<Column> {
    sizes(rows).into_iter().map(Column::Size).collect()
}

pub(super) fn by_setting(rows: &[&Row], unit: &'static str) -> Vec<Column> {
    let mut values: Vec<f64> = rows.iter().filter_map(|row| row.at).collect();
    values.sort_by(f64::total_cmp);
    values.dedup();
    values.into_iter().map(|at| Column::Setting(at, unit)).collect()
}

pub(super) fn sizes(rows: &[&Row]) -> Vec<usize> {
    let mut sizes: Vec<usize> = rows.iter().map(|row| row.n).collect();
    sizes.sort_unstable();
    sizes.dedup();
    sizes
}

pub(super) fn engines<'a>(rows: &[&'a Row]) -> Vec<&'a str> {
    distinct(rows, |row| &row.engine)
}

pub(super) fn scenes<'a>(rows: &[&'a Row]) -> Vec<&'a str> {
    distinct(rows, |row| &row.scene)
}

pub(super) fn groups<'a>(rows: &[&'a Row]) -> Vec<(&'a str, usize, String, Vec<&'a Row>)> {
    let mut groups = vec![];
    for n in sizes(rows) {
        for scene in scenes(rows) {
            let rows: Vec<&Row> = rows.iter().copied().filter(|r| r.scene == scene && r.n == n).collect();
            if !rows.is_empty() {
                groups.push((scene, n, format!("{scene}, {} spheres", count(n)), rows));
            }
        }
    }
    groups
}

fn distinct<'a>(rows: &[&'a Row], name: fn(&Row) -> &str) -> Vec<&'a str> {
    let mut names = vec![];
    for row in rows {
        if !names.contains(&name(row)) {
            names.push(name(row));
        }
    }
    names
}

pub(super) fn find<'a>(rows: &[&'a Row], engine: &str, column: Column) -> Option<&'a Row> {
    rows.iter().copied().find(|row| row.engine == engine && column.holds(row))
}

pub(super) fn median(times: &[f64]) -> Option<String> {
    let median = Spread::from_values(times).median;
    let (factor, _) = unit(median);
    let (low, high) = quartiles(times);
    match times.len() {
        0 => None,
        1 => Some(format!("{} (1 run)", time(median))),
        runs => {
            let [low, high] = [low, high].map(|t| three_figures(t * factor));
            Some(format!("{} ({low}–{high}; {runs})", time(median)))
        }
    }
}

pub(super) fn mean(row: &Row, written: impl Fn(f64) -> String) -> Option<String> {
    let (mean, deviation) = row.mean();
    match row.wall.len() {
        0 => None,
        1 => Some(format!("{} (1 run)", written(mean))),
        runs => Some(format!("{} ± {:.0} % ({runs})", written(mean), 100.0 * deviation / mean)),
    }
}

pub(super) fn cell(row: Option<&Row>, show: impl Fn(&Row) -> Option<String>) -> Cell {
    let absent = |text: &str| (text.to_owned(), CellKind::Absent);
    let (text, kind) = match row.map(|row| (row, row.status)) {
        None => absent("–"),
        Some((row, Status::Ok)) => show(row).map_or_else(|| absent("–"), |text| (text, CellKind::Plain)),
        Some((_, Status::Error)) => ("wrong".to_owned(), CellKind::Error),
        Some((_, Status::NotAvailable)) => absent("not available"),
        Some((_, Status::LeftOut)) => absent("left out"),
    };
    Cell { text, kind }
}

pub(super) fn mark_best(cells: &mut [Cell], rows: &[Option<&Row>], by: fn(&Row) -> f64) {
    let value = |row: &Option<&Row>| row.filter(|r| r.status == Status::Ok).map_or(f64::NAN, by);
    let values: Vec<f64> = rows.iter().map(value).collect();
    let best = values.iter().copied().fold(f64::INFINITY, f64::min);
    for (cell, value) in cells.iter_mut().zip(values) {
        if value == best && cell.kind == CellKind::Plain {
            cell.kind = CellKind::Best;
        }
    }
}

pub(super) fn by_engine(
    caption: String,
    rows: &[&Row],
    columns: &[Column],
    show: impl Fn(&Row) -> Option<String>,
) -> Table {
    let line = |engine: &str| {
        let cells = columns.iter().map(|&column| cell(find(rows, engine, column), &show));
        std::iter::once(Cell::plain(engine)).chain(cells).collect()
    };
    let names = columns.iter().map(|column| column.name());
    Table {
        caption,
        header: std::iter::once("engine".to_owned()).chain(names).collect(),
        rows: engines(rows).into_iter().map(line).collect(),
    }
}

pub(super) fn best_of_columns(table: &mut Table, rows: &[&Row], columns: &[Column], by: fn(&Row) -> f64) {
    for (k, &column) in columns.iter().enumerate() {
        let found: Vec<Option<&Row>> =
            engines(rows).into_iter().map(|engine| find(rows, engine, column)).collect();
        let mut cells: Vec<Cell> = table.rows.iter().map(|line| line[k + 1].clone()).collect();
        mark_best(&mut cells, &found, by);
        for (line, cell) in table.rows.iter_mut().zip(cells) {
            line[k + 1] = cell;
        }
    }
}

pub(super) fn pairs(rows: &[&Row], columns: &[Column]) -> Vec<Cell> {
    let cell = |column: &Column| {
        let found = rows.iter().find(|row| column.holds(row) && row.status == Status::Ok);
        Cell::plain(found.map_or("–".to_owned(), |row| row.pairs.to_string()))
    };
    std::iter::once(Cell::plain("(pairs)")).chain(columns.iter().map(cell)).collect()
}

pub(super) fn gpu_times(what: &str, rows: &[&Row], columns: &[Column]) -> Option<Table> {
    let timed: Vec<&Row> = rows.iter().copied().filter(|row| !row.gpu.is_empty()).collect();
    let caption = format!(
        "{what}median GPU time, by the GPU's own clock and without transfers (quartiles; runs); wall times are above"
    );
    (!timed.is_empty()).then(|| by_engine(caption, &timed, columns, |row| median(&row.gpu)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn median_of_one_run_has_no_spread() {
        assert_eq!(median(&[]), None);
        assert_eq!(median(&[0.25]).as_deref(), Some("250 ms (1 run)"));
        assert_eq!(median(&[1e-3, 2e-3, 3e-3]).as_deref(), Some("2.00 ms (1.50–2.50; 3)"));
    }
}
