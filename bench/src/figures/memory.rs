//! Memory per sphere: each engine in a process of its own, which runs [`measure`].

use std::error::Error;
use std::path::Path;
use std::process::Command;

use super::Engine;
use super::plan::Point;
use super::row::{Row, Status};
pub use crate::measure::memory::Sample;
use crate::measure::memory::sample;
use crate::scenes::Scene;

/// What an engine takes in this process, which must have done nothing else.
///
/// # Errors
/// For an unknown engine, and whatever the engine refuses.
pub fn measure(engine: &str, scene: Scene, n: usize, steps: u32) -> Result<Sample, Box<dyn Error>> {
    let known = Engine::for_memory();
    let engine = known.iter().find(|e| e.to_string() == engine).ok_or_else(|| {
        let names: Vec<String> = known.iter().map(Engine::to_string).collect();
        format!("unknown engine '{engine}'; expected one of {}", names.join(", "))
    })?;
    sample(&engine.contender(scene, n), scene, n, steps, 1)
}

/// One row per engine. `program` is the `lazygrid` command.
pub(super) fn rows(point: &Point, program: &Path) -> Vec<Row> {
    let row = |&engine: &Engine| {
        let mut row = Row::new(point, engine);
        if cfg!(not(feature = "bullet")) && matches!(engine, Engine::BulletAsShipped | Engine::BulletTuned) {
            (row.status, row.reason) =
                (Status::NotAvailable, "not built in; build with --features bullet".into());
            return row;
        }
        match spawn(point, engine, program) {
            Ok(sample) => {
                row.pairs = sample.pairs;
                row.bytes = sample.bytes;
                row.wall = vec![sample.nanos * 1e-9 * point.n as f64];
            }
            Err(error) => (row.status, row.reason) = (Status::Error, error.to_string()),
        }
        row
    };
    let mut rows: Vec<Row> = point.engines.iter().map(row).collect();
    let expected = rows.iter().find(|row| row.status == Status::Ok).map(|row| row.pairs);
    for row in &mut rows {
        if row.status == Status::Ok && Some(row.pairs) != expected {
            (row.status, row.reason) = (Status::Error, format!("wrong answer: {} pairs", row.pairs));
        }
    }
    rows
}

fn spawn(point: &Point, engine: Engine, program: &Path) -> Result<Sample, Box<dyn Error>> {
    let output = Command::new(program)
        .args(["measure-memory", &engine.to_string(), point.scene.name()])
        .args([point.n.to_string(), point.runs.to_string()])
        .output()?;
    if !output.status.success() {
        let reason = String::from_utf8_lossy(&output.stderr);
        return Err(format!("{}: {}", output.status, reason.trim()).into());
    }
    Ok(serde_json::from_slice(&output.stdout)?)
}
