//! Reflection of paths at walls, and absorption.
//!
//! Mirroring the end of a step is exact for diffusion alone. With drift, the reflected motion is the free path X plus
//! the least displacement that keeps it inside (Skorokhod), with the wall at 0:
//!
//! ```text
//! Y(t) = X(t) + max(0, −min over s ≤ t of X(s))
//! ```
//!
//! Between ends `a` and `b` the path is a Brownian bridge for any drift. Its minimum m is drawn by inversion of
//! P(m ≤ y) = exp(−2(a − y)(b − y)/s²), s² = 2DΔt. The end is exact unless the path also reaches the opposite wall.
//!
//! *Absorbing walls.* A path between heights `a` and `b` above a plane touched it with the probability exp(−ab/DΔt),
//! for any step and drift. A cylinder is taken as its tangent plane, which is right for steps short compared with the
//! radius. In a sphere r times the density is that of a slit from 0 to R with absorbing ends: a sum over images.
//!
//! *Surfaces in front of absorbing walls.* A reflecting plane unfolds the path into a free one, between the wall and
//! its mirror image. The image is the wall as seen from the last segment, extended backwards to the length of the step.
//! Both probabilities add up, unless a step reaches both. Spheres are taken as their tangent planes.
//!
//! *The time of absorption* follows from the heights of both ends as at a receiver (`Hit::time`), with the wall as a
//! plane.

use crate::model::Model;
use crate::model::boundary::{Axis, Boundary};
use crate::model::receiver::{ReceiverKind, WallFace};
use crate::model::vessel::Vessel;
use crate::motion::path_hit::{Hit, Path};
use crate::motion::reflection::PathReflection;
use crate::motion::surface_events::ParticleMove;
use crate::random::bridge::{NEVER, lowest};
use crate::random::philox::{Purpose, open_unit};

/// Returns the reflected coordinate; `None` if the path touches no wall. `spread` is √(2DΔt).
#[inline]
pub(crate) fn reflected(axis: Axis, [before, end]: [f32; 2], spread: f32, word: u32) -> Option<f32> {
    let Axis::Reflecting { low, high } = axis else { return None };
    let is_low = (before - low) + (end - low) < (high - before) + (high - end);
    let [a, b] = if is_low { [before - low, end - low] } else { [high - before, high - end] };
    let inside = b - lowest([a, b], spread, || word)?;
    Some(if is_low { low + inside } else { high - inside })
}

#[derive(Clone, Debug)]
pub(crate) struct AbsorbingWall {
    pub(crate) receiver: u32,
    pub(crate) sees: Vec<bool>,
    face: WallFace,
}

impl AbsorbingWall {
    pub(crate) fn all(model: &Model) -> Vec<Self> {
        let wall = |(receiver, wall_receiver): (usize, &crate::Receiver)| match wall_receiver.kind {
            ReceiverKind::Wall(face) => {
                Some(Self { receiver: receiver as u32, sees: wall_receiver.sees.clone(), face })
            }
            _ => None,
        };
        model.receivers.iter().enumerate().filter_map(wall).collect()
    }

    /// Returns `point` itself for a curved wall.
    pub(crate) fn foot_point(&self, domain: &Boundary, mut point: [f32; 3]) -> [f32; 3] {
        match self.face {
            WallFace::Low(axis) => point[axis] -= height(self.face, domain, point),
            WallFace::High(axis) => point[axis] += height(self.face, domain, point),
            WallFace::Side => {}
        }
        point
    }

    /// Ends a path beyond the wall if the step does, for surfaces in front of it.
    pub(crate) fn extend_to_wall(&self, domain: &Boundary, path: Path, free_end: [f32; 3]) -> Path {
        let Path { mut end, mut after, .. } = path;
        if let WallFace::Low(axis) | WallFace::High(axis) = self.face
            && height(self.face, domain, free_end) <= 0.0
        {
            (end[axis], after[axis]) = (free_end[axis], free_end[axis]);
        }
        Path { end, after, ..path }
    }

