//! The simulator against closed forms, with fixed seeds and tolerances in standard errors, plus terms that the closed
//! form omits.
//!
//! `cargo test --release -p lazygrid-sim --test validation` (arguments select items by name)
#![expect(clippy::print_stdout, reason = "the table is what this is for")]

mod bacteria;
mod bodies;
mod burst;
mod cells;
mod channel;
mod chemotaxis;
mod crowd;
mod degrading;
mod diffusion;
mod dimensions;
mod flow_field;
mod identity;
mod membranes;
mod networks;
mod reactions;
mod receivers;
mod setup;
mod surface;
mod vessel;
mod walls;

use std::process::ExitCode;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

pub(crate) struct Row {
    pub(crate) what: String,
    pub(crate) expected: f64,
    pub(crate) measured: f64,
    pub(crate) tolerance: f64,
    pub(crate) must_differ: bool,
}

impl Row {
    pub(crate) fn new(what: impl Into<String>, expected: f64, measured: f64, tolerance: f64) -> Self {
        Self { what: what.into(), expected, measured, tolerance, must_differ: false }
    }

    pub(crate) fn exact(what: impl Into<String>, expected: u64, measured: u64) -> Self {
        Self::new(what, expected as f64, measured as f64, 0.0)
    }

    /// Tolerates four standard errors of the mean.
    pub(crate) fn mean(
        what: impl Into<String>,
        expected: f64,
        values: impl IntoIterator<Item = f64>,
    ) -> Self {
        let (measured, error) = setup::mean(values);
        Self::new(what, expected, measured, 4.0 * error)
    }

    /// Tolerates four standard errors of a fraction of `n`.
    pub(crate) fn fraction(what: impl Into<String>, expected: f64, measured: f64, n: impl Into<f64>) -> Self {
        Self::new(what, expected, measured, 4.0 * setup::fraction_error(expected, n.into()))
    }

    fn passes(&self) -> bool {
        let close = (self.measured - self.expected).abs() <= self.tolerance;
        close != self.must_differ && self.measured.is_finite()
    }
}

type Item = (&'static str, fn() -> Vec<Row>);

const ITEMS: [Item; 46] = [
    ("1-displacement", diffusion::displacement),
    ("2-absorbing", receivers::absorbing),
    ("3-transparent", receivers::transparent),
    ("4-burst", burst::pairs_of_a_point_burst),
    ("5-diffusion-limited", reactions::diffusion_limited),
    ("6-acid-base", burst::acid_base),
    ("7-well-mixed", reactions::well_mixed),
    ("8-hard-spheres", crowd::hard_spheres),
    ("9-identity", identity::same_bytes),
    ("10-gas-in-a-box", crowd::gas_between_walls),
    ("11-flow", receivers::absorbing_in_flow),
    ("12-equilibrium", networks::equilibrium),
    ("13-michaelis-menten", networks::michaelis_menten),
    ("14-births", networks::births),
    ("15-branching", networks::branching),
    ("16-rate-inside", networks::rate_inside),
    ("17-chain", networks::chain),
    ("18-on-off-keying", channel::on_off_keying),
    ("19-modulations", channel::other_modulations),
    ("20-vessel", vessel::flow_profiles),
    ("21-run-and-tumble", bacteria::run_and_tumble),
    ("22-conjugation", bacteria::conjugation),
    ("23-partial", bodies::partial),
    ("24-receptors", bodies::receptors),
    ("25-reflecting", bodies::reflecting),
    ("26-moving", bodies::moving),
    ("27-shift-keying", channel::shift_keying),
    ("28-elastic-pressure", crowd::elastic_pressure),
    ("29-crowded-diffusion", crowd::crowded_diffusion),
    ("30-long-steps", receivers::long_steps),
    ("31-neighbors", receivers::neighbors),
    ("32-drift-at-wall", receivers::drift_at_wall),
    ("33-absorbing-walls", walls::absorbing_walls),
    ("34-sphere", walls::inside_a_sphere),
    ("35-dimensions", dimensions::fewer_dimensions),
    ("36-moving-transmitters", bodies::transmitters),
    ("37-competition", bodies::competition),
    ("38-membranes", membranes::membranes),
    ("39-flow-fields", flow_field::flow_fields),
    ("40-chemotaxis", chemotaxis::chemotaxis),
    ("41-spherical-membranes", cells::spherical_membranes),
    ("42-surface-diffusion", surface::surface_diffusion),
    ("43-division", bacteria::division),
    ("44-drift-at-ends", vessel::drift_at_ends),
    ("45-degrading", degrading::degrading),
    ("46-exchange", networks::exchange),
];

fn main() -> ExitCode {
    // Options of the usual harness.
    let wanted: Vec<String> = std::env::args().skip(1).filter(|arg| !arg.starts_with('-')).collect();
    let is_wanted = |name: &str| wanted.is_empty() || wanted.iter().any(|w| name.contains(w.as_str()));
    let items: Vec<Item> = ITEMS.into_iter().filter(|(name, _)| is_wanted(name)).collect();
    println!("{:<20} {:<46} {:>14} {:>14} {:>12}", "item", "quantity", "expected", "measured", "tolerance");
    let (next, failed) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let work = || {
        // Later items take longer on average.
        while let Some(item) = items.iter().nth_back(next.fetch_add(1, Ordering::Relaxed)) {
            failed.fetch_add(run(item), Ordering::Relaxed);
        }
    };
    // Steps are too short for several threads.
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
                pool.expect("a pool of one thread").install(work);
            });
        }
    });
    if failed.into_inner() == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// Returns the number of failures.
fn run((name, measure): &Item) -> usize {
    let start = Instant::now();
    let rows = measure();
    let failed = rows.iter().filter(|row| !row.passes()).count();
    let mut table = String::new();
    for row in rows {
        let verdict = if row.passes() { "" } else { "  FAILS" };
        let sign = if row.must_differ { ">" } else { "" };
        let Row { what, expected, measured, tolerance, .. } = row;
        let tolerance = format!("{sign}{}", short(tolerance));
        let (expected, measured) = (short(expected), short(measured));
        table += &format!("{name:<20} {what:<46} {expected:>14} {measured:>14} {tolerance:>12}{verdict}\n");
    }
    println!("{table}{name:<20} took {:.1} s", start.elapsed().as_secs_f64());
    failed
}

fn short(value: f64) -> String {
    if value == 0.0 || value.abs() >= 1e-3 { format!("{value:.5}") } else { format!("{value:.1e}") }
}
