//! Mean and variance of a scene's pairs, in closed form.

use std::f64::consts::{FRAC_1_SQRT_2, PI};

use super::{CenterDistribution, SizeGroup};

/// The distribution over seeds of the number of overlapping pairs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairCount {
    /// Mean.
    pub mean: f64,
    /// Variance.
    pub variance: f64,
}

impl PairCount {
    /// Returns the distance of `count` from the mean in standard deviations.
    pub fn deviations(self, count: u64) -> f64 {
        let distance = count as f64 - self.mean;
        if distance == 0.0 { 0.0 } else { distance / self.variance.sqrt() }
    }
}

/// Returns the pairs of uniform spheres, `(count, radius)` per size, in a periodic cube with sides of at
/// least twice the largest sum of radii.
pub fn periodic_box_pairs(sizes: &[(u64, f64)], volume: f64) -> PairCount {
    let classes: Vec<SizeGroup> =
        sizes.iter().map(|&(count, radius)| SizeGroup { count: count as f64, radius }).collect();
    independent(&classes, |cutoff| 4.0 / 3.0 * PI * cutoff.powi(3) / volume)
}

pub(super) fn pairs(classes: &[SizeGroup], cloud: CenterDistribution) -> PairCount {
    let pairs = independent(classes, |cutoff| cloud.hit(cutoff));
    PairCount { variance: pairs.variance + shared(classes, cloud), ..pairs }
}

/// Returns the σ with `per_sphere` pairs per sphere; 0 if none exists.
pub(super) fn sigma_for(classes: &[SizeGroup], per_sphere: f64) -> f64 {
    let wanted = per_sphere * classes.iter().map(|c| c.count).sum::<f64>();
    let mean = |sigma| independent(classes, |cutoff| CenterDistribution::Normal { sigma }.hit(cutoff)).mean;
    if mean(0.0) <= wanted {
        return 0.0;
    }
    let mut low = 0.0;
    let mut high = 1.0;
    while mean(high) > wanted {
        (low, high) = (high, 2.0 * high);
    }
    // Bisects to the last bit, which needs no tolerance.
    loop {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            return middle;
        }
        if mean(middle) > wanted { low = middle } else { high = middle }
    }
}

fn independent(classes: &[SizeGroup], hit: impl Fn(f64) -> f64) -> PairCount {
    let mut total = PairCount { mean: 0.0, variance: 0.0 };
    for (k, a) in classes.iter().enumerate() {
        for (l, b) in classes.iter().enumerate().take(k + 1) {
            let combinations = if k == l { a.count * (a.count - 1.0) / 2.0 } else { a.count * b.count };
            let p = hit(a.radius + b.radius);
            total.mean += combinations.max(0.0) * p;
            total.variance += combinations.max(0.0) * p * (1.0 - p);
        }
    }
    total
}

/// Covariance of pairs that share a sphere. In bursts it far outweighs the independent part.
fn shared(classes: &[SizeGroup], cloud: CenterDistribution) -> f64 {
    classes
        .iter()
        .enumerate()
        .map(|(k, a)| {
            let partners = |l: usize| (classes[l].count - if k == l { 1.0 } else { 0.0 }).max(0.0);
            // Products of distinct partners: all products, less the squares.
            let moments = cloud.average(|distance| {
                let mut sum = 0.0;
                let mut same_partner = 0.0;
                for (l, b) in classes.iter().enumerate() {
                    let cutoff = a.radius + b.radius;
                    let deviation = cloud.hit_at(distance, cutoff) - cloud.hit(cutoff);
                    sum += partners(l) * deviation;
                    same_partner += partners(l) * deviation * deviation;
                }
                sum * sum - same_partner
            });
            a.count * moments
        })
        .sum()
}

impl CenterDistribution {
    fn hit(self, cutoff: f64) -> f64 {
        match self {
            Self::Ball { radius } => {
                let u = cutoff / radius;
                if u >= 2.0 { 1.0 } else { u.powi(3) - 9.0 / 16.0 * u.powi(4) + u.powi(6) / 32.0 }
            }
            Self::Normal { sigma } => {
                let x = cutoff / (std::f64::consts::SQRT_2 * sigma);
                if x > 10.0 {
                    return 1.0;
                }
                libm::erf(x * FRAC_1_SQRT_2) - (2.0 / PI).sqrt() * x * libm::exp(-0.5 * x * x)
            }
        }
    }

    /// Probability that a center is within `cutoff` of a point at `distance` from the middle.
    fn hit_at(self, distance: f64, cutoff: f64) -> f64 {
        match self {
            Self::Ball { radius } => lens(distance, cutoff, radius) / radius.powi(3),
            Self::Normal { sigma } => {
                let (near, far) = ((distance - cutoff) / sigma, (distance + cutoff) / sigma);
                let bell = |x: f64| libm::exp(-0.5 * x * x);
                let erf = |x: f64| libm::erf(x * FRAC_1_SQRT_2);
                0.5 * (erf(far) - erf(near)) - sigma / distance / (2.0 * PI).sqrt() * (bell(near) - bell(far))
            }
        }
    }

    fn average(self, f: impl Fn(f64) -> f64) -> f64 {
        const POINTS: u32 = 1000;
        let outer = match self {
            Self::Ball { radius } => radius,
            Self::Normal { sigma: 0.0 } => return 0.0,
            // 1e-14 of the cloud is farther out.
            Self::Normal { sigma } => 8.0 * sigma,
        };
        let (sum, weights) = (0..POINTS).fold((0.0, 0.0), |(sum, weights), k| {
            let distance = outer * (f64::from(k) + 0.5) / f64::from(POINTS);
            let weight = distance
                * distance
                * match self {
                    Self::Ball { .. } => 1.0,
                    Self::Normal { sigma } => libm::exp(-0.5 * (distance / sigma).powi(2)),
                };
            (sum + weight * f(distance), weights + weight)
        });
        sum / weights
    }
}

/// Common volume of two balls at a distance `d > 0`, in 4π/3.
fn lens(d: f64, a: f64, b: f64) -> f64 {
    if d >= a + b {
        0.0
    } else if d <= (a - b).abs() {
        a.min(b).powi(3)
    } else {
        (a + b - d).powi(2) * (d * d + 2.0 * d * (a + b) - 3.0 * (a - b).powi(2)) / (16.0 * d)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CLOUDS: [CenterDistribution; 2] =
        [CenterDistribution::Ball { radius: 3.0 }, CenterDistribution::Normal { sigma: 1.5 }];

    #[test]
    fn the_chance_about_a_point_averages_to_the_chance_of_a_pair() {
        for cloud in CLOUDS {
            for cutoff in [0.1, 1.0, 2.5, 4.0, 5.9] {
                let (mean, whole) = (cloud.average(|d| cloud.hit_at(d, cutoff)), cloud.hit(cutoff));
                assert!((mean / whole - 1.0).abs() < 1e-4, "{cloud:?}, cutoff {cutoff}: {mean}, {whole}");
            }
        }
    }

    #[test]
    fn two_spheres_are_a_coin_toss() {
        for cloud in CLOUDS {
            let p = cloud.hit(2.0);
            let two = pairs(&[SizeGroup { count: 2.0, radius: 1.0 }], cloud);
            assert!((two.mean - p).abs() < 1e-12 && (two.variance - p * (1.0 - p)).abs() < 1e-12, "{two:?}");
        }
    }
}
