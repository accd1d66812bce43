use std::fmt::{self, Write};
use std::path::PathBuf;
use std::time::Duration;

use lazygrid::{Report, Space, gpu};
use lazygrid_io::read::Precision;
use serde::Serialize;
use serde_json::{Map, Value, json};

pub(crate) struct Summary {
    pub(crate) frame: usize,
    pub(crate) step: Option<i64>,
    pub(crate) space: Space,
    pub(crate) space_given: bool,
    pub(crate) precision: Precision,
    pub(crate) report: Report,
    pub(crate) species: usize,
    pub(crate) read: Duration,
    pub(crate) write: Option<Duration>,
    pub(crate) output: Option<PathBuf>,
}

/// Scripts depend on these names.
#[derive(Serialize)]
struct Object<'a> {
    frame: usize,
    step: Option<i64>,
    /// Lengths by axis.
    periodic: Option<[Option<f64>; 3]>,
    /// The cell vectors of a box that is not along the axes.
    cell_vectors: Option<[Option<[f64; 3]>; 3]>,
    periodic_from: Option<&'a str>,
    precision: &'a str,
    spheres: u64,
    pairs: u64,
    backend: &'a str,
    adapter: Option<&'a str>,
    algorithm: &'a str,
    reason: &'a str,
    gpu: Option<Value>,
    candidates: Option<Value>,
    phases: Map<String, Value>,
}

impl Summary {
    pub(crate) fn json(&self) -> String {
        let report = &self.report;
        let object = Object {
            frame: self.frame,
            step: self.step,
            periodic: self.space.is_periodic().then(|| self.space.lengths()),
            cell_vectors: self.space.triclinic_cell().map(|_| self.space.cell_vectors()),
            periodic_from: self.space_said().then_some(if self.space_given { "option" } else { "file" }),
            precision: self.precision.name(),
            spheres: report.spheres,
            pairs: report.pairs,
            backend: report.backend.name(),
            adapter: report.adapter.as_deref(),
            algorithm: report.algorithm.name(),
            reason: &report.reason,
            gpu: report.cost.as_ref().map(cost_object),
            candidates: report.candidates.as_ref().map(candidates_object),
            phases: self.phases().map(|(name, time)| (name.to_owned(), time.as_secs_f64().into())).collect(),
        };
        let mut line = serde_json::to_string(&object).unwrap_or_default();
        line.push('\n');
        line
    }

    fn space_said(&self) -> bool {
        self.space_given || self.space.is_periodic()
    }

    fn phases(&self) -> impl Iterator<Item = (&'static str, Duration)> {
        let search = self.report.phases.iter().map(|phase| (phase.name, phase.time));
        std::iter::once(("read", self.read)).chain(search).chain(self.write.map(|time| ("write", time)))
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let report = &self.report;
        let mut row = |name: &str, value: &dyn fmt::Display| writeln!(f, "{name:<11}{value}");
        match self.step {
            Some(step) => row("frame", &format_args!("{} (step {step})", self.frame))?,
            None => row("frame", &self.frame)?,
        }
        if self.space_said() {
            let source = match self.space_given {
                true => "--periodic",
                false => "as the file says; --periodic none for unbounded space",
            };
            row("periodic", &format_args!("{} ({source})", lengths(self.space)))?;
        }
        row("precision", &self.precision)?;
        match self.species {
            0 => row("spheres", &report.spheres)?,
            species => row("spheres", &format_args!("{} of {species} species", report.spheres))?,
        }
        row("pairs", &report.pairs)?;
        row("algorithm", &report.algorithm)?;
        match &report.adapter {
            Some(adapter) => row("backend", &format_args!("{} ({adapter})", report.backend))?,
            None => row("backend", &report.backend)?,
        }
        row("why", &report.reason)?;
        if let Some(output) = &self.output {
            row("output", &output.display())?;
        }
        let waits = self.phases().any(|(name, _)| name == "wait");
        let is_waited_for = |name: &str| waits && gpu::GpuPhase::ALL.iter().any(|phase| phase.name() == name);
        let total: Duration =
            self.phases().filter(|(name, _)| !is_waited_for(name)).map(|(_, time)| time).sum();
        let mut title = "time";
        for (name, time) in self.phases().chain([("total", total)]) {
            let mut shown = String::new();
            write!(shown, "{time:.2?}")?;
            writeln!(f, "{title:<11}{name:<10}{shown:>10}")?;
            title = "";
        }
        Ok(())
    }
}

fn candidates_object(stats: &lazygrid::CandidateListStats) -> Value {
    json!({
        "count": stats.count, "age": stats.age, "displacement_fraction": stats.displacement_fraction,
        "rebuilt": stats.rebuilt.map(|why| why.to_string()),
    })
}

pub(crate) fn cost_object(cost: &gpu::CallCost) -> Value {
    json!({
        "dispatches": cost.dispatches, "working_bytes": cost.working_bytes, "pair_bytes": cost.pair_bytes,
        "traffic_bytes": cost.traffic_bytes,
    })
}

pub(crate) fn cost_text(cost: &gpu::CallCost) -> String {
    let per_sphere = |bytes: u64| bytes as f64 / f64::from(cost.spheres.max(1));
    let moved = cost.traffic_bytes.map_or(String::new(), |bytes| format!(", moves {:.0}", per_sphere(bytes)));
    format!("{} dispatches, {:.0} bytes a sphere{moved}", cost.dispatches, per_sphere(cost.working_bytes))
}

fn lengths(space: Space) -> String {
    if space.triclinic_cell().is_some() {
        let vectors = space.cell_vectors().map(|vector| match vector {
            None => "-".to_owned(),
            Some([x, y, z]) => format!("({x},{y},{z})"),
        });
        return format!("along {}", vectors.join(" "));
    }
    if !space.is_periodic() {
        return "none".to_owned();
    }
    space.lengths().map(|length| length.map_or("-".to_owned(), |length| length.to_string())).join(",")
}