    pub(crate) fn hit(&self, domain: &Boundary, moved: &ParticleMove) -> Option<Hit> {
        let ParticleMove { context, path, free_end, reflection, .. } = moved;
        let height = |point: [f32; 3]| height(self.face, domain, point);
        let [a, b] = [path.before, *free_end].map(height);
        if a <= 0.0 {
            return Some(Hit::at(0.0));
        }
        let touches = |heights: [f32; 2]| touch_probability(domain, heights, path.diffusion);
        let (mut direct, mut reflected, mut ends) = (touches([a, b]), 0.0, [a, b]);
        if let Some(PathReflection { contact, last }) = reflection {
            if b <= 0.0 && self.face != WallFace::Side && height(*contact) > 0.0 {
                direct = 0.0;
            }
            let [before, end] = last.map(height);
            if before > 0.0 || end <= 0.0 {
                (reflected, ends) = (touches([before, end]), [before, end]);
            }
        }
        let probability = direct + reflected;
        let draw = || open_unit(context.draw(self.receiver, Purpose::Receiver)[0]);
        let is_hit = probability >= 1.0 || probability > 0.0 && draw() < probability;
        if !is_hit {
            return None;
        }
        let is_direct = reflected == 0.0 || draw() < direct;
        Some(Hit::between(if is_direct { [a, b] } else { ends }, path.diffusion))
    }
}

/// The second height may be beyond the wall.
fn touch_probability(domain: &Boundary, heights: [f32; 2], diffusion: f32) -> f32 {
    let exponent = heights[0] * heights[1] / diffusion;
    if heights[1] <= 0.0 {
        1.0
    } else if exponent >= NEVER {
        0.0
    } else if let Some(Vessel { along: None, radius, .. }) = domain.vessel {
        hit_from_inside(radius, heights, diffusion)
    } else {
        (-exponent).exp()
    }
}

/// Images on each side, enough up to DΔt = R².
const IMAGES: i32 = 6;

/// Probability that a path between positive heights touches a sphere from inside.
pub(crate) fn hit_from_inside(radius: f32, heights: [f32; 2], diffusion: f32) -> f32 {
    let [radius, diffusion] = [radius, diffusion].map(f64::from);
    if diffusion >= radius * radius {
        // The survival is below 0.4 %.
        return 1.0;
    }
    // All terms vanish at the center; a small distance gives the limit.
    let [from, to] = heights.map(|height| (radius - f64::from(height)).max(1e-4 * radius));
    let term = |distance: f64| libm::exp(((from - to).powi(2) - distance * distance) / (4.0 * diffusion));
    let pair = |image: i32| {
        let shift = 2.0 * f64::from(image) * radius;
        term(from - to + shift) - term(from + to + shift)
    };
    let others: f64 = (1..=IMAGES).map(|image| pair(image) + pair(-image)).sum();
    (-others / pair(0)) as f32
}

