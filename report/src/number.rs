pub fn count(n: usize) -> String {
    match n {
        1_000_000.. if n.is_multiple_of(100_000) => format!("{} M", n as f64 / 1e6),
        1000.. if n.is_multiple_of(100) => format!("{} k", n as f64 / 1e3),
        _ => n.to_string(),
    }
}

/// Returns a suitable unit and the number of these units per second.
pub fn unit(seconds: f64) -> (f64, &'static str) {
    match seconds {
        s if s < 1e-9 => (1e12, "ps"),
        s if s < 1e-6 => (1e9, "ns"),
        s if s < 1e-3 => (1e6, "µs"),
        s if s < 1.0 => (1e3, "ms"),
        _ => (1.0, "s"),
    }
}

pub fn three_figures(value: f64) -> String {
    let digits = if value < 10.0 { 2 } else { usize::from(value < 100.0) };
    format!("{value:.digits$}")
}

pub fn time(seconds: f64) -> String {
    let (factor, unit) = unit(seconds);
    format!("{} {unit}", three_figures(seconds * factor))
}
