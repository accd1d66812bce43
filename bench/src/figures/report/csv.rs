use std::fmt::Write;

use super::super::row::{Results, Row};
use crate::measure::Spread;

const HEADER: &str = "figure,scene,n,at,engine,status,runs,pairs,tangent,wall_mean_s,wall_sd_s,wall_median_s,wall_min_s,\
wall_max_s,gpu_median_s,bytes_per_sphere,phases_s,reason\n";

pub(super) fn table(results: &Results) -> String {
    let mut out = HEADER.to_owned();
    results.rows.iter().for_each(|row| add(&mut out, row));
    out
}

fn add(out: &mut String, row: &Row) {
    let number = |value: f64| if value.is_finite() { format!("{value:.9}") } else { String::new() };
    let optional = |value: Option<f64>| value.map_or_else(String::new, |value| value.to_string());
    let (mean, sd) = row.mean();
    let wall = Spread::from_values(&row.wall);
    let phases: Vec<String> = row.phases.iter().map(|(name, time)| format!("{name}={time:.9}")).collect();
    let cells = [
        quoted(&row.figure),
        quoted(&row.scene),
        row.n.to_string(),
        optional(row.at),
        quoted(&row.engine),
        row.status.name().to_owned(),
        row.wall.len().to_string(),
        row.pairs.to_string(),
        row.tangent.to_string(),
        number(mean),
        number(sd),
        number(wall.median),
        number(wall.low),
        number(wall.high),
        number(Spread::from_values(&row.gpu).median),
        optional(row.bytes),
        quoted(&phases.join(" ")),
        quoted(&row.reason),
    ];
    let _ = writeln!(out, "{}", cells.join(","));
}

fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}
