//! Hits of a particle's path on receivers.
//!
//! *Diffusion alone.* A path between the distances r₀ = R + `a` and r₁ = R + `b` from the center reached a sphere of
//! radius R with the probability
//!
//! ```text
//! (exp(−ab/DΔt) − exp(−r₀r₁/DΔt)) / (1 − exp(−r₀r₁/DΔt))
//! ```
//!
//! exactly, for any step (Carslaw and Jaeger, *Conduction of Heat in Solids*, section 14.7: r times the density is
//! that of a half line, with an image at −r).
//!
//! *In one dimension* a path that ends on the other side of the segment has hit it; otherwise the probability is
//! exp(−ab/DΔt). *In two* this holds to first order in DΔt/r₀r₁, for steps short compared with the radius.
//!
//! *Drift alone.* The path is a line that walls reflect.
//!
//! *Both.* A long drift may pass the sphere. So near it the path is halved as a Brownian bridge, until a segment's
//! drift is short compared with its diffusion or the sphere. All receivers see the same path.
//!
//! *Moving receivers* are hit in their own frame, in which both diffusions bend the path.
//!
//! *In a vessel* whose side reflects the path, the segments between its corners are halved.
//!
//! *Several receivers.* The earliest hitting time decides (`Hit::time`).

use crate::model::boundary::{Axis, Boundary};
use crate::model::receiver::{ReceiverKind, signed_distance};
use crate::model::vessel::dot;
use crate::motion::receiver_state::ReceiverState;
use crate::random::bridge::NEVER;
use crate::random::gaussian::normals;
use crate::random::philox::{DrawContext, Purpose, open_unit};

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Path {
    /// In µm.
    pub before: [f32; 3],
    /// End before [`Boundary::confine`], in µm, but after reflections that are no mirror images, such as at vessels.
    pub end: [f32; 3],
    /// End within the boundary, in µm.
    pub after: [f32; 3],
    /// End of a path that no wall, receiver or membrane reflected, in µm.
    pub free: [f32; 3],
    /// Displacement without diffusion, in µm.
    pub drift: [f32; 3],
    /// DΔt, in µm².
    pub diffusion: f32,
}

/// A hit on a receiver, within a segment of the path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Beginning of the segment, as a fraction of the step.
    begin: f32,
    /// Fraction of the step; 0 if the hit is at `begin`.
    fraction: f32,
    /// In √(2DΔt) of the segment, negative inside.
    heights: [f32; 2],
}

/// Largest drift of a segment, in radii of the receiver and in the segment's √(2DΔt).
const SEGMENT_DRIFT: [f32; 2] = [1.0 / 16.0, 1.0 / 8.0];
/// Largest distance of a path from its chord, in √(2DΔt), which one path in 10⁸ exceeds.
pub(crate) const BEND: f32 = 3.1;
/// Segments from this number are not halved. The whole path is 1, the halves of segment `k` are 2k and 2k + 1.
const LAST: u32 = 1 << 12;

/// Returns the first hit. `domain` confines the particle's center.
#[inline]
pub fn hits(receiver: &ReceiverState, domain: &Boundary, path: &Path, context: DrawContext) -> Option<Hit> {
    if receiver.receiver.kind == ReceiverKind::Endpoint {
        let b = signed_distance(receiver.receiver.radius, receiver.center_at(1.0), domain, path.after);
        return (b <= 0.0).then_some(Hit::at(1.0));
    }
    let [a, b] = receiver.heights(domain, [path.before, path.after], [0.0, 1.0]);
    let diffusion = path.diffusion + receiver.diffusion;
    let drift: [f32; 3] = std::array::from_fn(|k| path.drift[k] - receiver.drift[k]);
    if diffusion == 0.0 {
        if a < 0.0 {
            return Some(Hit::at(0.0));
        }
        return path_line_hit(receiver, domain, path).or((b <= 0.0).then_some(Hit::at(1.0)));
    }
    if drift == [0.0; 3] {
        return context.hits_sphere([receiver.index, 0], image_radius(receiver), [a, b], diffusion);
    }
    let segment = PathSegment {
        number: 1,
        ends: [path.before, path.end],
        begin: 0.0,
        fraction: 1.0,
        spread: (2.0 * diffusion).sqrt(),
        drift: length(drift),
    };
    let bridge =
        |segment_index: u32| BrownianBridge { receiver, domain, context, first: segment_index * 2 * LAST };
    let mut to = path.free;
    if let Some(along) = domain.along() {
        to[along] = path.end[along];
    }
    let is_long = is_long(segment.drift, segment.spread, receiver.receiver.radius);
    let corners = is_long.then(|| corners(domain, path, to)).flatten();
    let Some(corners) = corners else { return bridge(0).hits(segment) };
    (0..).zip(corners.windows(2)).find_map(|(segment_index, ends)| {
        let &[from, to] = ends else { return None };
        bridge(segment_index).hits(segment.between([from, to]))
    })
}

