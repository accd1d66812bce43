use std::borrow::Cow;

use crate::{Arrival, Error, Model, State, Totals};

/// A read-only view of a run, for the writers of its files.
pub trait RunView {
    fn model(&self) -> &Model;

    fn step_count(&self) -> u32;

    /// Returns the simulated time, in s.
    fn time(&self) -> f64 {
        f64::from(self.step_count()) * self.model().time_step
    }

    fn totals(&self) -> &Totals;

    /// See [`Simulation::received`](crate::Simulation::received).
    fn received(&self) -> Vec<Vec<u64>>;

    /// See [`Simulation::arrivals`](crate::Simulation::arrivals).
    fn arrivals(&self) -> &[Arrival];

    /// Returns the state, read back or gathered if necessary.
    ///
    /// # Errors
    /// [`Error::Detection`] if the device fails.
    fn state(&self) -> Result<Cow<'_, State>, Error>;
}