/// Returns the height above a wall, negative beyond it.
fn height(face: WallFace, domain: &Boundary, point: [f32; 3]) -> f32 {
    let wall = |axis: usize, height: fn(f32, f32, f32) -> f32| match domain.axes[axis] {
        Axis::Reflecting { low, high } => height(low, high, point[axis]),
        _ => f32::INFINITY,
    };
    match face {
        WallFace::Low(axis) => wall(axis, |low, _, x| x - low),
        WallFace::High(axis) => wall(axis, |_, high, x| high - x),
        WallFace::Side => domain
            .vessel
            .map_or(f32::INFINITY, |vessel| (f64::from(vessel.radius) - vessel.distance(point)) as f32),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::gaussian::normals;
    use crate::random::philox::{DrawContext, Key};

    fn free(path: Path, context: DrawContext) -> ParticleMove {
        let free_end = path.end;
        ParticleMove {
            at: 0,
            species: 0,
            context,
            path,
            free_end,
            path_length: 0.0,
            reflection: None,
            velocity: None,
        }
    }

    #[track_caller]
    fn assert_fraction(count: f64, n: u32, expected: f64) {
        let error = (expected * (1.0 - expected) / f64::from(n)).sqrt();
        let found = count / f64::from(n);
        assert!((found - expected).abs() < 4.0 * error, "{found} and {expected}");
    }

    #[test]
    fn absorbed_fraction_at_plane_matches_closed_form() {
        // From height a within one step: erfc(a/√(4DΔt)).
        let domain = Boundary::reflecting([-1.0; 3], [50.0; 3]);
        let wall = AbsorbingWall { receiver: 0, sees: vec![true], face: WallFace::Low(1) };
        let n = 40_000_u32;
        for height in [0.3_f32, 1.0, 2.5] {
            let context = |id| DrawContext { key: Key::new(7), id, step: 0 };
            let hit_ids = (0..n).filter(|&id| {
                let z = normals(Key::new(7).draw(id, 0, 0, Purpose::Move));
                let before = [20.0, height - 1.0, 20.0];
                let end: [f32; 3] = std::array::from_fn(|k| before[k] + z[k]);
                let path = Path {
                    before,
                    end,
                    after: domain.confine(end),
                    free: end,
                    drift: [0.0; 3],
                    diffusion: 0.5,
                };
                wall.hit(&domain, &free(path, context(id))).is_some()
            });
            assert_fraction(hit_ids.count() as f64, n, libm::erfc(f64::from(height) / 2.0_f64.sqrt()));
        }
    }

    /// The survival from the center is 2·Σ (−1)^(n+1)·exp(−n²π²DΔt/R²).
    #[test]
    fn absorbed_fraction_inside_sphere_matches_closed_form() {
        let vessel = Some(Vessel { along: None, center: [1.0, 2.0, 3.0], radius: 1.0 });
        let domain = Boundary { vessel, ..Boundary::default() };
        let wall = AbsorbingWall { receiver: 0, sees: vec![true], face: WallFace::Side };
        let n = 40_000_u32;
        for diffusion in [0.02_f32, 0.1, 0.3] {
            let context = |id| DrawContext { key: Key::new(8), id, step: 0 };
            let hit_ids = (0..n).filter(|&id| {
                let z = normals(Key::new(8).draw(id, 0, 0, Purpose::Move));
                let before = [1.0, 2.0, 3.0];
                let end: [f32; 3] = std::array::from_fn(|k| before[k] + (2.0 * diffusion).sqrt() * z[k]);
                let path = Path { before, end, after: end, free: end, drift: [0.0; 3], diffusion };
                wall.hit(&domain, &free(path, context(id))).is_some()
            });
            let mode = |n: i32| {
                let rate = (f64::from(n) * std::f64::consts::PI).powi(2) * f64::from(diffusion);
                2.0 * (-rate).exp() * f64::from(1 - 2 * (n % 2))
            };
            assert_fraction(hit_ids.count() as f64, n, 1.0 + (1..30).map(mode).sum::<f64>());
        }
    }

    /// Reflected Brownian motion with drift μ (Harrison, *Brownian Motion and Stochastic Flow Systems*, section 3.6):
    /// P(Y ≤ y) = Φ((y − a − μ)/s) − exp(2μy/s²)·Φ((−y − a − μ)/s).
    #[test]
    fn step_with_drift_has_the_closed_distribution() {
        let normal = |x: f64| 0.5 * libm::erfc(-x * std::f64::consts::FRAC_1_SQRT_2);
        let n = 40_000_u32;
        for (case, (start, drift, spread)) in
            [(0.0_f32, -0.2_f32, 1.0_f32), (0.3, -1.0, 1.0), (0.5, 0.4, 0.7), (1.0, -2.5, 1.0)]
                .into_iter()
                .enumerate()
        {
            for is_low in [true, false] {
                let axis = Axis::Reflecting { low: -1.0, high: 99.0 };
                let mut below = [0_u32; 3];
                let levels = [0.1, 0.5, 1.5].map(|y| y * spread);
                for id in 0..n {
                    let key = Key::new(case as u64);
                    let z = normals(key.draw(id, 0, 0, Purpose::Move))[0];
                    let moved = spread * z + drift;
                    let [before, end] = if is_low {
                        [start - 1.0, start - 1.0 + moved]
                    } else {
                        [99.0 - start, 99.0 - start - moved]
                    };
                    let word = key.draw(id, 0, 0, Purpose::Wall)[0];
                    let after = reflected(axis, [before, end], spread, word).unwrap_or(end);
                    let y = if is_low { after + 1.0 } else { 99.0 - after };
                    assert!(y >= -1e-4, "{y}");
                    levels.iter().zip(&mut below).for_each(|(level, count)| *count += u32::from(y <= *level));
                }
                for (level, count) in levels.into_iter().zip(below) {
                    let [a, mu, s, y] = [start, drift, spread, level].map(f64::from);
                    let expected =
                        normal((y - a - mu) / s) - (2.0 * mu * y / (s * s)).exp() * normal((-y - a - mu) / s);
                    assert_fraction(count.into(), n, expected);
                }
            }
        }
    }
}
