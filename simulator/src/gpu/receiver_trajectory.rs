//! Positions of receivers in the next steps. The host computes them, as receivers move independently.

use super::layout::{ReceiverRow, TrajectoryHeader};
use super::plan::LOG_ROWS;
use crate::Receiver;
use crate::model::Model;
use crate::motion::path_hit::length;
use crate::motion::receiver_state::{ReceiverMove, move_receivers};
use crate::random::philox::Key;

#[derive(Clone, Debug, PartialEq)]
pub(super) struct ReceiverTrajectory {
    pub(super) head: TrajectoryHeader,
    /// Indexed by step, then receiver; one step if no receiver moves.
    pub(super) rows: Vec<ReceiverRow>,
    centers: Vec<Vec<[f32; 3]>>,
    pub(super) max_displacements: Vec<f32>,
}

const TABLE_BYTES: u64 = 4 << 20;
const ROW_BYTES: u64 = 32;

pub(super) fn has_moving_receivers(model: &Model) -> bool {
    model.receivers.iter().any(Receiver::moves)
}

pub(super) fn max_steps(model: &Model) -> u32 {
    if !has_moving_receivers(model) {
        return LOG_ROWS;
    }
    let rows = TABLE_BYTES / (ROW_BYTES * model.receivers.len() as u64);
    rows.saturating_sub(1).clamp(1, LOG_ROWS.into()) as u32
}

pub(super) fn max_rows(model: &Model) -> usize {
    model.receivers.len() * if has_moving_receivers(model) { max_steps(model) as usize + 1 } else { 1 }
}

impl ReceiverTrajectory {
    pub(super) fn new(model: &Model, key: Key, centers: &[[f32; 3]], first: u32, steps: u32) -> Self {
        let moves = has_moving_receivers(model);
        let stride = if moves { centers.len() as u32 } else { 0 };
        let mut trajectory = Self {
            head: TrajectoryHeader { first, stride, ..TrajectoryHeader::default() },
            rows: Vec::new(),
            centers: Vec::new(),
            max_displacements: Vec::new(),
        };
        let mut current_centers = centers.to_vec();
        for step in first..first + if moves { steps } else { 0 } {
            let receiver_moves = move_receivers(model, &current_centers, key, step);
            for (&center, receiver_move) in current_centers.iter().zip(&receiver_moves) {
                let displacement = receiver_move.displacement;
                trajectory.head.max_displacement = trajectory.head.max_displacement.max(length(displacement));
                trajectory
                    .rows
                    .push(ReceiverRow { center: center.into(), displacement: displacement.into() });
            }
            let next = receiver_moves.iter().map(|receiver_move| receiver_move.center).collect();
            trajectory.centers.push(std::mem::replace(&mut current_centers, next));
        }
        trajectory.rows.extend(
            current_centers
                .iter()
                .map(|&center| ReceiverRow { center: center.into(), ..ReceiverRow::default() }),
        );
        trajectory.centers.push(current_centers);
        if moves {
            let largest = |(at, &begin): (usize, &[f32; 3])| {
                let from = |centers: &Vec<[f32; 3]>| length(model.boundary.displacement(begin, centers[at]));
                trajectory.centers.iter().map(from).fold(0.0, f32::max)
            };
            trajectory.max_displacements = centers.iter().enumerate().map(largest).collect();
        }
        trajectory
    }

    /// Returns the receivers after `steps` steps, at least one of which is in the trajectory.
    pub(super) fn receiver_moves_at(&self, steps: u32) -> Vec<ReceiverMove> {
        let mut receiver_moves = ReceiverMove::at_rest(self.centers_at(steps));
        if self.head.stride > 0 {
            let first = (steps - 1 - self.head.first) as usize * receiver_moves.len();
            let rows = &self.rows[first..];
            receiver_moves
                .iter_mut()
                .zip(rows)
                .for_each(|(receiver_move, row)| receiver_move.displacement = row.displacement.into());
        }
        receiver_moves
    }

    pub(super) fn centers_at(&self, steps: u32) -> &[[f32; 3]] {
        let at = if self.head.stride == 0 { 0 } else { (steps - self.head.first) as usize };
        &self.centers[at]
    }
}
