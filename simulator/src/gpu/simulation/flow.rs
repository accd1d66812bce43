//! A batch of steps ends if the flow changes.

use super::GpuSimulation;
use crate::Error;

impl GpuSimulation {
    pub(super) fn steps_of_flow(&self, most: u32) -> u32 {
        let part = |later: u32| self.model.flow_part_of_step(self.step + later);
        (1..most).find(|&later| part(later) != part(0)).unwrap_or(most)
    }

    pub(super) fn prepare_flow(&mut self) -> Result<(), Error> {
        let part = self.model.flow_part_of_step(self.step);
        if part == self.flow_part {
            return Ok(());
        }
        self.tables.set_flow(&self.model, part);
        self.buffers.upload_flow(&self.tables)?;
        self.flow_part = part;
        Ok(())
    }
}
