//! Reflecting receivers, which no separation may move a particle into.

use lazygrid::{Sphere, Spheres};
use rayon::prelude::*;

use crate::Error;
use crate::model::Model;
use crate::model::boundary::Boundary;
use crate::model::receiver::{Receiver, finder, rounding, signed_distance};
use crate::motion::path_hit::length;

/// At the end of the step.
#[derive(Debug)]
pub(super) struct ReflectingSpheres {
    all: Vec<ReflectingSphere>,
    boundary: Boundary,
}

#[derive(Debug)]
struct ReflectingSphere {
    /// Index in the model.
    index: usize,
    center: [f32; 3],
    radius: f32,
    sees: Vec<bool>,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Shift {
    pub(super) at: usize,
    pub(super) species: u32,
    pub(super) from: [f32; 3],
    pub(super) to: [f32; 3],
}

/// Largest number of tests without a search.
const MAX_TESTS: usize = 1 << 16;
const CHUNK: usize = 1 << 16;

impl ReflectingSpheres {
    pub(super) fn new(model: &Model) -> Self {
        let reflecting = model.receivers.iter().enumerate().filter(|(_, receiver)| receiver.reflects_some());
        let sphere = |(index, receiver): (usize, &Receiver)| ReflectingSphere {
            index,
            center: receiver.center,
            radius: receiver.radius,
            sees: receiver.sees.clone(),
        };
        Self { all: reflecting.map(sphere).collect(), boundary: model.boundary }
    }

    pub(super) fn set_centers(&mut self, centers: &[[f32; 3]]) {
        self.all.iter_mut().for_each(|sphere| sphere.center = centers[sphere.index]);
    }

    /// Removes shifts from outside into a sphere that sees the species.
    pub(super) fn retain_outside(&self, shifts: &mut Vec<Shift>) {
        let candidates = match self.all.len() * shifts.len() {
            0 => return,
            1..=MAX_TESTS => None,
            // Non-finite coordinates, which the detector rejects, are in no sphere; then all spheres are tested.
            _ => self.candidates(shifts).ok(),
        };
        let enters = |shift: &Shift, sphere: &ReflectingSphere| sphere.is_entered(shift, &self.boundary);
        let is_outside: Vec<bool> = match candidates {
            Some(candidates) => {
                let mut is_outside = vec![true; shifts.len()];
                for (sphere, shift) in candidates {
                    is_outside[shift] &= !enters(&shifts[shift], &self.all[sphere]);
                }
                is_outside
            }
            None => {
                shifts.par_iter().map(|shift| !self.all.iter().any(|sphere| enters(shift, sphere))).collect()
            }
        };
        let mut retained = is_outside.into_iter();
        shifts.retain(|_| retained.next().unwrap_or(true));
    }

    /// Returns pairs of a sphere and a shift that ends within the longest shift of its surface.
    fn candidates(&self, shifts: &[Shift]) -> Result<Vec<(usize, usize)>, Error> {
        let longest = shifts.iter().map(|shift| length(shift.by(&self.boundary))).fold(0.0, f32::max);
        let grown = |sphere: &ReflectingSphere| {
            let radius = sphere.radius + longest;
            Sphere::new(sphere.center, radius + rounding(sphere.center, 2.0 * radius))
        };
        let spheres: Vec<Sphere> = self.all.iter().map(grown).collect();
        let [x, y, z] = [0, 1, 2].map(|k: usize| shifts.iter().map(|shift| shift.to[k]).collect::<Vec<_>>());
        let points = vec![0.0; shifts.len()];
        let points = Spheres::columns(&x, &y, &z, &points).map_err(lazygrid::Error::from)?;
        let mut found = Vec::new();
        finder(&self.boundary)?.stream((&spheres, points), CHUNK, |pairs| {
            found.extend(pairs.iter().map(|pair| (pair.i as usize, pair.j as usize)));
            std::ops::ControlFlow::Continue(())
        })?;
        Ok(found)
    }
}

impl ReflectingSphere {
    fn is_entered(&self, shift: &Shift, boundary: &Boundary) -> bool {
        let height = |point: [f32; 3]| signed_distance(self.radius, self.center, boundary, point);
        if !self.sees[shift.species as usize] || height(shift.from) < 0.0 {
            return false;
        }
        let (start, by) = (boundary.displacement(self.center, shift.from), shift.by(boundary));
        let fraction = (-dot(start, by) / dot(by, by).max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
        let nearest = std::array::from_fn(|k| start[k] + fraction * by[k]);
        length(nearest) < self.radius || height(shift.to) < 0.0
    }
}

impl Shift {
    fn by(&self, boundary: &Boundary) -> [f32; 3] {
        boundary.displacement(self.from, self.to)
    }
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
