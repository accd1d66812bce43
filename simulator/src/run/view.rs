use std::borrow::Cow;

use crate::{Arrival, Error, Model, State, Totals};

/// A read-only view of a running simulation, for code that writes its files.
pub trait RunView {
    /// Returns the model.
    fn model(&self) -> &Model;

    /// Returns the number of steps done.
    fn step_count(&self) -> u32;

    /// Returns the simulated time, in s.
    fn time(&self) -> f64 {
        f64::from(self.step_count()) * self.model().time_step
    }

    /// Returns the counts.
    fn totals(&self) -> &Totals;

    /// Returns the counts of each receiver, by species: arrivals so far, bound particles, or the particles inside a transparent
    /// receiver.
    fn received(&self) -> Vec<Vec<u64>>;

    /// Returns the particles that arrived in the last step, in the order of ids, if the model logs arrivals.
    fn arrivals(&self) -> &[Arrival];

    /// Returns the state, read back from a device or gathered from ranks if necessary.
    ///
    /// # Errors
    /// [`Error::Detection`] if the device that holds the state fails.
    fn state(&self) -> Result<Cow<'_, State>, Error>;
}
