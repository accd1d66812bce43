//! What makes two spheres a pair: the one exact test behind every filter.

use std::ops::Range;

use glam::Vec3;
use lazygrid_kernels::{Interaction, Interactions, Reach, Sphere, Spheres};

use crate::columns::Columns;
use crate::simd::Vector;
use crate::sink::Sink;

/// Whether two centres are at most `reach` apart, evaluated in `f64`: there differences of `f32` coordinates
/// cannot overflow, underflow or lose the digits that decide exact contact.
#[inline]
pub(crate) fn within(a: Vec3, b: Vec3, reach: f64) -> bool {
    let d = a.as_dvec3() - b.as_dvec3();
    d.x * d.x + d.y * d.y + d.z * d.z <= reach * reach
}

/// Which spheres make a pair.
#[derive(Clone, Debug)]
pub(crate) struct Rule<'a> {
    spheres: Spheres<'a>,
    species: Option<Species<'a>>,
}

/// Interactions by species, with the ids checked against the table.
#[derive(Clone, Debug)]
struct Species<'a> {
    table: &'a Interactions,
    ids: &'a [u32],
    reach: Vec<Reach>,
}

impl<'a> Rule<'a> {
    /// The rule for spheres whose species ids, where interactions are given, are already checked.
    pub(crate) fn new(spheres: Spheres<'a>, interactions: Option<&'a Interactions>) -> Self {
        let species = interactions.zip(spheres.species()).map(|(table, ids)| {
            let reach = (0..table.species()).map(|s| table.reach(s)).collect();
            Species { table, ids, reach }
        });
        Self { spheres, species }
    }

    pub(crate) fn spheres(&self) -> Spheres<'a> {
        self.spheres
    }

    /// The spheres as rows whose radii are the effective ones, where that is what they are.
    #[inline(always)]
    pub(crate) fn plain_rows(&self) -> Option<&'a [Sphere]> {
        if self.is_plain() { self.spheres.as_rows() } else { None }
    }

    /// Whether touching alone decides, so that a certain contact needs no further question.
    #[inline(always)]
    fn is_plain(&self) -> bool {
        self.species.is_none()
    }

    /// Centre and effective radius of sphere `id`.
    #[inline(always)]
    pub(crate) fn effective(&self, id: u32) -> (Vec3, f32) {
        let sphere = self.spheres.get(id as usize);
        let radius = match &self.species {
            None => sphere.radius,
            Some(s) => s.reach[s.ids[id as usize] as usize].effective_radius(sphere.radius),
        };
        (sphere.center, radius)
    }

    /// The exact test.
    pub(crate) fn pairs(&self, i: u32, j: u32) -> bool {
        let (a, b) = (self.spheres.get(i as usize), self.spheres.get(j as usize));
        let interaction = match &self.species {
            None => Interaction::Touch,
            Some(s) => s.table.get(s.ids[i as usize], s.ids[j as usize]),
        };
        match interaction {
            Interaction::Never => false,
            Interaction::Touch => within(a.center, b.center, f64::from(a.radius) + f64::from(b.radius)),
            Interaction::Within(distance) => within(a.center, b.center, f64::from(distance)),
        }
    }

    /// Of the lanes that may be pairs with the sphere at `at`, those that are.
    #[inline(never)]
    fn decide(&self, columns: &Columns, at: usize, base: usize, lanes: Lanes) -> u32 {
        let mut hits = if self.is_plain() { lanes.certain } else { 0 };
        let mut open = lanes.possible & !hits;
        while open != 0 {
            let lane = open.trailing_zeros();
            open &= open - 1;
            if self.pairs(columns.id(at), columns.id(base + lane as usize)) {
                hits |= 1 << lane;
            }
        }
        hits
    }
}

#[derive(Clone, Copy)]
struct Lanes {
    certain: u32,
    possible: u32,
}

/// Compares the sphere at `at` with a run of others and hands the pairs to `sink`. The run must not contain `at`.
#[inline(always)]
pub(crate) fn scan<V: Vector, S: Sink>(
    vector: V,
    (columns, rule): (&Columns, &Rule<'_>),
    at: usize,
    run: Range<usize>,
    sink: &mut S,
) {
    let query = vector.query(columns.sphere(at));
    let mut base = run.start;
    while base < run.end {
        let live = u32::MAX >> (32 - V::LANES.min(run.end - base));
        let gaps = vector.gaps(columns, base, query);
        let possible = vector.possible(gaps) & live;
        if possible != 0 {
            let certain = vector.certain(gaps) & live;
            let hits = match rule.is_plain() && certain == possible {
                true => certain,
                false => rule.decide(columns, at, base, Lanes { certain, possible }),
            };
            if hits != 0 {
                sink.hits(vector, columns.id(at), columns.ids(base), hits);
            }
        }
        base += V::LANES;
    }
}
