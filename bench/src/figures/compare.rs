use super::row::{Results, Row, Status};

/// Smallest ratio that counts as a change: processes differ more than runs within a process.
const MIN_RATIO: f64 = 1.05;
/// Minimum number of runs for a comparison of times.
const MIN_RUNS: usize = 5;

/// Changes, ordered from the worst.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Change {
    Broken,
    /// The new run lacks a row that it should have.
    Lost,
    Slower,
    Larger,
    Faster,
    Smaller,
    Same,
    TooFew,
}

#[derive(Clone, Debug)]
pub struct Difference<'a> {
    pub old: &'a Row,
    pub new: Option<&'a Row>,
    /// Ratio of new to old medians; NaN if either is missing.
    pub ratio: f64,
    pub change: Change,
}

pub fn circumstances(old: &Results, new: &Results) -> Vec<String> {
    let runs = |results: &Results| results.settings.runs.map_or("the default".to_owned(), |n| n.to_string());
    let describe = |results: &Results| {
        let scale = format!("{:?}", results.settings.scale).to_lowercase();
        [results.environment.machine(), results.environment.graphics(), scale, runs(results)]
    };
    let names = ["machines", "GPU adapters", "scales", "numbers of runs"];
    let both = names.into_iter().zip(describe(old)).zip(describe(new));
    let differing = both.filter(|((_, old), new)| old != new);
    differing.map(|((name, old), new)| format!("different {name}: {old} / {new}")).collect()
}

/// In a change of times, the middle halves of the runs are disjoint.
pub fn differences<'a>(old: &'a Results, new: &'a Results) -> Vec<Difference<'a>> {
    let compared = |row: &'a Row| match new.rows.iter().find(|n| n.matches(row)) {
        Some(found) => difference(row, found),
        None if row.status == Status::Ok && was_to_measure(old, new, row) => {
            Some(Difference { old: row, new: None, ratio: f64::NAN, change: Change::Lost })
        }
        None => None,
    };
    old.rows.iter().filter_map(compared).collect()
}

fn was_to_measure(old: &Results, new: &Results, row: &Row) -> bool {
    let is_requested = new.settings.only.iter().any(|figure| figure.name() == row.figure);
    let same_point = |n: &Row| n.figure == row.figure && n.scene == row.scene && n.n == row.n;
    is_requested && (old.settings.scale == new.settings.scale || new.rows.iter().any(same_point))
}

fn difference<'a>(old: &'a Row, new: &'a Row) -> Option<Difference<'a>> {
    let (ratio, change) = match (old.status, new.status) {
        (Status::Ok, Status::Ok) => changed(old, new)?,
        (old, Status::Error) if old != Status::Error => (f64::NAN, Change::Broken),
        (Status::Ok, Status::NotAvailable | Status::LeftOut) => (f64::NAN, Change::Lost),
        _ => return None,
    };
    Some(Difference { old, new: Some(new), ratio, change })
}

fn changed(old: &Row, new: &Row) -> Option<(f64, Change)> {
    if let (Some(before), Some(after)) = (old.bytes, new.bytes) {
        let change = match (before, after) {
            _ if after > MIN_RATIO * before => Change::Larger,
            _ if before > MIN_RATIO * after => Change::Smaller,
            _ => Change::Same,
        };
        return Some((after / before, change));
    }
    if old.bytes.is_some() && new.bytes.is_none() {
        return Some((f64::NAN, Change::Lost));
    }
    if old.wall.is_empty() || new.wall.is_empty() {
        return None;
    }
    let ratio = new.median() / old.median();
    let ((old_low, old_high), (new_low, new_high)) = (old.quartiles(), new.quartiles());
    let change = if old.wall.len().min(new.wall.len()) < MIN_RUNS {
        Change::TooFew
    } else if ratio > MIN_RATIO && new_low > old_high {
        Change::Slower
    } else if ratio < 1.0 / MIN_RATIO && new_high < old_low {
        Change::Faster
    } else {
        Change::Same
    };
    Some((ratio, change))
}

