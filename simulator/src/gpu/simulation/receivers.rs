use super::GpuSimulation;
use crate::Error;
use crate::gpu::receiver_trajectory::ReceiverTrajectory;

impl GpuSimulation {
    pub(super) fn prepare_receivers(&mut self, steps: u32) -> Result<(), Error> {
        self.trajectory = ReceiverTrajectory::new(&self.model, self.key, &self.centers, self.step, steps);
        // Resting receivers were listed at the beginning.
        if !self.trajectory.max_displacements.is_empty() {
            let (displacements, max_displacement) =
                (&self.trajectory.max_displacements, self.trajectory.head.max_displacement);
            let is_worthwhile = self.cells_builder.is_worthwhile(u64::from(steps) * u64::from(self.alive));
            let receiver_cells = is_worthwhile
                .then(|| self.cells_builder.build(&self.centers, displacements, max_displacement))
                .transpose()?;
            let receiver_cells = receiver_cells.unwrap_or_default();
            self.buffers.upload_cells(&receiver_cells)?;
            self.cells = receiver_cells.head;
        }
        self.buffers.upload_trajectory(&self.trajectory, self.cells)
    }
}
