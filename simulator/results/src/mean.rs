use std::io::{self, Write};
use std::path::Path;

use crate::series::Series;
use lazygrid_sim::run::replicas::{ReplicaResults, Replicas};
use lazygrid_sim::{Error, check_available, write_atomically};

/// Exact statistics of integers in any order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct IntegerStats {
    count: u64,
    sum: u128,
    squares: u128,
}

impl IntegerStats {
    pub fn add(&mut self, value: u64) {
        self.count += 1;
        self.sum += u128::from(value);
        // The squares of 2³² numbers below 2⁴⁸ fit.
        self.squares = self.squares.saturating_add(u128::from(value) * u128::from(value));
    }

    pub fn count(&self) -> u64 {
        self.count
    }

    /// Returns the mean, or NaN without values.
    pub fn mean(&self) -> f64 {
        self.sum as f64 / self.count as f64
    }

    /// Returns √(s²/n) with s² = Σ(x − x̄)²/(n − 1); `None` for fewer than two values.
    pub fn standard_error(&self) -> Option<f64> {
        let n = u128::from(self.count);
        let spread = n.saturating_mul(self.squares).saturating_sub(self.sum.saturating_mul(self.sum));
        (n > 1).then(|| (spread as f64 / (n as f64 * n as f64 * (n - 1) as f64)).sqrt())
    }
}

impl FromIterator<u64> for IntegerStats {
    fn from_iter<T: IntoIterator<Item = u64>>(values: T) -> Self {
        let mut sample = Self::default();
        values.into_iter().for_each(|value| sample.add(value));
        sample
    }
}

/// Mean and standard error of numbers, by Welford's method.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RunningStats {
    count: u64,
    mean: f64,
    spread: f64,
}

impl RunningStats {
    pub fn add(&mut self, value: f64) {
        self.count += 1;
        let off = value - self.mean;
        self.mean += off / self.count as f64;
        self.spread += off * (value - self.mean);
    }

    pub fn count(&self) -> u64 {
        self.count
    }

    /// Returns the mean, or NaN without values.
    pub fn mean(&self) -> f64 {
        if self.count == 0 { f64::NAN } else { self.mean }
    }

    /// Returns the standard error of the mean; `None` for fewer than two values.
    pub fn standard_error(&self) -> Option<f64> {
        let n = self.count as f64;
        (self.count > 1).then(|| (self.spread / (n - 1.0) / n).sqrt())
    }
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeanSeries {
    pub names: Vec<String>,
    pub steps: Vec<u32>,
    pub times: Vec<f64>,
    /// Statistics, row after row.
    pub samples: Vec<IntegerStats>,
    pub replicas: u64,
}

impl MeanSeries {
    /// Averages the series of finished replicas and writes `mean.csv`. Removes replicas without the scenario's last row
    /// from `results.finished`.
    ///
    /// # Errors
    /// [`Error::Read`], [`Error::Write`] and [`Error::TooLittleMemory`].
    pub fn from_replicas(replicas: &Replicas, results: &mut ReplicaResults) -> Result<Self, Error> {
        let scenario = &replicas.run.scenario;
        let last = scenario.steps - scenario.steps % scenario.output.every;
        let (mut mean, mut finished) = (Self::default(), Vec::new());
        for &replica in &results.finished {
            let path = replicas.directory_of(replica).join("series.csv");
            let series = Series::read(&path)?;
            if series.steps.last() == Some(&last) {
                mean.add(&series, &path)?;
                finished.push(replica);
            }
        }
        write_atomically(&replicas.run.directory.join("mean.csv"), |out| mean.write(out))?;
        results.finished = finished;
        Ok(mean)
    }

    /// Adds the series of a replica.
    ///
    /// # Errors
    /// [`Error::Read`] if columns or steps differ from previous replicas, and [`Error::TooLittleMemory`].
    pub fn add(&mut self, series: &Series, path: &Path) -> Result<(), Error> {
        if self.replicas == 0 {
            let (rows, counts) = (series.steps.len() as u64, series.counts.len() as u64);
            let needed = 12 * rows + size_of::<IntegerStats>() as u64 * counts;
            let remedy = "write fewer rows (--series-every), or raise the limit";
            check_available(&format!("the means of {counts} counts"), needed, remedy)?;
            self.names.clone_from(&series.names);
            self.steps.clone_from(&series.steps);
            self.times.clone_from(&series.times);
            self.samples = vec![IntegerStats::default(); series.counts.len()];
        }
        if self.names != series.names || self.steps != series.steps {
            let message =
                "the series has other columns or rows than those of earlier replicas; run the replica again";
            let source = io::Error::new(io::ErrorKind::InvalidData, message);
            return Err(Error::Read { path: path.to_owned(), source });
        }
        self.samples.iter_mut().zip(&series.counts).for_each(|(sample, &count)| sample.add(count));
        self.replicas += 1;
        Ok(())
    }

