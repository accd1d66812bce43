//! Upper bounds of logs, in bytes.

use super::disk_estimate::{digits, moment};
use super::occupancy;
use crate::model::transmitter::Schedule;
use crate::{Model, Receiver, RunView, Transmitter};

/// Arrivals between checks of the disk.
pub(crate) const LOGGED_ARRIVALS: u64 = 1 << 14;
/// Steps between checks of the disk, with logs.
pub(crate) const LOGGED_STEPS: u32 = 4096;

/// Bytes after step `from`, for `ids` particles that exist or appear, and `present` ones in a row.
pub(super) fn remaining_bytes(
    model: &Model,
    [from, steps]: [u32; 2],
    [ids, present]: [f64; 2],
    every: u32,
) -> f64 {
    if !model.logs_arrivals {
        return 0.0;
    }
    let row = RowEstimate::new(model, [from, steps]);
    let removes = |receiver: &Receiver| receiver.kind.absorbs() && receiver.sees.contains(&true);
    let arrivals = if model.receivers.iter().any(removes) { ids } else { 0.0 };
    let occupied = f64::from(steps / every - from / every) * occupancy_rows(model, steps, present);
    arrivals * row.arrival(ids) + releases(model, [from, steps]) * row.release() + occupied * row.occupancy()
}

/// Bytes until the next check of the disk.
pub(super) fn next(run: &impl RunView) -> f64 {
    let (model, step) = (run.model(), run.step_count());
    if !model.logs_arrivals {
        return 0.0;
    }
    let later = step.saturating_add(LOGGED_STEPS);
    let row = RowEstimate::new(model, [step, later]);
    let arrivals = (run.arrivals().len() as u64 + LOGGED_ARRIVALS) as f64;
    let ids = run.totals().released.iter().sum::<u64>() as f64;
    let occupied = occupancy_rows(model, step, run.totals().present.iter().sum::<u64>() as f64);
    arrivals * row.arrival(ids) + releases(model, [step, later]) * row.release() + occupied * row.occupancy()
}

struct RowEstimate {
    moment: f64,
    receiver: f64,
    species: f64,
    transmitter: f64,
}

impl RowEstimate {
    fn new(model: &Model, window: [u32; 2]) -> Self {
        let longest = |lengths: &mut dyn Iterator<Item = usize>| 1.0 + lengths.max().unwrap_or(0) as f64;
        Self {
            moment: 1.0 + moment(model, window),
            receiver: longest(&mut model.receivers.iter().map(|one| one.name.len())),
            species: longest(&mut model.species.iter().map(|one| one.name.len())),
            transmitter: longest(&mut model.transmitters.iter().map(|one| one.name.len())),
        }
    }

    /// The time of a release is as long as a step and its time.
    fn arrival(&self, ids: f64) -> f64 {
        2.0 * self.moment + self.receiver + self.species + self.transmitter + 1.0 + digits(ids)
    }

    fn release(&self) -> f64 {
        self.moment + self.transmitter + self.species + COUNT_BYTES
    }

    fn occupancy(&self) -> f64 {
        2.0 * self.moment + self.receiver + self.species + self.transmitter + COUNT_BYTES
    }
}

const COUNT_BYTES: f64 = 6.0;

fn releases(model: &Model, [from, steps]: [u32; 2]) -> f64 {
    let window = [from.saturating_add(1), steps.saturating_add(1)];
    let steady = |(&(_, rate), (_, count)): (&(u32, f64), (u32, f64))| {
        count.min(count / (rate * model.time_step) + 1.0)
    };
    let release_rows = |one: &Transmitter| {
        let means = one.mean_between(window, model.time_step);
        match &one.schedule {
            Schedule::Steady { rates, .. } => rates.iter().zip(means).map(steady).sum(),
            Schedule::Times(_) => {
                let bursts =
                    means.iter().zip(&one.release).map(|(mean, &(_, count))| mean.1 / f64::from(count));
                bursts.filter(|bursts| bursts.is_finite()).sum()
            }
            Schedule::Message(message) => {
                let sent = |step| f64::from(message.sent_before(step, model.time_step));
                (sent(window[1]) - sent(window[0])) * one.release.len() as f64
            }
        }
    };
    model.transmitters.iter().map(release_rows).sum()
}

/// Rows up to `step`: one for each release in each momentary receiver, but at most one per particle.
fn occupancy_rows(model: &Model, step: u32, present: f64) -> f64 {
    if !occupancy::is_logged(model) {
        return 0.0;
    }
    let seen = model.receivers.iter().filter(|receiver| receiver.is_momentary());
    let pairs: usize = seen.map(|receiver| receiver.sees.iter().filter(|sees| **sees).count()).sum();
    let first: usize = model.transmitters.iter().map(|one| one.release.len()).sum();
    present.min(pairs as f64 * (1.0 + first as f64 + releases(model, [0, step])))
}
