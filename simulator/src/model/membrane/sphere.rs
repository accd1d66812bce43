//! Spherical membranes.
//!
//! A path from the distance a of a plane to the distance b on its other side has the Gaussian density of the free end,
//! times
//!
//! ```text
//! √π·X·erfcx(X + z/√(4DΔt)),   X = 2κ√(Δt/D),   z = a + b
//! ```
//!
//! It follows from averaging ½(1 − exp(−2κL/D)) (`membrane.rs`) over the paths that touch the plane and end at b on
//! either side. A segment to the free end that crosses the plane passes with this probability, and is reflected
//! otherwise. That is exact for a plane and steps of any length.
//!
//! # Correctness
//!
//! At a sphere the segment continues or is reflected as in a billiard, with z = ℓ·cos θ for the length ℓ of the whole
//! segment and its angle θ to the normal. A uniform density stays uniform at any step length:
//!
//! 1. Reflections and passages conserve volumes of positions and directions.
//! 2. The reverse of a segment has the same crossings, ℓ and angles, hence the same probability.
//! 3. Gaussian segments have the same density in each direction.
//!
//! The flux between different concentrations has an error that vanishes with √(2DΔt)/R.

use crate::model::boundary::{Axis, Boundary};
use crate::model::membrane::{Membrane, MembraneStep, MembraneSurface};
use crate::model::vessel::dot;
use crate::random::philox::fine_unit;
use crate::special::{ROOT_PI, erfcx};

/// Largest number of crossings and reflections; a particle with more stays where it was.
const MAX_EVENTS: u32 = 64;
/// Largest number of tried corrections of a rounded position; the k-th is 2^(k − 23) of the radius.
const NUDGES: u32 = 8;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SphereEnd {
    /// Without periodic images and walls, in µm.
    pub(super) free: [f32; 3],
    /// Within the boundary, in µm.
    pub(super) confined: [f32; 3],
}

#[derive(Clone, Copy, Debug)]
struct Sphere {
    membrane: usize,
    center: [f32; 3],
    radius: f32,
    permeability: f64,
}

struct Ray<'a> {
    domain: &'a Boundary,
    at: [f64; 3],
    displacement: [f64; 3],
    spheres: Vec<(Sphere, bool)>,
    walls: [Option<f64>; 3],
}

#[derive(Clone, Copy)]
enum Obstacle {
    Sphere(usize, [f64; 3]),
    Wall(usize, f64),
}

impl MembraneStep<'_> {
    fn spheres(&self) -> impl Iterator<Item = Sphere> {
        let sphere = |(membrane, one): (usize, &Membrane)| match one.surface {
            MembraneSurface::Sphere { center, radius } if one.sees[self.species] => {
                Some(Sphere { membrane, center, radius, permeability: one.permeability })
            }
            _ => None,
        };
        self.membranes.iter().enumerate().filter_map(sphere)
    }

    pub(super) fn is_across_sphere(&self, [a, b]: [[f32; 3]; 2]) -> bool {
        self.spheres().any(|sphere| sphere.contains(self.domain, a) != sphere.contains(self.domain, b))
    }

    /// Returns `None` if the step cannot reach a sphere. `word` returns random bits by membrane and event.
    pub(super) fn sphere_end(
        &self,
        [before, end]: [[f32; 3]; 2],
        word: impl Fn(usize, u32) -> u32,
    ) -> Option<SphereEnd> {
        let displacement: [f64; 3] = std::array::from_fn(|k| f64::from(end[k]) - f64::from(before[k]));
        let length = dot(displacement, displacement).sqrt();
        let is_near = |sphere: Sphere| sphere.height(self.domain, before).abs() <= length * (1.0 + 1e-6);
        if length == 0.0 || !self.spheres().any(is_near) {
            return None;
        }
        let spheres = self.spheres().map(|sphere| (sphere, sphere.contains(self.domain, before)));
        let mut ray = Ray {
            domain: self.domain,
            at: before.map(f64::from),
            displacement,
            spheres: spheres.collect(),
            walls: [None; 3],
        };
        let stays = SphereEnd { free: before, confined: before };
        for event in 0..MAX_EVENTS {
            let Some(obstacle) = ray.advance() else { return Some(ray.end().unwrap_or(stays)) };
            match obstacle {
                Obstacle::Wall(axis, wall) => {
                    ray.walls[axis] = Some(wall);
                    ray.displacement[axis] = -ray.displacement[axis];
                }
                Obstacle::Sphere(k, normal) => {
                    let out = dot(ray.displacement, normal);
                    let cosine = (out * out / dot(ray.displacement, ray.displacement)).sqrt();
                    let (sphere, is_inside) = &mut ray.spheres[k];
                    let passes = self.passing(sphere.permeability, length * cosine);
                    if fine_unit(word(sphere.membrane, event)) < passes {
                        *is_inside = !*is_inside;
                    } else {
                        ray.displacement =
                            std::array::from_fn(|axis| ray.displacement[axis] - 2.0 * out * normal[axis]);
                    }
                }
            }
        }
        Some(stays)
    }

    /// Returns the probability that a segment passes, by its length along the normal, in µm.
    fn passing(&self, permeability: f64, across: f64) -> f64 {
        let diffusion = 0.5 * f64::from(self.spread).powi(2);
        let time_step = diffusion / self.diffusion;
        let x = 2.0 * permeability * (time_step / self.diffusion).sqrt();
        ROOT_PI * x * erfcx(x + across / (2.0 * diffusion.sqrt()))
    }
}

