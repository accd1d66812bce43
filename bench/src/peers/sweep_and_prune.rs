//! Sweep and prune along one axis, as in N3Sim. Each sort by lower ends starts from the previous order.

use std::error::Error;

use glam::DVec3;
use lazygrid::{Pair, Sphere};

use super::{half_extent, touch};
use crate::measure::{ContenderFactory, Found, PairFinder};

/// Sweeps along the axis of (nearly) the largest variance.
pub fn incremental() -> ContenderFactory {
    ContenderFactory::new("sort-and-sweep (N3Sim)", || Ok(Sweep::default()))
}

/// An extent along the axis. The copy of the sphere lets the sweep read memory in order.
#[derive(Clone, Copy, Debug)]
pub(super) struct Interval {
    low: f32,
    high: f32,
    pub(super) index: u32,
    sphere: Sphere,
}

impl Interval {
    pub(super) fn new(sphere: &Sphere, index: u32, axis: usize) -> Self {
        let (middle, half) = (sphere.center[axis], half_extent(sphere));
        Self { low: middle - half, high: middle + half, index, sphere: *sphere }
    }
}

/// Ratio of variances above which the axis changes. A new axis makes the stored order useless, and in a round
/// cloud the axis of the largest variance is random.
const AXIS_CHANGE_RATIO: f64 = 1.5;

#[derive(Default)]
struct Sweep {
    axis: usize,
    intervals: Vec<Interval>,
    pairs: Vec<Pair>,
}

impl PairFinder for Sweep {
    fn run(&mut self, spheres: &[Sphere]) -> Result<Found<'_>, Box<dyn Error>> {
        let spread = variances(spheres);
        let widest = spread.max_position();
        if spread[widest] > AXIS_CHANGE_RATIO * spread[self.axis] {
            self.axis = widest;
        }
        let axis = self.axis;
        if self.intervals.len() == spheres.len() {
            for interval in &mut self.intervals {
                *interval = Interval::new(&spheres[interval.index as usize], interval.index, axis);
            }
        } else {
            self.intervals.clear();
            self.intervals.extend((0..).zip(spheres).map(|(k, sphere)| Interval::new(sphere, k, axis)));
        }
        sort(&mut self.intervals);
        self.pairs.clear();
        let pairs = &mut self.pairs;
        sweep(&self.intervals, |a, b| pairs.push(Pair::new(a.index, b.index)));
        Ok(Found::Pairs(&self.pairs))
    }
}

/// Takes linear time if little has changed.
pub(super) fn sort(intervals: &mut [Interval]) {
    // After too many moves, a general sort takes over from insertion.
    let patience = 8 * intervals.len();
    let mut moved = 0;
    for k in 1..intervals.len() {
        let this = intervals[k];
        let mut to = k;
        while to > 0 && intervals[to - 1].low > this.low {
            intervals[to] = intervals[to - 1];
            to -= 1;
        }
        intervals[to] = this;
        moved += k - to;
        if moved > patience {
            intervals.sort_unstable_by(|a, b| a.low.total_cmp(&b.low));
            return;
        }
    }
}

#[inline]
pub(super) fn sweep(intervals: &[Interval], mut found: impl FnMut(&Interval, &Interval)) {
    for (k, a) in intervals.iter().enumerate() {
        for b in &intervals[k + 1..] {
            if b.low > a.high {
                break;
            }
            if touch(&a.sphere, &b.sphere) {
                found(a, b);
            }
        }
    }
}

fn variances(spheres: &[Sphere]) -> DVec3 {
    let n = spheres.len().max(1) as f64;
    let (mut sum, mut squares) = (DVec3::ZERO, DVec3::ZERO);
    for sphere in spheres {
        let center = sphere.center.as_dvec3();
        sum += center;
        squares += center * center;
    }
    squares / n - (sum / n) * (sum / n)
}
