use std::io::{self, Write};

use crate::channel::{Channels, link_name};
use crate::columns::groups;
use crate::mean::MeanSeries;
use lazygrid_sim::Model;

#[derive(Clone, Debug, PartialEq)]
pub struct SweepResult {
    /// Such as `particles` or `bit errors`.
    pub group: &'static str,
    pub name: String,
    /// Mean over replicas, or over the bits of all replicas.
    pub value: f64,
    /// One standard error around the mean, or the 95 % interval; `None` for one replica.
    pub bounds: Option<[f64; 2]>,
}

/// Group that plots show on logarithmic axes.
pub const BIT_ERRORS: &str = "bit errors";

#[derive(Clone, Debug, PartialEq)]
pub struct SweepRow {
    pub values: Vec<String>,
    pub replicas: u64,
    pub results: Vec<SweepResult>,
}

impl SweepRow {
    /// Returns the series' last row, and by link the arrived fraction, peak time, late fraction and lowest bit error
    /// rate.
    pub fn new(values: Vec<String>, model: &Model, mean: &MeanSeries, channels: &Channels) -> Self {
        let mut row = Self { values, replicas: mean.replicas, results: Vec::new() };
        if let Some(last) = mean.steps.len().checked_sub(1) {
            for group in groups(model) {
                for column in group.columns {
                    let sample = mean.row(last)[column];
                    row.add(group.name, mean.names[column].clone(), sample.mean(), sample.standard_error());
                }
            }
        }
        row.add_channels(channels, model);
        row
    }

    fn add(&mut self, group: &'static str, name: String, value: f64, error: Option<f64>) {
        let bounds = error.map(|error| [value - error, value + error]);
        self.results.push(SweepResult { group, name, value, bounds });
    }

    fn add_channels(&mut self, channels: &Channels, model: &Model) {
        for response in &channels.responses {
            let name = link_name(response.link, model);
            let bin = f64::from(response.width) * model.time_step;
            let means = || response.fractions.iter().enumerate().filter(|(_, fraction)| fraction.count() > 0);
            // `max_by` returns the last of equal bins, which is the first in reverse.
            if let Some((k, _)) = means().rev().max_by(|a, b| a.1.mean().total_cmp(&b.1.mean())) {
                self.add("peak time", format!("{name} peak time"), (k as f64 + 0.5) * bin, None);
            }
            if let Some(fraction) = response.cumulative.iter().rfind(|fraction| fraction.count() > 0) {
                self.add(
                    "arrived fraction",
                    format!("{name} arrived fraction"),
                    fraction.mean(),
                    fraction.standard_error(),
                );
            }
        }
        for interference in channels.interference.iter().filter(|interference| interference.late.count() > 0)
        {
            let name = format!("{} late fraction", link_name(interference.link, model));
            self.add("late fraction", name, interference.late.mean(), interference.late.standard_error());
        }
        for errors in channels.least_errors() {
            let wrong = errors.at(&errors.best()).1;
            let (value, bounds) = (wrong as f64 / errors.bits as f64, Some(errors.interval(wrong)));
            let name = format!("{} bit error rate", errors.name(model));
            self.results.push(SweepResult { group: BIT_ERRORS, name, value, bounds });
        }
    }
}

/// Writes a row per point. Missing results are empty.
pub fn write(out: &mut impl Write, keys: &[String], rows: &[SweepRow]) -> io::Result<()> {
    let mut names: Vec<&str> = Vec::new();
    for result in rows.iter().flat_map(|row| &row.results) {
        if !names.contains(&&result.name[..]) {
            names.push(&result.name);
        }
    }
    write!(out, "point,{},replicas", keys.join(","))?;
    names.iter().try_for_each(|name| write!(out, ",{name},{name} low,{name} high"))?;
    writeln!(out)?;
    for (point, row) in rows.iter().enumerate() {
        write!(out, "{point},{},{}", row.values.join(","), row.replicas)?;
        for name in &names {
            let result = row.results.iter().find(|result| result.name == *name);
            let value = result.map_or(String::new(), |result| result.value.to_string());
            let bounds = result.and_then(|result| result.bounds);
            let [low, high] =
                bounds.map_or_else(Default::default, |bounds| bounds.map(|end| end.to_string()));
            write!(out, ",{value},{low},{high}")?;
        }
        writeln!(out)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::response::{Link, Response, SourceSpecies};
    use crate::symbols::tests::model;

    #[test]
    fn peak_time_is_that_of_the_first_of_equal_bins() {
        let link = Link { transmitter: 0, receiver: 0, species: 0 };
        let mut response = Response::new(link, SourceSpecies::Arriving, 10, 4);
        response
            .fractions
            .iter_mut()
            .zip([0.1, 0.3, 0.2, 0.3])
            .for_each(|(fraction, value)| fraction.add(value));
        let channels = Channels { responses: vec![response], ..Channels::default() };
        let row = SweepRow::new(Vec::new(), &model(), &MeanSeries::default(), &channels);
        let peak = row.results.iter().find(|result| result.group == "peak time").unwrap();
        assert_eq!(peak.value, 1.5);
    }

    #[test]
    fn a_result_that_a_point_lacks_is_empty() {
        let result =
            |name: &str, bounds| SweepResult { group: "particles", name: name.into(), value: 2.0, bounds };
        let row = |value: &str, results| SweepRow { values: vec![value.into()], replicas: 3, results };
        let rows = [
            row("5", vec![result("A", Some([1.5, 2.5]))]),
            row("10", vec![result("A", None), result("B", None)]),
        ];
        let mut out = Vec::new();
        write(&mut out, &["d".to_owned()], &rows).unwrap();
        let expected = "point,d,replicas,A,A low,A high,B,B low,B high\n0,5,3,2,1.5,2.5,,,\n1,10,3,2,,,2,,\n";
        assert_eq!(String::from_utf8(out).unwrap(), expected);
    }
}
