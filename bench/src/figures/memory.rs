//! Each engine runs [`measure`] in a separate process.

use std::error::Error;
use std::path::Path;
use std::process::Command;

use super::Contender;
use super::plan::DataPoint;
use super::row::{Row, Status};
use super::verify::Reference;
use crate::measure::Digest;
pub use crate::measure::memory::Sample;
use crate::measure::memory::sample;
use lazygrid_io::scenes::Scene;

const SEED: u64 = 1;

/// Measures an engine in this process, which must have done nothing else.
pub fn measure(contender: &str, scene: Scene, n: usize, steps: u32) -> Result<Sample, Box<dyn Error>> {
    let known = Contender::for_memory();
    let contender = known.iter().find(|e| e.to_string() == contender).ok_or_else(|| {
        let names: Vec<String> = known.iter().map(Contender::to_string).collect();
        format!("unknown contender '{contender}'; expected one of {}", names.join(", "))
    })?;
    sample(&contender.factory(scene, Scene::STEP), scene, n, steps, SEED)
}

pub(super) fn rows(point: &DataPoint, program: &Path) -> Result<Vec<Row>, Box<dyn Error>> {
    let mut spheres = point.scene.spheres(point.n, SEED);
    (0..point.runs as u32).for_each(|step| Scene::advance(&mut spheres, SEED, step));
    let reference = Reference::new(&spheres, None)?;
    let row = |&contender: &Contender| {
        let mut row = Row::new(point, contender);
        if cfg!(not(feature = "bullet"))
            && matches!(contender, Contender::BulletAsShipped | Contender::BulletTuned)
        {
            (row.status, row.reason) =
                (Status::NotAvailable, "not built in; build with --features bullet".into());
            return row;
        }
        let checked = spawn(point, contender, program).and_then(|sample| {
            reference.check(Digest { pairs: sample.pairs, sum: sample.sum })?;
            Ok(sample)
        });
        match checked {
            Ok(sample) => {
                row.pairs = sample.pairs;
                row.bytes = sample.bytes;
                row.wall = vec![sample.nanos * 1e-9 * point.n as f64];
            }
            Err(error) => (row.status, row.reason) = (Status::Error, error.to_string()),
        }
        row
    };
    Ok(point.contenders.iter().map(row).collect())
}

fn spawn(point: &DataPoint, contender: Contender, program: &Path) -> Result<Sample, Box<dyn Error>> {
    let output = Command::new(program)
        .args(["measure-memory", &contender.to_string(), point.scene.name()])
        .args([point.n.to_string(), point.runs.to_string()])
        .output()?;
    if !output.status.success() {
        let reason = String::from_utf8_lossy(&output.stderr);
        return Err(format!("{}: {}", output.status, reason.trim()).into());
    }
    Ok(serde_json::from_slice(&output.stdout)?)
}
