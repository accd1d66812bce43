//! Recovery from a halt: repeats the step with more capacity.

use lazygrid::gpu::{GpuConfig, Outcome};

use super::{GpuSimulation, MAX_ROUNDS};
use crate::Error;
use crate::gpu::device::{refused, with_error_scope};
use crate::gpu::dispatches::StepDispatches;
use crate::gpu::layout::{ControlHeader, MAX_NEAR, MAX_NEIGHBORS, MAX_REQUESTS};
use crate::gpu::plan::{MAX_BIRTHS, Sizes, grow};

const MAX_COLLISION_ROUNDS: u64 = 1 << 13;
const MAX_PAIRS: u64 = 1 << 28;
const SHORTER_STEP: &str = "shorten the time step, or choose the CPU";

fn exceeded(what: &'static str, [needed, limit]: [u64; 2], remedy: &'static str) -> Error {
    refused(lazygrid::Error::LimitExceeded { what, needed, limit, remedy })
}

fn check_limit(what: &'static str, [needed, limit]: [u64; 2], remedy: &'static str) -> Result<(), Error> {
    if needed > limit { Err(exceeded(what, [needed, limit], remedy)) } else { Ok(()) }
}

impl GpuSimulation {
    pub(super) fn recover(&mut self, head: ControlHeader) -> Result<(), Error> {
        let step = self.step;
        let mut sizes = self.steps.sizes;
        let needed = head.missing();
        match head.reason() {
            0 => return Ok(()),
            ControlHeader::PAIR_OVERFLOW => {
                let remedy = "make binding radii or bursts smaller, or choose the CPU";
                check_limit("the number of pairs of a step", [needed, MAX_PAIRS], remedy)?;
                sizes.pairs = (needed + needed / 4) as u32;
            }
            ControlHeader::ENTRY_OVERFLOW => {
                self.cell_ratio *= 2.0;
                if self.cell_ratio > GpuConfig::MAX_CELL_RATIO {
                    let what = "the number of (cell, particle) entries";
                    return Err(exceeded(what, [needed, sizes.particles.into()], "choose the CPU"));
                }
                for detector in self.detectors.all() {
                    detector.set_cell_ratio(self.cell_ratio).map_err(refused)?;
                }
            }
            ControlHeader::UNFINISHED_SEARCH => {
                for detector in self.detectors.all() {
                    let mut outcome = Outcome::default();
                    [outcome.deferred_blocks, outcome.deferred_max_tiles] = head.missing;
                    detector.set_deferred_parts(detector.needed_deferred_parts(&outcome));
                }
            }
            ControlHeader::ROUNDS_LEFT => {
                self.options.rounds = (2 * self.options.rounds).max(4);
                let rounds = [self.options.rounds.into(), MAX_ROUNDS.into()];
                check_limit("the rounds of a matching", rounds, "choose the CPU")?;
            }
            ControlHeader::CANDIDATE_OVERFLOW => {
                check_limit("the candidates of collisions", [needed, MAX_PAIRS], SHORTER_STEP)?;
                sizes.near = (needed + needed / 4) as u32;
            }
            ControlHeader::TOO_FAST => sizes.speed_doublings += 1,
            ControlHeader::WINDOW_ROUNDS_LEFT | ControlHeader::WINDOWS_LEFT => {
                let is_in_window = head.reason() == ControlHeader::WINDOW_ROUNDS_LEFT;
                *(if is_in_window { &mut sizes.window_rounds } else { &mut sizes.windows }) *= 2;
                let rounds = u64::from(sizes.windows) * u64::from(sizes.window_rounds);
                let what = "the rounds of collisions in a step";
                check_limit(what, [rounds, MAX_COLLISION_ROUNDS], SHORTER_STEP)?;
            }
            ControlHeader::TOO_MANY_NEIGHBORS => {
                let what = "the particles near one that collides";
                return Err(exceeded(
                    what,
                    [u64::from(MAX_NEIGHBORS) + 1, MAX_NEIGHBORS.into()],
                    SHORTER_STEP,
                ));
            }
            ControlHeader::TOO_MANY_SURFACES => {
                let what = "the number of surfaces within reach of a particle's step";
                return Err(exceeded(what, [needed, MAX_NEAR.into()], SHORTER_STEP));
            }
            ControlHeader::TOO_MANY_REQUESTS => {
                let what = "the number of requests for a receiver's receptors in a step";
                return Err(exceeded(what, [needed, MAX_REQUESTS.into()], SHORTER_STEP));
            }
            ControlHeader::TOO_MANY_REQUERIES => {
                let what = "the number of searches for moving surfaces near a particle in a step";
                let limit = u64::from(self.buffers.max_requeries);
                return Err(exceeded(what, [limit + 1, limit], SHORTER_STEP));
            }
            ControlHeader::BIRTH_OVERFLOW => {
                let what = "the number of particles that dissociate into two in a step";
                check_limit(what, [needed, MAX_BIRTHS.into()], SHORTER_STEP)?;
                sizes.births = (needed + needed / 4).min(MAX_BIRTHS.into()) as u32;
            }
            ControlHeader::PARTICLE_OVERFLOW => sizes.particles = grow(needed as u32),
            ControlHeader::OUT_OF_IDS => {
                return Err(Error::OutOfIds { released: u64::from(self.next_id) + needed });
            }
            // A readback empties the log, so only one step's arrivals can overflow it.
            ControlHeader::EVENT_OVERFLOW => {
                sizes.events = sizes.events.max(grow(needed.min(u32::MAX.into()) as u32));
            }
            ControlHeader::NOT_FINITE => return Err(Error::NotFinite { step, particles: needed }),
            other => {
                let reason = format!("the device halted for the unknown reason {other}");
                return Err(refused(lazygrid::Error::DeviceRejected { what: "a step", reason }));
            }
        }
        log::info!("step {step}: repeated with more capacity (reason {}, {needed} needed)", head.reason());
        self.rebuild(sizes)?;
        let at = std::mem::offset_of!(ControlHeader, halted) as u64;
        let control = self.buffers.buffer("control");
        with_error_scope(&self.buffers.gpu, "resuming", 0, || {
            self.buffers.gpu.queue.write_buffer(control, at, &[0; 4])
        })
    }

