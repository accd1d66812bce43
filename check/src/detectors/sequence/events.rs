use glam::Vec3;
use lazygrid::{Sphere, Spheres};

use super::draw::{at_new_positions, number, radius, random_position};
use crate::scenes::motion::walk;
use crate::{DetectorVariant, ExclusionCase, Random, TestInput};

/// Earlier scenes to which a sequence may return.
const MAX_HISTORY: usize = 4;
/// Maximum number of spheres at one point, because all of them pair.
const MAX_CROWD: usize = 400;
/// Largest scene whose exclusions are drawn from its pairs.
const MAX_LISTED: usize = 600;

pub(super) struct World {
    pub(super) scenario: TestInput,
    pub(super) history: Vec<TestInput>,
    pub(super) radius: f32,
    pub(super) extent: [f32; 3],
    pub(super) motion: f32,
    /// Number of calls in ten that only move the spheres a little.
    pub(super) calm: u32,
    pub(super) variant: DetectorVariant,
    pub(super) most: usize,
    /// Further calls without changes, which reveal stale state.
    pub(super) held: u32,
}

impl World {
    pub(super) fn new_spheres(&self, random: &mut Random, n: usize) -> Vec<Sphere> {
        let kind = if random.below(2) == 0 { 0 } else { random.below(10) };
        let unit = if random.below(3) == 0 { 0.2 * self.radius } else { self.radius };
        let sphere = |k| {
            let center = random_position(random, self.extent);
            Sphere::new(center, radius(random, kind, k, unit))
        };
        (0..n).map(sphere).collect()
    }

    pub(super) fn walk(&mut self, random: &mut Random) {
        let times = [0.25, 1.0, 1.0, 4.0][random.below(4) as usize];
        let stride = crate::scenes::motion::stride(&self.scenario.spheres);
        let strides = self.motion * times * (self.radius / stride).min(1e6);
        walk(&mut self.scenario.spheres, strides, random.word());
    }

    pub(super) fn remember(&mut self, scenario: TestInput) {
        self.history.push(scenario);
        if self.history.len() > MAX_HISTORY {
            self.history.remove(0);
        }
    }

