//! Bodies that particles must not enter.

use lazygrid::{Sphere, Spheres};
use rayon::prelude::*;

use crate::Error;
use crate::model::Model;
use crate::model::boundary::Boundary;
use crate::model::receiver::{Receiver, finder, rounding, signed_distance};
use crate::motion::path_hit::length;

/// Reflecting receivers at the end of the step.
#[derive(Debug)]
pub(super) struct Bodies {
    all: Vec<Body>,
    boundary: Boundary,
}

#[derive(Debug)]
struct Body {
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

impl Bodies {
    pub(super) fn new(model: &Model) -> Self {
        let reflecting = model.receivers.iter().enumerate().filter(|(_, receiver)| receiver.reflects_some());
        let body = |(index, receiver): (usize, &Receiver)| Body {
            index,
            center: receiver.center,
            radius: receiver.radius,
            sees: receiver.sees.clone(),
        };
        Self { all: reflecting.map(body).collect(), boundary: model.boundary }
    }

    pub(super) fn set_centers(&mut self, centers: &[[f32; 3]]) {
        self.all.iter_mut().for_each(|body| body.center = centers[body.index]);
    }

    /// Removes the shifts from outside into a body that sees the species.
    pub(super) fn retain_outside(&self, shifts: &mut Vec<Shift>) {
        let candidates = match self.all.len() * shifts.len() {
            0 => return,
            1..=MAX_TESTS => None,
            // The detector rejects non-finite coordinates, which are in no body; then all bodies are tested.
            _ => self.candidates(shifts).ok(),
        };
        let enters = |shift: &Shift, body: &Body| body.is_entered(shift, &self.boundary);
        let is_outside: Vec<bool> = match candidates {
            Some(candidates) => {
                let mut is_outside = vec![true; shifts.len()];
                for (body, shift) in candidates {
                    is_outside[shift] &= !enters(&shifts[shift], &self.all[body]);
                }
                is_outside
            }
            None => shifts.par_iter().map(|shift| !self.all.iter().any(|body| enters(shift, body))).collect(),
        };
        let mut retained = is_outside.into_iter();
        shifts.retain(|_| retained.next().unwrap_or(true));
    }

    /// Returns pairs of a body and a shift that ends within the longest shift of its surface.
    fn candidates(&self, shifts: &[Shift]) -> Result<Vec<(usize, usize)>, Error> {
        let longest = shifts.iter().map(|shift| length(shift.by(&self.boundary))).fold(0.0, f32::max);
        let grown = |body: &Body| {
            let radius = body.radius + longest;
            Sphere::new(body.center, radius + rounding(body.center, 2.0 * radius))
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

impl Body {
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