    pub fn row(&self, row: usize) -> &[IntegerStats] {
        let width = self.names.len();
        &self.samples[row * width..][..width]
    }

    /// Writes the table. Errors of one replica are empty.
    pub fn write(&self, out: &mut impl Write) -> io::Result<()> {
        write!(out, "step,time,replicas")?;
        self.names.iter().try_for_each(|name| write!(out, ",{name} mean,{name} error"))?;
        writeln!(out)?;
        for (row, (step, time)) in self.steps.iter().zip(&self.times).enumerate() {
            write!(out, "{step},{time},{}", self.replicas)?;
            for sample in self.row(row) {
                write!(out, ",{},", sample.mean())?;
                sample.standard_error().map_or(Ok(()), |error| write!(out, "{error}"))?;
            }
            writeln!(out)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_and_errors_match_the_formulas() {
        // 1 to n: mean (n + 1)/2, s² = n(n + 1)/12.
        for n in [2_u64, 10, 1000] {
            let sample: IntegerStats = (1..=n).collect();
            let exact = n as f64;
            assert_eq!(sample.mean(), (exact + 1.0) / 2.0);
            let error = ((exact + 1.0) / 12.0).sqrt();
            assert!((sample.standard_error().unwrap() / error - 1.0).abs() < 1e-15, "{n}");
        }
        let far: IntegerStats = [1 << 40, (1 << 40) + 2].into_iter().collect();
        assert_eq!((far.mean(), far.standard_error()), ((1_u64 << 40) as f64 + 1.0, Some(1.0)));
        let same: IntegerStats = [7; 5].into_iter().collect();
        assert_eq!((same.mean(), same.standard_error()), (7.0, Some(0.0)));
        assert_eq!(IntegerStats::from_iter([3]).standard_error(), None);
        assert!(
            IntegerStats::default().mean().is_nan() && IntegerStats::default().standard_error().is_none()
        );
    }

    #[test]
    fn fractions_have_the_same_mean_and_error() {
        let values = [3_u64, 8, 8, 1, 40];
        let exact: IntegerStats = values.into_iter().collect();
        let mut moments = RunningStats::default();
        values.into_iter().for_each(|value| moments.add(value as f64 / 64.0));
        assert!((moments.mean() * 64.0 - exact.mean()).abs() < 1e-12 && moments.count() == 5);
        let errors = [moments.standard_error().unwrap() * 64.0, exact.standard_error().unwrap()];
        assert!((errors[0] / errors[1] - 1.0).abs() < 1e-12, "{errors:?}");
        assert!(
            RunningStats::default().mean().is_nan() && RunningStats::default().standard_error().is_none()
        );
    }

    #[test]
    fn series_are_added_row_by_row() {
        let series = |counts: [u64; 4]| Series {
            names: vec!["A".into(), "B".into()],
            steps: vec![0, 5],
            times: vec![0.0, 0.5],
            counts: counts.to_vec(),
        };
        let mut mean = MeanSeries::default();
        mean.add(&series([1, 2, 3, 4]), Path::new("a")).unwrap();
        mean.add(&series([3, 2, 3, 8]), Path::new("b")).unwrap();
        let mut out = Vec::new();
        mean.write(&mut out).unwrap();
        let expected = "step,time,replicas,A mean,A error,B mean,B error\n0,0,2,2,1,2,0\n5,0.5,2,3,0,6,2\n";
        assert_eq!(String::from_utf8(out).unwrap(), expected);
        let shorter = Series { steps: vec![0], times: vec![0.0], ..series([1, 2, 3, 4]) };
        assert!(mean.add(&shorter, Path::new("c")).unwrap_err().to_string().starts_with("c: "));
        assert_eq!(mean.replicas, 2);
    }
}
