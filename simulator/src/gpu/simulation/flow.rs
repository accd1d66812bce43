//! A batch of steps ends if the flow changes.

use super::GpuSimulation;
use crate::Error;

impl GpuSimulation {
    pub(super) fn steps_of_flow(&self, step_limit: u32) -> u32 {
        let fraction = |later: u32| self.model.flow_fraction_of_step(self.step + later);
        (1..step_limit).find(|&later| fraction(later) != fraction(0)).unwrap_or(step_limit)
    }

    pub(super) fn prepare_flow(&mut self) -> Result<(), Error> {
        let fraction = self.model.flow_fraction_of_step(self.step);
        if fraction == self.flow_fraction {
            return Ok(());
        }
        self.tables.set_flow(&self.model, fraction);
        self.buffers.upload_flow(&self.tables)?;
        self.flow_fraction = fraction;
        Ok(())
    }
}
