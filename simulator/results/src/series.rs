use std::path::Path;

use crate::BYTES_PER_FIELD;
use lazygrid_sim::Error;
use lazygrid_sim::table::TableReader;

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Series {
    /// Names of the columns; see [`names`](lazygrid_sim::series::names).
    pub names: Vec<String>,
    pub steps: Vec<u32>,
    /// In s, by row.
    pub times: Vec<f64>,
    /// Row after row.
    pub counts: Vec<u64>,
}

impl Series {
    /// Reads a file.
    ///
    /// # Errors
    /// [`Error::Read`] with the line of a fault, and [`Error::TooLittleMemory`].
    pub fn read(path: &Path) -> Result<Self, Error> {
        let mut rows = TableReader::open(path, "step,time,", BYTES_PER_FIELD)?;
        let mut series = Self { names: rows.header().iter().skip(2).cloned().collect(), ..Self::default() };
        while let Some(row) = rows.next_row()? {
            series.steps.push(row.number(0)?);
            series.times.push(row.number(1)?);
            for column in 0..series.names.len() {
                series.counts.push(row.number(2 + column)?);
            }
        }
        Ok(series)
    }

    pub fn row(&self, row: usize) -> &[u64] {
        let width = self.names.len();
        &self.counts[row * width..][..width]
    }

    pub fn column(&self, column: usize) -> impl Iterator<Item = u64> + '_ {
        self.counts.iter().skip(column).step_by(self.names.len().max(1)).copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Series, String> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        Series::read(file.path()).map_err(|error| error.to_string())
    }

    #[test]
    fn a_series_is_read_back() {
        let series = read("step,time,A,A + B -> C\n0,0,5,0\n10,0.25,4,1\n").unwrap();
        assert_eq!(
            (series.names.len(), &series.steps[..], &series.times[..]),
            (2, &[0, 10][..], &[0.0, 0.25][..])
        );
        assert_eq!((series.row(1), series.column(1).collect::<Vec<_>>()), (&[4, 1][..], vec![0, 1]));
    }

    #[test]
    fn invalid_series_are_refused_by_line() {
        for (text, message) in [
            ("", "line 1: it does not begin"),
            ("step,time,A\n0,0,1\n1,0.1\n", "line 3: it has not 3 fields"),
            ("step,time,A\n0,0,x\n", "line 2: 'x' is not such a number"),
            ("step,time,A\n0,0,-1\n", "line 2: '-1' is not such a number"),
        ] {
            let error = read(text).unwrap_err();
            assert!(error.contains(message), "{error}");
        }
    }
}
