use std::borrow::Cow;

use crate::state::view::RunView;
use crate::{Arrival, Error, Model, State, Totals};

/// The state of a run on rank 0. Other ranks have only counts.
#[derive(Clone, Debug)]
pub struct Gathered<'a> {
    pub(super) model: &'a Model,
    pub(super) totals: &'a Totals,
    /// Empty if not [requested](super::GatherFields::received).
    pub(super) received: Vec<Vec<u64>>,
    pub(super) arrivals: Vec<Arrival>,
    /// Without particles if not [requested](super::GatherFields::particles).
    pub(super) state: State,
}

impl RunView for Gathered<'_> {
    fn model(&self) -> &Model {
        self.model
    }

    fn step_count(&self) -> u32 {
        self.state.step
    }

    fn totals(&self) -> &Totals {
        self.totals
    }

    fn received(&self) -> Vec<Vec<u64>> {
        self.received.clone()
    }

    fn arrivals(&self) -> &[Arrival] {
        &self.arrivals
    }

    fn state(&self) -> Result<Cow<'_, State>, Error> {
        Ok(Cow::Borrowed(&self.state))
    }
}
