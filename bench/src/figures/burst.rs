//! Figure 5: a burst of carriers of ten sizes from one point, driven by the simulator.

use std::error::Error;

use super::Engine;
use super::plan::Point;
use super::race::{Limits, Race};
use super::row::Row;

/// The rows of every moment at which the engines are timed.
pub(super) fn rows(
    point: &Point,
    limits: Limits,
    seed: u64,
    left_out: impl Fn(Engine) -> Option<String>,
) -> Result<Vec<Row>, Box<dyn Error>> {
    let _ = seed;
    let mut race = Race::new(point, limits, left_out);
    race.frame(&point.scene.spheres(point.n, seed), true)?;
    Ok(race.take_rows(Some(0.0)))
}

/// What is simulated, for the report.
pub(super) const DESCRIPTION: &str = "";