impl Sphere {
    /// Negative inside.
    fn height(&self, domain: &Boundary, point: [f32; 3]) -> f64 {
        let away = self.vector_to(domain, point.map(f64::from));
        dot(away, away).sqrt() - f64::from(self.radius)
    }

    fn vector_to(&self, domain: &Boundary, point: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|k| domain.axes[k].displacement_exact(point[k] - f64::from(self.center[k])))
    }

    fn contains(&self, domain: &Boundary, point: [f32; 3]) -> bool {
        self.height(domain, point) < 0.0
    }

    /// Returns the fraction of `displacement` after which a ray from `from`, relative to the center, reaches the
    /// surface.
    fn entry_fraction(&self, is_inside: bool, from: [f64; 3], displacement: [f64; 3]) -> Option<f64> {
        let [a, b] = [dot(displacement, displacement), dot(from, displacement)];
        let c = dot(from, from) - f64::from(self.radius).powi(2);
        if is_inside {
            return Some((-b + (b * b - a * c.min(0.0)).sqrt()) / a);
        }
        let root = b * b - a * c.max(0.0);
        (b < 0.0 && root >= 0.0).then(|| c.max(0.0) / (-b + root.sqrt()))
    }
}

impl Ray<'_> {
    fn advance(&mut self) -> Option<Obstacle> {
        let (fraction, obstacle) =
            self.next().map_or((1.0, None), |(fraction, obstacle)| (fraction, Some(obstacle)));
        for axis in 0..3 {
            self.at[axis] += fraction * self.displacement[axis];
            self.displacement[axis] *= 1.0 - fraction;
        }
        Some(match obstacle? {
            Obstacle::Sphere(k, from) => {
                let point: [f64; 3] = std::array::from_fn(|axis| {
                    from[axis] + fraction / (1.0 - fraction) * self.displacement[axis]
                });
                let distance = dot(point, point).sqrt();
                Obstacle::Sphere(k, point.map(|x| x / distance))
            }
            wall => wall,
        })
    }

    /// Returns the nearest obstacle, and the fraction of `displacement` to it.
    fn next(&self) -> Option<(f64, Obstacle)> {
        let walls = (0..3).filter_map(|axis| {
            let Axis::Reflecting { low, high } = self.domain.axes[axis] else { return None };
            let wall = f64::from(if self.displacement[axis] < 0.0 { low } else { high });
            let fraction = ((wall - self.at[axis]) / self.displacement[axis]).max(0.0);
            Some((fraction, Obstacle::Wall(axis, wall)))
        });
        let spheres = self.spheres.iter().enumerate().flat_map(|(k, &(sphere, is_inside))| {
            let from = sphere.vector_to(self.domain, self.at);
            self.images(is_inside).filter_map(move |image| {
                let from = std::array::from_fn(|axis| from[axis] + image[axis]);
                Some((sphere.entry_fraction(is_inside, from, self.displacement)?, Obstacle::Sphere(k, from)))
            })
        });
        let within = walls.chain(spheres).filter(|(fraction, _)| *fraction < 1.0);
        within.min_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// Returns the shifts of a sphere's images: only the nearest if it contains the ray.
    fn images(&self, is_inside: bool) -> impl Iterator<Item = [f64; 3]> {
        let period = |axis: usize| match self.domain.axes[axis] {
            Axis::Periodic { low, high } if !is_inside => f64::from(high) - f64::from(low),
            _ => 0.0,
        };
        let periods: [f64; 3] = std::array::from_fn(period);
        (0..27).filter_map(move |k: i32| {
            let shift = [k / 9 - 1, k / 3 % 3 - 1, k % 3 - 1];
            let is_used = (0..3).all(|axis| shift[axis] == 0 || periods[axis] > 0.0);
            is_used.then(|| std::array::from_fn(|axis| f64::from(shift[axis]) * periods[axis]))
        })
    }

    /// Returns `None` if no correction puts the end on the right side of each sphere.
    fn end(&self) -> Option<SphereEnd> {
        let is_right = |point: [f32; 3]| {
            let is_on_side =
                |(sphere, is_inside): &(Sphere, bool)| sphere.contains(self.domain, point) == *is_inside;
            self.spheres.iter().all(is_on_side)
        };
        let free = self.at.map(|x| x as f32);
        let confined = self.domain.confine(free);
        if is_right(confined) {
            return Some(self.beyond_walls(free, confined));
        }
        (1..=NUDGES).find_map(|k| {
            let free = self.nudged(2_f64.powi(k as i32 - 23));
            let confined = self.domain.confine(free);
            is_right(confined).then(|| self.beyond_walls(free, confined))
        })
    }

    /// Moves the end by a fraction of the radius to its side of the nearest surface.
    fn nudged(&self, fraction: f64) -> [f32; 3] {
        let gap = |sphere: &Sphere| {
            let from = sphere.vector_to(self.domain, self.at);
            (dot(from, from).sqrt() - f64::from(sphere.radius)).abs()
        };
        let nearest = self.spheres.iter().min_by(|a, b| gap(&a.0).total_cmp(&gap(&b.0)));
        let Some((sphere, is_inside)) = nearest else { return self.at.map(|x| x as f32) };
        let from = sphere.vector_to(self.domain, self.at);
        let by = if *is_inside { -fraction } else { fraction };
        std::array::from_fn(|axis| (self.at[axis] + by * from[axis]) as f32)
    }

    fn beyond_walls(&self, mut free: [f32; 3], confined: [f32; 3]) -> SphereEnd {
        for (x, wall) in free.iter_mut().zip(self.walls) {
            *x = wall.map_or(*x, |wall| (2.0 * wall) as f32 - *x);
        }
        SphereEnd { free, confined }
    }
}
