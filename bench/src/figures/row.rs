use serde::{Deserialize, Serialize};

use super::plan::DataPoint;
use super::{Contender, Environment, Settings};
use crate::measure::Spread;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Status {
    Ok,
    /// A wrong answer or a failure; the rest of the row is void.
    Error,
    /// The engine cannot run here or at this size.
    NotAvailable,
    LeftOut,
}

impl Status {
    pub const fn name(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Error => "error",
            Self::NotAvailable => "not-available",
            Self::LeftOut => "left-out",
        }
    }
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    pub figure: String,
    /// The scene with the parameters that the figure does not vary.
    pub scene: String,
    pub n: usize,
    /// Value of the varied parameter.
    pub at: Option<f64>,
    pub engine: String,
    pub status: Status,
    pub reason: String,
    pub pairs: u64,
    /// Largest number of tangent pairs, within 4 ulp, that a GPU decided differently in a run.
    #[serde(default)]
    pub tangent: u64,
    /// Seconds of each run until the pairs are in host memory.
    pub wall: Vec<f64>,
    /// Seconds.
    pub gpu: Vec<f64>,
    /// Median seconds.
    pub phases: Vec<(String, f64)>,
    /// Peak bytes per sphere besides input and result.
    pub bytes: Option<f64>,
}

impl Row {
    pub(super) fn new(point: &DataPoint, contender: Contender) -> Self {
        Self {
            figure: point.figure.name().to_owned(),
            scene: point.kind(),
            n: point.n,
            at: point.setting(contender),
            engine: contender.to_string(),
            status: Status::Ok,
            reason: String::new(),
            pairs: 0,
            tangent: 0,
            wall: vec![],
            gpu: vec![],
            phases: vec![],
            bytes: None,
        }
    }

    pub fn median(&self) -> f64 {
        Spread::from_values(&self.wall).median
    }

    /// Returns the mean and the standard deviation in seconds.
    pub fn mean(&self) -> (f64, f64) {
        let n = self.wall.len() as f64;
        let mean = self.wall.iter().sum::<f64>() / n;
        let squares: f64 = self.wall.iter().map(|t| (t - mean) * (t - mean)).sum();
        (mean, (squares / (n - 1.0).max(1.0)).sqrt())
    }

    /// Returns the lower and the upper quartile in seconds.
    pub fn quartiles(&self) -> (f64, f64) {
        quartiles(&self.wall)
    }

    pub fn matches(&self, other: &Self) -> bool {
        self.figure == other.figure
            && self.scene == other.scene
            && self.n == other.n
            && self.at == other.at
            && self.engine == other.engine
    }
}

/// Interpolates linearly; returns NaN without values.
pub(super) fn quartiles(values: &[f64]) -> (f64, f64) {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let Some(last) = sorted.len().checked_sub(1) else { return (f64::NAN, f64::NAN) };
    let at = |fraction: f64| {
        let position = fraction * last as f64;
        let (below, above) = (sorted[position.floor() as usize], sorted[position.ceil() as usize]);
        below + (above - below) * position.fract()
    };
    (at(0.25), at(0.75))
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Results {
    pub environment: Environment,
    pub settings: Settings,
    pub seconds: f64,
    /// Points for which no time was left.
    #[serde(default)]
    pub missing: Vec<String>,
    pub rows: Vec<Row>,
}

impl Results {
    pub fn errors(&self) -> impl Iterator<Item = &Row> {
        self.rows.iter().filter(|row| row.status == Status::Error)
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub(in super::super) fn row(wall: &[f64]) -> Row {
        Row {
            figure: "4".to_owned(),
            scene: "equal".to_owned(),
            n: 10,
            at: None,
            engine: "e".to_owned(),
            status: Status::Ok,
            reason: String::new(),
            pairs: 0,
            tangent: 0,
            wall: wall.to_vec(),
            gpu: vec![],
            phases: vec![],
            bytes: None,
        }
    }

    #[test]
    fn quartiles_are_interpolated() {
        assert_eq!(quartiles(&[4.0, 1.0, 3.0, 2.0]), (1.75, 3.25));
        assert_eq!(quartiles(&[1.0, 2.0, 3.0, 4.0, 5.0]), (2.0, 4.0));
        assert_eq!(quartiles(&[7.0]), (7.0, 7.0));
        assert!(quartiles(&[]).0.is_nan());
    }
}