    pub(super) fn reserve(&mut self, particles: u32) -> Result<(), Error> {
        let sizes = self.steps.sizes;
        // A failed growth may have released the detector's buffers.
        let bound = self.steps.are_bound_to(&self.detectors.reserve(sizes)?);
        match particles <= sizes.particles {
            true if bound => Ok(()),
            true => self.rebuild(sizes),
            false => self.rebuild(Sizes { particles: grow(particles), ..sizes }),
        }
    }

    pub(super) fn upload_capacities(&self) -> Result<(), Error> {
        let Sizes { particles, births, events, .. } = self.steps.sizes;
        let at = std::mem::offset_of!(ControlHeader, capacity) as u64;
        let control = self.buffers.buffer("control");
        let words = [particles, births, events, self.steps.sizes.speed_factor().to_bits()];
        with_error_scope(&self.buffers.gpu, "capacities", 0, || {
            self.buffers.gpu.queue.write_buffer(control, at, bytemuck::cast_slice(&words));
        })
    }

    /// Ends a step that began again with a higher top speed of collisions. Later steps must not depend on it, or a
    /// resumed run would differ.
    pub(super) fn reset_top_speed(&mut self) -> Result<(), Error> {
        if self.steps.sizes.speed_doublings == 0 {
            return Ok(());
        }
        self.steps.sizes.speed_doublings = 0;
        self.upload_capacities()
    }

    /// Keeps only the particles.
    pub(super) fn rebuild(&mut self, sizes: Sizes) -> Result<(), Error> {
        let found = self.detectors.reserve(sizes)?;
        let steps = StepDispatches::new(&mut self.buffers, sizes, self.options.rounds, found)?;
        let mut encoder = self.encoder();
        let alive = u64::from(self.alive);
        let halves = if sizes.has_velocity {
            [self.steps.sizes, sizes].map(|sizes| 16 * u64::from(sizes.particles))
        } else {
            [0; 2]
        };
        for (name, bytes, [from, to]) in
            [("spheres", 16, [0; 2]), ("spheres", 16, halves), ("tags", 8, [0; 2])]
        {
            let bytes = bytes * alive;
            if bytes > 0 {
                encoder.copy_buffer_to_buffer(self.steps.buffer(name), from, steps.buffer(name), to, bytes);
            }
        }
        with_error_scope(&self.buffers.gpu, "new sizes", 0, || {
            self.buffers.gpu.queue.submit([encoder.finish()])
        })?;
        self.steps = steps;
        self.upload_capacities()
    }
}
