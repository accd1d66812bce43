//! Two runs of the figures beside each other: what changed by more than their noise.

use super::row::{Results, Row, Status};

/// A smaller change than this says nothing, however little the runs of one process scatter: processes differ.
const LEAST: f64 = 1.05;

/// How a measurement changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Change {
    /// The new run has a wrong answer or a failure where the old had none.
    Broken,
    /// Slower beyond the noise.
    Slower,
    /// Faster beyond the noise.
    Faster,
    /// Within the noise.
    Same,
}

/// One measurement in both runs.
#[derive(Clone, Debug)]
pub struct Difference<'a> {
    /// Before.
    pub old: &'a Row,
    /// After.
    pub new: &'a Row,
    /// New median over old.
    pub ratio: f64,
    /// What that means.
    pub change: Change,
}

/// Every measurement that both runs have. It is slower, or faster, where the medians differ by more than 5 % and the
/// middle halves of the runs do not overlap.
pub fn differences<'a>(old: &'a Results, new: &'a Results) -> Vec<Difference<'a>> {
    let pairs = old.rows.iter().filter_map(|row| Some((row, new.rows.iter().find(|n| n.matches(row))?)));
    pairs.filter_map(|(old, new)| difference(old, new)).collect()
}

fn difference<'a>(old: &'a Row, new: &'a Row) -> Option<Difference<'a>> {
    if old.status == Status::Ok && new.status == Status::Error {
        return Some(Difference { old, new, ratio: f64::NAN, change: Change::Broken });
    }
    if old.wall.is_empty() || new.wall.is_empty() {
        return None;
    }
    let ratio = new.median() / old.median();
    let ((old_low, old_high), (new_low, new_high)) = (old.quartiles(), new.quartiles());
    let change = if ratio > LEAST && new_low > old_high {
        Change::Slower
    } else if ratio < 1.0 / LEAST && new_high < old_low {
        Change::Faster
    } else {
        Change::Same
    };
    Some(Difference { old, new, ratio, change })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(wall: &[f64]) -> Row {
        let text = r#"{"figure":"4","scene":"equal","n":10,"at":null,"engine":"e","status":"ok","reason":"",
            "pairs":0,"wall":[],"gpu":[],"phases":[],"bytes":null}"#;
        Row { wall: wall.to_vec(), ..serde_json::from_str(text).unwrap() }
    }

    #[test]
    fn only_what_leaves_the_noise_counts() {
        let old = row(&[1.0, 1.1, 1.2, 1.3]);
        let change = |wall: &[f64]| difference(&old, &row(wall)).map(|d| d.change);
        assert_eq!(change(&[1.05, 1.15, 1.3, 1.6]), Some(Change::Same));
        assert_eq!(change(&[1.5, 1.6, 1.7, 1.8]), Some(Change::Slower));
        assert_eq!(change(&[0.5, 0.6, 0.7, 0.7]), Some(Change::Faster));
        assert_eq!(change(&[]), None);
        let broken = Row { status: Status::Error, ..row(&[]) };
        assert_eq!(difference(&old, &broken).map(|d| d.change), Some(Change::Broken));
    }
}