/// Returns the corners and ends of a path to `to` that only the side of a vessel reflected, else `None`.
fn corners(domain: &Boundary, path: &Path, to: [f32; 3]) -> Option<Vec<(f64, [f64; 3])>> {
    let vessel = domain.vessel?;
    // A path inside has no corner. A collision or a surface reflected a path with another end.
    if vessel.distance(to) <= f64::from(vessel.radius) {
        return None;
    }
    let reflected = vessel.reflect(path.before, to, &mut [0.0; 3]);
    let is_other = |k: usize| Some(k) != vessel.along && reflected[k] != path.end[k];
    (!(0..3).any(is_other)).then(|| vessel.corners(path.before, to))
}

/// The image term of [`hit_probability`] vanishes in fewer than three dimensions.
fn image_radius(receiver: &ReceiverState) -> f32 {
    if receiver.dimensions == 3 { receiver.receiver.radius } else { f32::INFINITY }
}

/// Returns `true` if a drift may carry a segment past a sphere.
pub(crate) fn is_long(drift: f32, spread: f32, radius: f32) -> bool {
    drift > SEGMENT_DRIFT[0] * radius && drift > SEGMENT_DRIFT[1] * spread
}

/// Returns 1 − exp(−x) for x ≥ 0, to a few units in the last place, as `first_passage.wgsl` does.
fn one_minus_exp(x: f32) -> f32 {
    if x < 0.125 {
        return x * (1.0 - x * (0.5 - x * (1.0 / 6.0 - x * (1.0 / 24.0 - x * (1.0 / 120.0)))));
    }
    1.0 - libm::expf(-x)
}

/// Returns the probability of a hit between the heights `a` and `b` > 0; `diffusion` is DΔt.
#[inline]
pub(crate) fn hit_probability(radius: f32, [a, b]: [f32; 2], diffusion: f32) -> f32 {
    let exponent = a * b / diffusion;
    if exponent.is_nan() || exponent >= NEVER {
        // 0/0: a particle at rest on the surface, which it hit earlier.
        return 0.0;
    }
    let image = radius * (a + b + radius) / diffusion;
    libm::expf(-exponent) * one_minus_exp(image) / one_minus_exp(exponent + image)
}

impl DrawContext {
    #[inline]
    fn hits_sphere(
        self,
        [receiver, part]: [u32; 2],
        radius: f32,
        heights: [f32; 2],
        diffusion: f32,
    ) -> Option<Hit> {
        let [a, b] = heights;
        let word = || self.draw_part(receiver, part, Purpose::Receiver)[0];
        let probability = if b <= 0.0 || a < 0.0 { 1.0 } else { hit_probability(radius, heights, diffusion) };
        let hit = probability >= 1.0 || probability > 0.0 && open_unit(word()) < probability;
        hit.then(|| Hit::between(heights, diffusion))
    }
}

impl Hit {
    pub(crate) fn at(time: f32) -> Self {
        Self { begin: time, fraction: 0.0, heights: [0.0; 2] }
    }

    pub(crate) fn between([a, b]: [f32; 2], diffusion: f32) -> Self {
        if diffusion == 0.0 {
            return Self::at((a / (a - b)).min(1.0));
        }
        let spread = (2.0 * diffusion).sqrt();
        Self { begin: 0.0, fraction: 1.0, heights: [a, b].map(|height| height / spread) }
    }

