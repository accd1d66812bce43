//! The state of a run on any backend.

use std::borrow::Cow;

use crate::{Arrival, Error, Model, State, Totals};

/// A run as those see it who write files about it.
pub trait RunView {
    /// The model.
    fn model(&self) -> &Model;

    /// The number of steps done.
    fn step_count(&self) -> u32;

    /// The time that has passed, in s.
    fn time(&self) -> f64 {
        f64::from(self.step_count()) * self.model().time_step
    }

    /// The counts.
    fn totals(&self) -> &Totals;

    /// What each receiver has to say, by species: arrivals so far, what its receptors hold, or how many are inside a
    /// transparent one.
    fn received(&self) -> Vec<Vec<u64>>;

    /// The particles that arrived in the steps that were done last, in the order of steps and ids, in a model that logs
    /// arrivals.
    fn arrivals(&self) -> &[Arrival];

    /// Where the run stands, brought here where it is elsewhere.
    ///
    /// # Errors
    /// [`Error::Detection`] where a device fails that has it.
    fn state(&self) -> Result<Cow<'_, State>, Error>;
}
