//! The pairs of a scene by definition.

use glam::DVec3;
use lazygrid::{Interaction, Pair};

use crate::TestInput;
use crate::oracle::ImageOracle;

/// Largest distance from the origin in periods. Farther away, too few digits remain for the position in the
/// period.
const MAX_PERIODS: f64 = 1e4;
/// Error bounds of a distance along an axis: relative to the distance, and relative to the period.
const ROUNDING: [f64; 2] = [1e-6, 1e-9];

/// Spheres in `f64` (`is_wide`) are not wrapped into the box first.
pub(super) fn pairs(scenario: &TestInput, is_wide: bool) -> Vec<Pair> {
    let sieve = Sieve::new(scenario);
    let images = scenario.space.triclinic_cell().map(|_| ImageOracle::new(&scenario.space));
    let is_pair = |i: usize, j: usize| {
        let cutoff = scenario.cutoff(i, j);
        cutoff.is_some_and(|cutoff| match &images {
            None if is_wide => distance_squared_of_wide(scenario, i, j) <= cutoff * cutoff,
            None => scenario.distance_squared(i, j) <= cutoff * cutoff,
            Some(images) => {
                let [a, b] = [i, j].map(|k| scenario.spheres[k].center.as_dvec3());
                images.distance_squared(a - b, cutoff) <= cutoff * cutoff
            }
        })
    };
    let mut pairs = Vec::new();
    for i in 0..scenario.spheres.len() {
        for j in i + 1..scenario.spheres.len() {
            if sieve.may_pair(i, j) && is_pair(i, j) {
                pairs.push(Pair { i: i as u32, j: j as u32 });
            }
        }
    }
    pairs
}

fn distance_squared_of_wide(scenario: &TestInput, i: usize, j: usize) -> f64 {
    let [from, to] = [i, j].map(|k| scenario.spheres[k].center.as_dvec3().to_array());
    let [x, y, z] = scenario.space.minimum_image(from, to).vector;
    x * x + y * y + z * z
}

struct Sieve {
    axes: Vec<Axis>,
}

struct Axis {
    positions: Vec<f64>,
    period: f64,
    max_distance: f64,
}

impl Sieve {
    fn new(scenario: &TestInput) -> Self {
        let largest_cutoff = largest_cutoff(scenario);
        let axis = |row: DVec3, period: f64| Axis::new(scenario, row, period, largest_cutoff);
        let axes = match scenario.space.triclinic_cell() {
            Some(_) => ImageOracle::new(&scenario.space)
                .fractions()
                .iter()
                .map(|&row| axis(row, row.length().recip()))
                .collect::<Vec<_>>(),
            None => (0..3)
                .map(|k| match scenario.space.lengths()[k] {
                    None => axis(DVec3::AXES[k], f64::INFINITY),
                    Some(length) => axis(DVec3::AXES[k] / length, length),
                })
                .collect(),
        };
        Self { axes: axes.into_iter().flatten().collect() }
    }

    fn may_pair(&self, i: usize, j: usize) -> bool {
        self.axes.iter().all(|Axis { positions, period, max_distance }| {
            let apart = (positions[i] - positions[j]).abs();
            apart.min(period - apart) <= *max_distance
        })
    }
}

impl Axis {
    /// Returns `None` if too few digits remain.
    fn new(scenario: &TestInput, row: DVec3, period: f64, largest_cutoff: f64) -> Option<Self> {
        let mut positions: Vec<f64> =
            scenario.spheres.iter().map(|sphere| row.dot(sphere.center.as_dvec3())).collect();
        let mut max_distance = largest_cutoff * (1.0 + ROUNDING[0]);
        if period.is_finite() {
            if positions.iter().any(|position| position.abs() > MAX_PERIODS) {
                return None;
            }
            positions.iter_mut().for_each(|position| *position = (*position - position.floor()) * period);
            max_distance += period * ROUNDING[1];
        }
        Some(Self { positions, period, max_distance })
    }
}

fn largest_cutoff(scenario: &TestInput) -> f64 {
    let radius = scenario.spheres.iter().map(|sphere| sphere.radius).fold(0.0, f32::max);
    let rows = scenario.mixture.iter().flat_map(|mixture| mixture.rows.iter().flatten());
    let distances = rows.map(|interaction| match interaction {
        Interaction::Within(distance) => *distance,
        Interaction::Never | Interaction::Touch => 0.0,
    });
    distances.fold(2.0 * f64::from(radius), f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detectors::sequence::Sequence;

    #[test]
    fn definition_matches_the_oracle() {
        let (mut pairs_seen, mut triclinic) = (0, 0);
        let drawn = |seed| [Sequence::drawn(seed, true, false), Sequence::round(seed, true, false)];
        for sequence in (0..400).flat_map(drawn) {
            let is_valid = |scenario: &&TestInput| {
                let is_known = |mixture: &crate::SpeciesSetup| {
                    mixture.species.iter().all(|&id| (id as usize) < mixture.rows.len())
                };
                scenario.spheres.len() < 300
                    && scenario.spheres.iter().all(|sphere| sphere.is_valid())
                    && scenario.mixture.as_ref().is_none_or(is_known)
            };
            let scenarios = sequence.steps.iter().map(|step| &step.scenario);
            for scenario in scenarios.filter(is_valid) {
                let found = pairs(scenario, false);
                assert_eq!(found, scenario.oracle(), "{sequence}");
                pairs_seen += found.len();
                triclinic += usize::from(scenario.space.triclinic_cell().is_some());
            }
        }
        assert!(pairs_seen > 10_000 && triclinic > 100, "{pairs_seen} pairs, {triclinic} triclinic scenes");
    }
}