#[cfg(test)]
mod tests {
    use super::super::figure::Figure;
    use super::super::plan::{RunScale, Settings};
    use super::super::row::tests::row;
    use super::*;
    use crate::figures::Environment;

    #[test]
    fn only_changes_beyond_the_noise_count() {
        let old = row(&[1.0, 1.1, 1.2, 1.3, 1.4]);
        let change = |new: &Row| difference(&old, new).map(|d| d.change);
        let change_of = |wall: &[f64]| change(&row(wall));
        assert_eq!(change_of(&[1.05, 1.15, 1.3, 1.6, 1.7]), Some(Change::Same));
        assert_eq!(change_of(&[1.5, 1.6, 1.7, 1.8, 1.9]), Some(Change::Slower));
        assert_eq!(change_of(&[0.5, 0.6, 0.7, 0.7, 0.8]), Some(Change::Faster));
        assert_eq!(change_of(&[9.0, 9.0, 9.0, 9.0]), Some(Change::TooFew));
        assert_eq!(change_of(&[]), None);
        assert_eq!(change(&Row { status: Status::Error, ..row(&[]) }), Some(Change::Broken));
        assert_eq!(change(&Row { status: Status::LeftOut, ..row(&[]) }), Some(Change::Lost));
        assert_eq!(change(&Row { status: Status::NotAvailable, ..row(&[]) }), Some(Change::Lost));
        for status in [Status::LeftOut, Status::NotAvailable, Status::Error] {
            let with_status = |status| Row { status, ..row(&[]) };
            let change = difference(&with_status(status), &with_status(Status::Error)).map(|d| d.change);
            assert_eq!(change, (status != Status::Error).then_some(Change::Broken));
        }
    }

    #[test]
    fn memory_is_compared_in_bytes() {
        let with = |bytes: f64, wall: f64| Row { bytes: Some(bytes), ..row(&[wall]) };
        let change = |after: &Row| difference(&with(100.0, 1.0), after).map(|d| d.change);
        assert_eq!(change(&with(104.0, 9.0)), Some(Change::Same));
        assert_eq!(change(&with(106.0, 1.0)), Some(Change::Larger));
        assert_eq!(change(&with(90.0, 9.0)), Some(Change::Smaller));
        assert_eq!(change(&row(&[1.0])), Some(Change::Lost));
    }

    fn results(scale: RunScale, only: Figure, rows: Vec<Row>) -> Results {
        let command = String::new();
        let settings = Settings { scale, only: vec![only], runs: None, minutes: 1.0, seed: 1, command };
        let environment = Environment {
            cpu: "c".to_owned(),
            cores: 2,
            memory_gib: 1.0,
            system: "s".to_owned(),
            adapter: None,
            versions: vec![],
            commit: String::new(),
            date: String::new(),
        };
        Results { environment, settings, seconds: 1.0, missing: vec![], rows }
    }

    #[test]
    fn missing_row_is_lost_only_if_requested() {
        let two = || vec![row(&[1.0; 5]), Row { engine: "f".to_owned(), ..row(&[1.0; 5]) }];
        let old = results(RunScale::Quick, Figure::F4, two());
        let lost = |new: &Results| differences(&old, new).iter().filter(|d| d.change == Change::Lost).count();
        assert_eq!(lost(&results(RunScale::Quick, Figure::F4, two())), 0);
        assert_eq!(lost(&results(RunScale::Quick, Figure::F4, vec![row(&[1.0; 5])])), 1);
        assert_eq!(lost(&results(RunScale::Full, Figure::F4, vec![row(&[1.0; 5])])), 1);
        assert_eq!(lost(&results(RunScale::Full, Figure::F4, vec![])), 0);
        assert_eq!(lost(&results(RunScale::Quick, Figure::F3a, vec![])), 0);
    }

    #[test]
    fn different_circumstances_are_listed() {
        let old = results(RunScale::Quick, Figure::F4, vec![]);
        assert!(circumstances(&old, &old).is_empty());
        let mut new = results(RunScale::Full, Figure::F4, vec![]);
        new.settings.runs = Some(3);
        new.environment.cores = 4;
        assert_eq!(circumstances(&old, &new).len(), 3);
    }
}
