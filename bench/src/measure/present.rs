use std::fmt::{self, Write as _};
use std::process::Command;

/// Median and range; NaN without values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    pub median: f64,
    pub low: f64,
    pub high: f64,
}

impl Spread {
    pub fn from_values(values: &[f64]) -> Self {
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let at = |k: usize| sorted.get(k).copied().unwrap_or(f64::NAN);
        let middle = sorted.len() / 2;
        let median = match sorted.len() % 2 {
            1 => at(middle),
            _ => 0.5 * (at(middle.wrapping_sub(1)) + at(middle)),
        };
        Self { median, low: at(0), high: at(sorted.len().wrapping_sub(1)) }
    }
}

impl fmt::Display for Spread {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.2} ({:.2}–{:.2})", self.median, self.low, self.high)
    }
}

pub fn markdown(header: &[&str], rows: &[Vec<String>]) -> String {
    let cells = |row: &mut dyn Iterator<Item = &str>| format!("| {} |", row.collect::<Vec<_>>().join(" | "));
    let mut table = String::new();
    let rule = header.iter().map(|_| "---");
    let head = [cells(&mut header.iter().copied()), cells(&mut rule.into_iter())];
    let body = rows.iter().map(|row| cells(&mut row.iter().map(String::as_str)));
    for line in head.into_iter().chain(body) {
        let _ = writeln!(table, "{line}");
    }
    table
}

pub fn provenance() -> String {
    let run = |program: &str, args: &[&str]| {
        let output = Command::new(program).args(args).output().ok().filter(|o| o.status.success())?;
        String::from_utf8(output.stdout).ok().map(|text| text.trim().to_owned())
    };
    let or_unknown = |text: Option<String>| text.unwrap_or_else(|| "unknown".to_owned());
    let cpu = std::fs::read_to_string("/proc/cpuinfo").ok().and_then(|info| {
        let line = info.lines().find(|line| line.starts_with("model name"))?;
        line.split_once(':').map(|(_, name)| name.trim().to_owned())
    });
    let cores = std::thread::available_parallelism().map_or(0, usize::from);
    let date = or_unknown(run("date", &["-u", "+%F %H:%M UTC"]));
    format!("{}, {cores} cores; {date}; commit {}", or_unknown(cpu), crate::COMMIT)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spread_of_few_values() {
        assert_eq!(Spread::from_values(&[3.0, 1.0, 2.0]), Spread { median: 2.0, low: 1.0, high: 3.0 });
        assert_eq!(Spread::from_values(&[4.0, 1.0]).median, 2.5);
        assert!(Spread::from_values(&[]).median.is_nan());
    }

    #[test]
    fn tables_have_a_rule() {
        let table = markdown(&["a", "b"], &[vec!["1".into(), "2".into()]]);
        assert_eq!(table, "| a | b |\n| --- | --- |\n| 1 | 2 |\n");
    }
}
