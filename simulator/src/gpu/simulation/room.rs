//! Room: a step that froze for want of it is repeated with more.

use lazygrid::gpu::{GpuConfig, GpuDetector};

use super::{GpuSimulation, MAX_ROUNDS};
use crate::Error;
use crate::gpu::device::{refused, with_error_scope};
use crate::gpu::layout::Head;
use crate::gpu::plan::{Sizes, grown};
use crate::gpu::stages::{Base, Steps};

/// Surfaces near one particle, as `turning.wgsl` has it.
const NEAR: u64 = 16;
/// Particles that come to the receptors of one receiver in a step, as `receptors_scan.wgsl` has it.
const MOST_BIDS: u64 = 1 << 20;

impl GpuSimulation {
    /// Makes room for what froze the run, if anything did, and lets it go on.
    pub(super) fn thaw(&mut self, head: Head) -> Result<(), Error> {
        let step = self.step;
        let failed = |source| Err(refused(source));
        let mut sizes = self.steps.sizes;
        match head.frozen {
            0 => return Ok(()),
            Head::NO_ROOM_FOR_PAIRS => {
                let limit = 1u64 << 28;
                let needed = head.lacking();
                if needed > limit {
                    let remedy = "make binding radii or bursts smaller, or choose the CPU";
                    let what = "the number of pairs of a step";
                    return failed(lazygrid::Error::LimitExceeded { what, needed, limit, remedy });
                }
                sizes.pairs = (needed + needed / 4) as u32;
            }
            Head::NO_ROOM_FOR_ENTRIES => {
                self.cell_ratio *= 2.0;
                if self.cell_ratio > GpuConfig::MAX_CELL_RATIO {
                    let (needed, limit) = (head.lacking(), self.steps.sizes.particles.into());
                    let (what, remedy) = ("the number of (cell, particle) entries", "choose the CPU");
                    return failed(lazygrid::Error::LimitExceeded { what, needed, limit, remedy });
                }
                if let Some(detector) = &mut self.detector {
                    detector.set_cell_ratio(self.cell_ratio).map_err(refused)?;
                }
            }
            Head::ROUNDS_LEFT => {
                self.options.rounds = (2 * self.options.rounds).max(4);
                let (needed, limit) = (self.options.rounds.into(), MAX_ROUNDS.into());
                if needed > limit {
                    let (what, remedy) = ("the rounds of a matching", "choose the CPU");
                    return failed(lazygrid::Error::LimitExceeded { what, needed, limit, remedy });
                }
            }
            Head::TOO_MANY_NEAR | Head::TOO_MANY_BIDS => {
                let (what, limit) = match head.frozen {
                    Head::TOO_MANY_NEAR => ("the number of surfaces within reach of a particle's step", NEAR),
                    _ => ("the number of particles that come to a receiver's receptors in a step", MOST_BIDS),
                };
                let (needed, remedy) = (head.lacking(), "shorten the time step, or choose the CPU");
                return failed(lazygrid::Error::LimitExceeded { what, needed, limit, remedy });
            }
            Head::THROWN_TOO_FAR => {
                let what =
                    "how often a particle looks around for surfaces at which others throw it in a step";
                let (needed, remedy) = (head.lacking(), "shorten the time step, or choose the CPU");
                return failed(lazygrid::Error::LimitExceeded { what, needed, limit: needed - 1, remedy });
            }
            Head::NOT_FINITE => return Err(Error::NotFinite { step, particles: head.lacking() }),
            other => {
                let reason = format!("the run froze for reason {other}, which nobody knows");
                return failed(lazygrid::Error::DeviceRejected { what: "a step", reason });
            }
        }
        log::info!(
            "step {step}: repeated for want of room (reason {}, {} needed)",
            head.frozen,
            head.lacking()
        );
        self.rebuild(sizes)?;
        let at = std::mem::offset_of!(Head, frozen) as u64;
        let control = self.base.buffer("control");
        with_error_scope(&self.base.own, "thawing", 0, || {
            self.base.own.queue.write_buffer(control, at, &[0; 4])
        })
    }

    pub(super) fn make_room(&mut self, particles: u32) -> Result<(), Error> {
        let sizes = self.steps.sizes;
        // The detector may have lost its buffers to a growth that failed.
        let found = self.detector.as_mut().map(|detector| detector.reserve(sizes.particles));
        let found = found.transpose().map_err(refused)?;
        let bound = found.is_none_or(|found| self.steps.are_bound_to(&found));
        match particles <= sizes.particles {
            true if bound => Ok(()),
            true => self.rebuild(sizes),
            false => self.rebuild(Sizes { particles: grown(particles), ..sizes }),
        }
    }

    /// Goes over to other sizes. Particles stay on the device; what a step works in begins clean.
    pub(super) fn rebuild(&mut self, sizes: Sizes) -> Result<(), Error> {
        let steps = prepare(&mut self.base, sizes, self.options.rounds, self.detector.as_mut())?;
        let mut encoder = self.encoder();
        for (name, bytes) in [("spheres", 16), ("tags", 8)] {
            let bytes = bytes * u64::from(self.alive);
            if bytes > 0 {
                encoder.copy_buffer_to_buffer(self.steps.buffer(name), 0, steps.buffer(name), 0, bytes);
            }
        }
        with_error_scope(&self.base.own, "new sizes", 0, || self.base.own.queue.submit([encoder.finish()]))?;
        self.steps = steps;
        Ok(())
    }
}

/// Allocates for these sizes, in the detector first.
pub(super) fn prepare(
    base: &mut Base,
    sizes: Sizes,
    rounds: u32,
    detector: Option<&mut GpuDetector>,
) -> Result<Steps, Error> {
    let found = detector.map(|detector| {
        detector.set_pair_capacity(sizes.pairs.max(1));
        detector.reserve(sizes.particles)
    });
    Steps::new(base, sizes, rounds, found.transpose().map_err(refused)?)
}