    /// Draws the time, as a fraction of the step.
    ///
    /// A Brownian path from height α to ±β first reaches a plane at s, where u = s/(1 − s) has the inverse Gaussian
    /// density ∝ u^(−3/2)·exp(−(α²/u + β²u)/2), drawn by a quadratic equation (Michael, Schucany and Haas, *Generating
    /// random variates using transformations with multiple roots*, The American Statistician 30 (1976) 88).
    pub(crate) fn time(&self, context: DrawContext, receiver: u32) -> f32 {
        let Self { begin, fraction, heights: [a, b] } = *self;
        if fraction == 0.0 {
            return begin;
        }
        let words = context.draw(receiver, Purpose::HitTime);
        begin + fraction * first_passage([a, b], normals(words)[0], open_unit(words[2]))
    }
}

/// Returns a fraction of the segment, for heights in √(2DΔt).
pub(crate) fn first_passage([a, b]: [f32; 2], normal: f32, uniform: f32) -> f32 {
    let b = b.abs();
    if a <= 0.0 {
        return 0.0;
    }
    let square = normal * normal;
    let sum = 2.0 * a * b + square + (square * (square + 4.0 * a * b)).sqrt();
    // Roots: 2a²/sum, and the larger sum/2b².
    if uniform * (a * sum + 2.0 * b * a * a) <= a * sum {
        return 2.0 * a * a / (sum + 2.0 * a * a);
    }
    sum / (sum + 2.0 * b * b)
}

struct BrownianBridge<'a> {
    receiver: &'a ReceiverState,
    domain: &'a Boundary,
    context: DrawContext,
    /// Added to numbers of segments in draws.
    first: u32,
}

struct PathSegment {
    number: u32,
    ends: [[f32; 3]; 2],
    begin: f32,
    fraction: f32,
    spread: f32,
    drift: f32,
}

impl PathSegment {
    /// Returns the segment between two corners.
    fn between(&self, [(begin, from), (end, to)]: [(f64, [f64; 3]); 2]) -> Self {
        let fraction = (end - begin) as f32;
        Self {
            number: 1,
            ends: [from, to].map(|end| end.map(|c| c as f32)),
            begin: begin as f32,
            fraction,
            spread: self.spread * fraction.sqrt(),
            drift: self.drift * fraction,
        }
    }
}

impl BrownianBridge<'_> {
    fn height(&self, point: [f32; 3], time: f32) -> f32 {
        let center = self.receiver.center_at(time);
        signed_distance(self.receiver.receiver.radius, center, self.domain, self.domain.confine(point))
    }

    fn hits(&self, segment: PathSegment) -> Option<Hit> {
        let PathSegment { number, ends: [p, q], begin, fraction, spread, drift } = segment;
        let middle: [f32; 3] = std::array::from_fn(|k| p[k] + 0.5 * (q[k] - p[k]));
        let half =
            0.5 * length(std::array::from_fn(|k| q[k] - p[k] - fraction * self.receiver.displacement[k]));
        let half_time = begin + 0.5 * fraction;
        if self.height(middle, half_time) > half + BEND * spread {
            return None;
        }
        let radius = self.receiver.receiver.radius;
        if number >= LAST || !is_long(drift, spread, radius) {
            let ends = [p, q].map(|end| self.domain.confine(end));
            let heights = self.receiver.heights(self.domain, ends, [begin, begin + fraction]);
            let hit = self.context.hits_sphere(
                [self.receiver.index, self.first + number - 1],
                image_radius(self.receiver),
                heights,
                0.5 * spread * spread,
            );
            return hit.map(|hit| Hit { begin, fraction, ..hit });
        }
        let z = normals(self.context.draw(self.first + number, Purpose::Path));
        let middle = std::array::from_fn(|k| middle[k] + 0.5 * spread * z[k]);
        let half_of = |number, begin, ends| PathSegment {
            number,
            ends,
            begin,
            fraction: 0.5 * fraction,
            spread: spread * std::f32::consts::FRAC_1_SQRT_2,
            drift: 0.5 * drift,
        };
        self.hits(half_of(2 * number, begin, [p, middle]))
            .or_else(|| self.hits(half_of(2 * number + 1, half_time, [middle, q])))
    }
}