    pub(super) fn back(&mut self, random: &mut Random) -> &'static str {
        if self.history.is_empty() {
            return "still";
        }
        self.scenario = self.history[random.below(self.history.len() as u32) as usize].clone();
        "an earlier scene"
    }

    pub(super) fn event(&mut self, random: &mut Random) -> &'static str {
        match random.below(10) {
            0..=3 => self.radii(random),
            4 | 5 => self.numbers(random),
            6 | 7 => self.change_positions(random),
            8 => self.species(random),
            _ => self.change_exclusions(random),
        }
    }

    fn one(&self, random: &mut Random) -> usize {
        random.below(self.scenario.spheres.len().max(1) as u32) as usize
    }

    fn radii(&mut self, random: &mut Random) -> &'static str {
        // A list that misses growing radii loses pairs.
        let grown = [0.5, 1.0, 2.0, 3.0][random.below(4) as usize];
        let (one, unit) = (self.one(random), self.radius * grown);
        let classes = 1 + random.below(9) as i32;
        let factor = [0.5, 2.0, 2.0, 0.9, 1.1, 0.01, 1.0 + f32::EPSILON, 4.0][random.below(8) as usize];
        let kind = random.below(10);
        let spheres = &mut self.scenario.spheres;
        let of_one = |spheres: &mut Vec<Sphere>, change: &dyn Fn(f32) -> f32| {
            spheres[one..].iter_mut().take(1).for_each(|s| s.radius = change(s.radius).min(f32::MAX));
        };
        match random.below(10) {
            0 | 1 => {
                spheres.iter_mut().for_each(|s| s.radius = (s.radius * factor).min(f32::MAX));
                "all radii scaled"
            }
            2 => {
                of_one(spheres, &|radius| radius * factor);
                "one radius scaled"
            }
            3 => {
                of_one(spheres, &|_| 8.0 * unit);
                "one giant"
            }
            4 => {
                of_one(spheres, &|_| 0.0);
                "one radius 0"
            }
            5 | 6 => {
                let classes =
                    |(k, s): (usize, &mut Sphere)| s.radius = unit * 0.5_f32.powi(k as i32 % classes);
                spheres.iter_mut().enumerate().for_each(classes);
                "new size classes"
            }
            7 => {
                let resize_some =
                    |s: &mut Sphere| s.radius = if random.below(4) == 0 { unit } else { s.radius };
                spheres.iter_mut().for_each(resize_some);
                "some radii new"
            }
            8 => {
                let (radii, n) = (spheres.iter().map(|s| s.radius).collect::<Vec<_>>(), spheres.len());
                spheres.iter_mut().enumerate().for_each(|(k, s)| s.radius = radii[(k + 1) % n]);
                "radii of others"
            }
            _ => {
                let new = |(k, s): (usize, &mut Sphere)| s.radius = radius(random, kind, k, unit);
                spheres.iter_mut().enumerate().for_each(new);
                "all radii new"
            }
        }
    }

    fn numbers(&mut self, random: &mut Random) -> &'static str {
        let n = self.scenario.spheres.len();
        let few = 1 + random.below(3) as usize;
        match random.below(8) {
            0 | 1 => self.resize(random, n + few),
            2 => self.resize(random, n.saturating_sub(few)),
            3 => self.remove_one(random),
            4 => self.resize(random, [0, 1, 2, n / 2][few]),
            _ => {
                let to = number(random, self.variant, self.most);
                self.resize(random, to);
            }
        }
        "another number"
    }

    fn resize(&mut self, random: &mut Random, n: usize) {
        let had = self.scenario.spheres.len();
        self.scenario = self.scenario.only(|k| k < n);
        let new = self.new_spheres(random, n.saturating_sub(had));
        self.scenario.spheres.extend(new);
        let TestInput { mixture, groups, excluded, .. } = &mut self.scenario;
        if let Some(mixture) = mixture {
            let count = mixture.rows.len() as u32;
            mixture.species.resize_with(n, || random.below(count));
        }
        if let Some(groups) = groups {
            groups.resize_with(n, || random.below(5));
        }
        if let Some(list) = excluded {
            *excluded = ExclusionCase::new(n, list.pairs().collect::<Vec<_>>()).ok();
        }
    }

    fn remove_one(&mut self, random: &mut Random) {
        let one = self.one(random);
        self.scenario = self.scenario.only(|k| k != one);
    }

    fn change_positions(&mut self, random: &mut Random) -> &'static str {
        let (one, other, extent, unit) = (self.one(random), self.one(random), self.extent, self.radius);
        let n = self.scenario.spheres.len();
        let shift = random_position(random, extent) * [1e-3, 0.1, 1.0][random.below(3) as usize];
        let spheres = &mut self.scenario.spheres;
        if n == 0 {
            return "still";
        }
        let near = |center: Vec3, random: &mut Random| center + unit * 0.5 * (random.unit() - 0.5);
        match random.below(10) {
            0 | 1 => {
                let center = near(spheres[other].center, random);
                spheres[one].center = finite(center);
                "one next to another"
            }
            2 => {
                let is_seventh = |k: &usize| k % 7 == one % 7;
                (0..n)
                    .filter(is_seventh)
                    .for_each(|k| spheres[k].center = finite(near(spheres[(k + other) % n].center, random)));
                "some next to others"
            }
            3 => {
                spheres[one].center = random_position(random, extent);
                "one elsewhere"
            }
            4 => {
                let radii: Vec<f32> = spheres.iter().map(|s| s.radius).collect();
                *spheres = at_new_positions(random, extent, &radii);
                "all at new places"
            }
            5 => {
                self.scenario.spheres = self.new_spheres(random, n);
                "another scene"
            }
            6 => {
                spheres.iter_mut().for_each(|s| s.center = finite(s.center + shift));
                "all shifted"
            }
            7 => {
                let [a, b] = [spheres[one].center, spheres[other].center];
                (spheres[one].center, spheres[other].center) = (b, a);
                "two swapped"
            }
            8 if n <= MAX_CROWD => {
                let center = spheres[one].center;
                spheres.iter_mut().for_each(|s| s.center = center);
                "all at one place"
            }
            8 => {
                spheres.reverse();
                "reversed"
            }
            _ => {
                let factor = [0.7, 0.999, 1.3][random.below(3) as usize];
                spheres.iter_mut().for_each(|s| s.center = finite(s.center * factor));
                "all nearer or farther"
            }
        }
    }

    fn species(&mut self, random: &mut Random) -> &'static str {
        let one = self.one(random);
        let Some(mixture) = &mut self.scenario.mixture else { return "still" };
        let count = mixture.rows.len() as u32;
        match random.below(3) {
            0 => {
                mixture.species.iter_mut().for_each(|id| *id = random.below(count));
                "all species new"
            }
            1 => {
                mixture.species.iter_mut().for_each(|id| *id = (*id + 1) % count);
                "all species moved on"
            }
            _ => {
                mixture.species[one..].iter_mut().take(1).for_each(|id| *id = random.below(count));
                "one species new"
            }
        }
    }

    pub(super) fn change_exclusions(&mut self, random: &mut Random) -> &'static str {
        let n = self.scenario.spheres.len();
        match random.below(6) {
            0 => self.scenario.groups = None,
            1 => self.scenario.excluded = None,
            2 | 3 => {
                let most = [2, 5, 1 + n as u32 / 2][random.below(3) as usize];
                let group = |_| if random.below(4) == 0 { Spheres::NO_GROUP } else { random.below(most) };
                self.scenario.groups = Some((0..n).map(group).collect());
            }
            _ => {
                let mut pairs: Vec<(u32, u32)> = match n {
                    0..=MAX_LISTED => self.scenario.oracle().iter().map(|pair| (pair.i, pair.j)).collect(),
                    _ => (0..n).map(|_| (random.below(n as u32), random.below(n as u32))).collect(),
                };
                pairs.retain(|_| random.below(2) == 0);
                self.scenario.excluded = ExclusionCase::new(n, pairs).ok();
            }
        }
        "other exclusions"
    }
}

fn finite(center: Vec3) -> Vec3 {
    if center.is_finite() { center } else { Vec3::ZERO }
}
