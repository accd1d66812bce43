//! Comparing one sphere with a run of others.

use std::ops::Range;

use super::columns::Columns;
use super::rule::Rule;
use super::simd::Vector;
use super::sink::Sink;

/// Estimated time to compare with one sphere of a long run, in nanoseconds.
pub(crate) const COMPARE: f32 = 0.2;

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
                false => decide(rule, columns, at, base, Lanes { certain, possible }),
            };
            if hits != 0 {
                sink.hits(vector, columns.id(at), columns.ids(base), hits);
            }
        }
        base += V::LANES;
    }
}

/// Of the lanes that may be pairs with the sphere at `at`, those that are.
#[inline(never)]
fn decide(rule: &Rule<'_>, columns: &Columns, at: usize, base: usize, lanes: Lanes) -> u32 {
    let mut hits = if rule.is_plain() { lanes.certain } else { 0 };
    let mut open = lanes.possible & !hits;
    while open != 0 {
        let lane = open.trailing_zeros();
        open &= open - 1;
        let (i, j) = (columns.id(at), columns.id(base + lane as usize));
        if rule.candidates(i, j).unwrap_or_else(|| rule.pairs(i, j)) {
            hits |= 1 << lane;
        }
    }
    hits
}