#[inline(always)]
pub(crate) fn length(v: [f32; 3]) -> f32 {
    (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt()
}

/// Cuts per axis. Steps that need more are far too long.
const CUTS: usize = 1000;

fn path_line_hit(state: &ReceiverState, domain: &Boundary, path: &Path) -> Option<Hit> {
    let line =
        PathLine { ends: [path.before, path.end].map(|end| end.map(f64::from)), begin: 0.0, fraction: 1.0 };
    let Some(corners) = corners(domain, path, path.free) else { return line_hit(state, domain, line) };
    corners.windows(2).find_map(|ends| {
        let &[(begin, from), (end, to)] = ends else { return None };
        line_hit(state, domain, PathLine { ends: [from, to], begin, fraction: end - begin })
    })
}

#[derive(Clone, Copy)]
struct PathLine {
    ends: [[f64; 3]; 2],
    begin: f64,
    fraction: f64,
}

/// Cuts the line at plane walls and at changes of the receiver's nearest image.
fn line_hit(state: &ReceiverState, domain: &Boundary, line: PathLine) -> Option<Hit> {
    let PathLine { ends: [from, to], begin, fraction: line_fraction } = line;
    let line_displacement: [f64; 3] = std::array::from_fn(|k| to[k] - from[k]);
    let radius = f64::from(state.receiver.radius);
    let center = state.center_at(begin as f32);
    let displacement = state.displacement.map(|c| line_fraction * f64::from(c));
    let hit_at = |time: f64| Hit::at((begin + line_fraction * time) as f32);
    let mut cuts = Vec::new();
    for (k, axis) in domain.axes.into_iter().enumerate() {
        let (first, period, relative) = match axis {
            Axis::Open | Axis::Frozen => continue,
            Axis::Reflecting { low, high } => (f64::from(low), f64::from(high - low), line_displacement[k]),
            Axis::Periodic { low, high } => {
                let half = 0.5 * f64::from(high - low);
                (f64::from(center[k]) + half, f64::from(high - low), line_displacement[k] - displacement[k])
            }
        };
        let to = from[k] + relative;
        let [low, high] = [from[k].min(to), from[k].max(to)].map(|x| (x - first) / period);
        let planes = (low.ceil() as i64..=high.floor() as i64).take(CUTS);
        cuts.extend(planes.map(|plane| (first + plane as f64 * period - from[k]) / relative));
    }
    let begins_inside = |k: usize| match domain.axes[k] {
        Axis::Reflecting { low, high } => (f64::from(low)..=f64::from(high)).contains(&from[k]),
        _ => true,
    };
    // A line after a reflection in a vessel may begin beyond a wall.
    if cuts.is_empty() && (0..3).all(begins_inside) {
        let from = domain.displacement(center, from.map(|x| x as f32)).map(f64::from);
        let relative = std::array::from_fn(|k| line_displacement[k] - displacement[k]);
        return entry_time(from, relative, radius).map(hit_at);
    }
    cuts.extend([0.0, 1.0]);
    cuts.retain(|t| (0.0..=1.0).contains(t));
    cuts.sort_unstable_by(f64::total_cmp);
    cuts.windows(2).find_map(|cut| {
        let (middle, cut_fraction) = (0.5 * (cut[0] + cut[1]), cut[1] - cut[0]);
        let point: [f32; 3] = std::array::from_fn(|k| (from[k] + middle * line_displacement[k]) as f32);
        let relative: [f64; 3] = std::array::from_fn(|k| {
            let signed_fraction =
                if domain.axes[k].reverses(point[k]) { -cut_fraction } else { cut_fraction };
            signed_fraction * line_displacement[k] - cut_fraction * displacement[k]
        });
        let center = state.center_at((begin + line_fraction * middle) as f32);
        let middle = domain.displacement(center, domain.confine(point)).map(f64::from);
        let time = entry_time(std::array::from_fn(|k| middle[k] - 0.5 * relative[k]), relative, radius)?;
        Some(hit_at(cut[0] + cut_fraction * time))
    })
}

fn entry_time(from: [f64; 3], displacement: [f64; 3], radius: f64) -> Option<f64> {
    let outside = dot(from, from) - radius * radius;
    if outside <= 0.0 {
        return Some(0.0);
    }
    let (square, approach) = (dot(displacement, displacement), -dot(from, displacement));
    let root = approach * approach - square * outside;
    let time = outside / (approach + root.max(0.0).sqrt());
    (approach > 0.0 && root >= 0.0 && time <= 1.0).then_some(time)
}

#[cfg(test)]
mod tests;
