use std::borrow::Cow;

use crate::{Arrival, Error, Model, State, Totals};

/// Read by the writers of a run's files.
pub trait RunView {
    fn model(&self) -> &Model;

    fn step_count(&self) -> u32;

    fn time(&self) -> f64 {
        f64::from(self.step_count()) * self.model().time_step
    }

    fn totals(&self) -> &Totals;

    /// Returns counts by receiver and species: arrivals so far, bound particles, or particles inside.
    fn received(&self) -> Vec<Vec<u64>>;

    /// Returns the last step's arrivals by id, in a model that logs arrivals.
    fn arrivals(&self) -> &[Arrival];

    /// Returns the state, read back or gathered if necessary.
    ///
    /// # Errors
    /// [`Error::Detection`] if the device fails.
    fn state(&self) -> Result<Cow<'_, State>, Error>;
}
