//! The positions of receivers in the next steps: receivers move independently, so that the host knows them in advance.

use super::layout::{Body, Journey};
use super::plan::LOG_ROWS;
use crate::model::Model;
use crate::motion::receiver_state;
use crate::random::philox::Key;

/// The positions of receivers at the beginning of each of some steps, and after the last one.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Itinerary {
    pub(super) head: Journey,
    /// Indexed by step, then by receiver; a single step if no receiver moves.
    pub(super) rows: Vec<Body>,
    /// The centers of each step, in µm.
    centers: Vec<Vec<[f32; 3]>>,
    /// The largest displacement of each receiver, in µm; empty if all rest.
    pub(super) gone: Vec<f32>,
}

/// Bytes of the table of where receivers are, unless one step takes more.
const TABLE: u64 = 4 << 20;
/// Bytes of a row of it.
const ROW: u64 = 32;

/// The most steps between two readbacks, by the capacity for positions of receivers.
pub(super) fn most_steps(model: &Model) -> u32 {
    if !model.receivers.iter().any(crate::Receiver::moves) {
        return LOG_ROWS;
    }
    let rows = TABLE / (ROW * model.receivers.len() as u64);
    rows.saturating_sub(1).clamp(1, LOG_ROWS.into()) as u32
}

/// Rows that the table has at most.
pub(super) fn most_rows(model: &Model) -> usize {
    let moves = model.receivers.iter().any(crate::Receiver::moves);
    model.receivers.len() * if moves { most_steps(model) as usize + 1 } else { 1 }
}

impl Itinerary {
    /// Returns the positions of receivers that start at these centers, for a number of steps.
    pub(super) fn new(model: &Model, key: Key, centers: &[[f32; 3]], first: u32, steps: u32) -> Self {
        let moves = model.receivers.iter().any(crate::Receiver::moves);
        let stride = if moves { centers.len() as u32 } else { 0 };
        let mut itinerary = Self {
            head: Journey { first, stride, ..Journey::default() },
            rows: Vec::new(),
            centers: Vec::new(),
            gone: Vec::new(),
        };
        let mut here = centers.to_vec();
        for step in first..first + if moves { steps } else { 0 } {
            let places = receiver_state::move_receivers(model, &here, key, step);
            for (&center, place) in here.iter().zip(&places) {
                let way = place.displacement.iter().map(|w| w * w).sum::<f32>().sqrt();
                itinerary.head.longest = itinerary.head.longest.max(way);
                itinerary.rows.push(Body { center: center.into(), way: place.displacement.into() });
            }
            let next = places.iter().map(|place| place.center).collect();
            itinerary.centers.push(std::mem::replace(&mut here, next));
        }
        itinerary.rows.extend(here.iter().map(|&center| Body { center: center.into(), ..Body::default() }));
        itinerary.centers.push(here);
        if moves {
            let length = |d: [f32; 3]| d.iter().map(|c| c * c).sum::<f32>().sqrt();
            let gone = |(at, &begin): (usize, &[f32; 3])| {
                let from = |centers: &Vec<[f32; 3]>| length(model.boundary.displacement(begin, centers[at]));
                itinerary.centers.iter().map(from).fold(0.0, f32::max)
            };
            itinerary.gone = centers.iter().enumerate().map(gone).collect();
        }
        itinerary
    }

    /// The centres when so many steps of the run are done.
    pub(super) fn centers_at(&self, done: u32) -> &[[f32; 3]] {
        let at = if self.head.stride == 0 { 0 } else { (done - self.head.first) as usize };
        &self.centers[at]
    }
}
