//! Receivers in the steps to come.

use super::GpuSimulation;
use crate::Error;
use crate::gpu::journey::Itinerary;

impl GpuSimulation {
    /// Works out where receivers are in so many steps, and which ones are near each cell, and hands that over.
    pub(super) fn foresee(&mut self, steps: u32) -> Result<(), Error> {
        self.itinerary = Itinerary::new(&self.model, self.key, &self.centers, self.step, steps);
        // Those that rest are listed from the beginning.
        if !self.itinerary.gone.is_empty() {
            let (gone, longest) = (&self.itinerary.gone, self.itinerary.head.longest);
            let pays = self.listing.pays(u64::from(steps) * u64::from(self.alive));
            let nearby = pays.then(|| self.listing.of(&self.centers, gone, longest)).transpose()?;
            let nearby = nearby.unwrap_or_default();
            self.base.list(&nearby)?;
            self.lists = nearby.head;
        }
        self.base.take_up(&self.itinerary, self.lists)
    }
}
