use std::ops::ControlFlow;

use lazygrid::Sphere;

use crate::Error;
use crate::model::boundary::Boundary;
use crate::model::receiver::{Receiver, finder, rounding};

/// Largest number of pairs of a search.
const MAX_PAIRS: usize = 1 << 20;
/// Limit of searches, each within half the distance of the former.
const MAX_SEARCHES: usize = 64;
/// Limit of receivers that are compared with each other if the search refuses them.
const MAX_TESTED: usize = 1000;
const CHUNK: usize = 1 << 16;

/// Returns ascending pairs of receivers with surfaces at most `distance` apart, the smaller index first. In crowds the
/// distance is smaller, so that the closest pairs are found.
pub(super) fn close_pairs(boundary: &Boundary, receivers: &[&Receiver], distance: f64) -> Vec<[usize; 2]> {
    if receivers.len() < 2 {
        return Vec::new();
    }
    let mut distance = distance;
    let mut pairs = Vec::new();
    for _ in 0..MAX_SEARCHES {
        let Ok(is_complete) = search(boundary, receivers, distance, &mut pairs) else {
            let tested = receivers.len().min(MAX_TESTED);
            return (0..tested).flat_map(|l| (0..l).map(move |k| [k, l])).collect();
        };
        if is_complete {
            break;
        }
        distance *= 0.5;
    }
    pairs.sort_unstable();
    pairs
}

/// Returns `false` if it stopped at [`MAX_PAIRS`].
fn search(
    boundary: &Boundary,
    receivers: &[&Receiver],
    distance: f64,
    pairs: &mut Vec<[usize; 2]>,
) -> Result<bool, Error> {
    let grown = |receiver: &&Receiver| {
        let radius = receiver.radius + (0.5 * distance) as f32;
        Sphere::new(receiver.center, radius + rounding(receiver.center, radius))
    };
    let spheres: Vec<Sphere> = receivers.iter().map(grown).collect();
    pairs.clear();
    finder(boundary)?.stream(&spheres, CHUNK, |found| {
        pairs.extend(found.iter().map(|pair| [pair.i as usize, pair.j as usize]));
        if pairs.len() > MAX_PAIRS { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })?;
    Ok(pairs.len() <= MAX_PAIRS)
}
