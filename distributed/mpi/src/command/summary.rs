use std::fmt;
use std::path::PathBuf;
use std::time::Duration;

use lazygrid::Space;
use lazygrid_io::read::Precision;
use lazygrid_mpi::Report;
use serde_json::{Map, Value, json};

pub(crate) struct Summary<'a> {
    pub(crate) report: &'a Report,
    pub(crate) space: Space,
    pub(crate) precision: Precision,
    pub(crate) files: Vec<PathBuf>,
    /// Times of rank 0, including waits.
    pub(crate) times: Vec<(&'static str, Duration)>,
}

impl Summary<'_> {
    /// Scripts depend on its names.
    pub(crate) fn json(&self) -> String {
        let report = self.report;
        let times: Map<String, Value> =
            self.times.iter().map(|(name, time)| ((*name).to_owned(), time.as_secs_f64().into())).collect();
        let object = json!({
            "ranks": report.owned.ranks,
            "spheres": report.owned.total,
            "pairs": report.pairs.total,
            "periodic": self.space.is_periodic().then(|| self.space.lengths()),
            "cell_vectors": self.space.triclinic_cell().map(|_| self.space.cell_vectors()),
            "precision": self.precision.name(),
            "ghosts": report.ghosts.total,
            "imbalance": { "spheres": report.owned.imbalance(), "pairs": report.pairs.imbalance() },
            "reason": report.detector,
            "files": self.files.iter().map(|file| file.to_string_lossy()).collect::<Vec<_>>(),
            "phases": times,
        });
        format!("{object}\n")
    }
}

impl fmt::Display for Summary<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let report = self.report;
        let mut row = |name: &str, value: &dyn fmt::Display| writeln!(f, "{name:<11}{value}");
        row("ranks", &report.owned.ranks)?;
        row("precision", &self.precision)?;
        row("spheres", &format_args!("{} (max/mean {:.3})", report.owned.total, report.owned.imbalance()))?;
        row("ghosts", &report.ghosts.total)?;
        row("pairs", &format_args!("{} (max/mean {:.3})", report.pairs.total, report.pairs.imbalance()))?;
        row("why", &report.detector)?;
        if let Some(file) = self.files.first() {
            row("output", &file.display())?;
        }
        let total: Duration = self.times.iter().map(|(_, time)| *time).sum();
        let mut title = "time";
        for (name, time) in self.times.iter().copied().chain([("total", total)]) {
            let shown = format!("{time:.2?}");
            writeln!(f, "{title:<11}{name:<10}{shown:>10}")?;
            title = "";
        }
        Ok(())
    }
}
