//! A run that cannot fit the memory is refused, or stops with a checkpoint.

use std::ops::Range;

#[cfg(feature = "gpu")]
use lazygrid_io::memory_of_driver;
use lazygrid_ranks::Communicator;

#[cfg(feature = "gpu")]
use crate::memory::check_address_space;
use crate::memory::check_available;
use crate::model::transmitter::{Schedule, Transmitter};
use crate::{Error, Model};

/// Estimated, not measured: columns, displaced copies, the detector's index, a snapshot for the checkpoint.
const BYTES_PER_PARTICLE: u64 = 260;
/// Columns of the particles, the release and the detector.
const MIN_BYTES_PER_PARTICLE: u64 = 100;
const OVERHEAD: u64 = 64 << 20;
/// Particles between checks.
const MIN_GROWTH: u64 = 50_000;

/// Simultaneous runs, and machines over which the ranks of each run divide its particles.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sharing {
    pub(crate) runs: u32,
    pub(crate) machines: u32,
}

impl Sharing {
    pub(crate) const NONE: Self = Self { runs: 1, machines: 1 };

    pub(crate) fn over_ranks(communicator: &impl Communicator) -> Self {
        Self { runs: 1, machines: communicator.ranks() / communicator.ranks_on_machine().max(1) }
    }

    fn bytes(self, particles: u64, of_each: u64) -> u64 {
        particles.saturating_mul(of_each).saturating_mul(self.runs.into()) / u64::from(self.machines.max(1))
    }
}

pub(crate) fn check_largest_release(model: &Model, steps: u32, sharing: Sharing) -> Result<(), Error> {
    let particles = largest_release(model, steps);
    if particles < MIN_GROWTH {
        return Ok(());
    }
    check_particles(particles, sharing.bytes(particles, MIN_BYTES_PER_PARTICLE))
}

/// Returns the first release, which precedes all checks, or a later burst or step if larger.
fn largest_release(model: &Model, steps: u32) -> u64 {
    let mean = |transmitter: &Transmitter, window| -> f64 {
        transmitter.mean_between(window, model.time_step).iter().map(|&(_, count)| count).sum()
    };
    let largest = |transmitter: &Transmitter| {
        let burst: f64 = match &transmitter.schedule {
            Schedule::Steady { rates, .. } => rates.iter().map(|&(_, rate)| rate * model.time_step).sum(),
            _ => transmitter.release.iter().map(|&(_, count)| f64::from(count)).sum(),
        };
        burst.min(mean(transmitter, [0, steps.saturating_add(1)]))
    };
    let at_begin: f64 = model.transmitters.iter().map(|transmitter| mean(transmitter, [0, 1])).sum();
    model.transmitters.iter().map(largest).fold(at_begin, f64::max) as u64
}

#[derive(Debug, Default)]
pub(crate) struct MemoryGuard {
    /// Particles for which memory is enough.
    checked: u64,
}

impl MemoryGuard {
    pub(crate) fn check(
        &mut self,
        model: &Model,
        present: u64,
        steps: Range<u32>,
        sharing: Sharing,
    ) -> Result<(), Error> {
        let window = [steps.start, steps.end].map(|step| step.saturating_add(1));
        let released: f64 = model
            .transmitters
            .iter()
            .flat_map(|transmitter| transmitter.mean_between(window, model.time_step))
            .map(|(_, count)| count)
            .sum();
        let particles = present.saturating_add(released as u64);
        let more = particles.saturating_sub(self.checked);
        if more >= MIN_GROWTH {
            check_particles(particles, sharing.bytes(more, BYTES_PER_PARTICLE))?;
            self.checked = particles;
        }
        Ok(())
    }
}

/// Refuses a GPU run if memory is short, because a software driver would end the process.
#[cfg(feature = "gpu")]
pub(crate) fn check_memory_on_gpu(particles: u64, processes: u32, is_loaded: bool) -> Result<(), Error> {
    let driver = if is_loaded { 0 } else { memory_of_driver() };
    let (what, remedy) = ("runs on a GPU", "use the CPU, or raise the limit");
    let particles = Sharing::NONE.bytes(particles, MIN_BYTES_PER_PARTICLE);
    check_address_space(what, driver.saturating_add(particles), remedy)?;
    check_available(what, particles.saturating_mul(processes.into()), remedy)
}

fn check_particles(particles: u64, needed: u64) -> Result<(), Error> {
    let remedy = "release fewer particles, run fewer replicas at once (--threads), or raise the limit";
    check_available(&format!("{particles} particles"), needed.saturating_add(OVERHEAD), remedy)
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;
    use std::path::Path;

    use lazygrid_io::available_memory;

    use super::*;
    use crate::RunView;
    use crate::run::Run;
    use crate::scenario::Scenario;

    #[test]
    fn largest_release_is_a_burst_or_a_step() {
        let bursts = Transmitter {
            release: vec![(0, 300), (1, 20)],
            schedule: Schedule::Times(vec![0.0, 1.0]),
            ..Transmitter::default()
        };
        let steady = Schedule::Steady { from: 0.0, until: 10.0, rates: vec![(0, 5000.0)] };
        let steady = Transmitter { schedule: steady, ..Transmitter::default() };
        let model =
            |transmitter| Model { transmitters: vec![transmitter], time_step: 0.1, ..Model::default() };
        assert_eq!(largest_release(&model(bursts.clone()), 100), 320);
        assert_eq!(largest_release(&model(steady), 100), 500);
        let late = Transmitter { schedule: Schedule::Times(vec![1000.0]), ..bursts };
        assert_eq!(largest_release(&model(late), 100), 0);
    }

    #[test]
    fn run_that_cannot_fit_is_refused() {
        let huge = |time| {
            let release = vec![(0, u32::MAX); 4096];
            let schedule = Schedule::Times(vec![time]);
            let transmitter = Transmitter { release, schedule, ..Transmitter::default() };
            Model { transmitters: vec![transmitter], time_step: 0.1, ..Model::default() }
        };
        if available_memory().is_some() {
            let error = check_largest_release(&huge(0.0), 10, Sharing::NONE).unwrap_err().to_string();
            assert!(error.contains("bytes") && error.contains("release fewer"), "{error}");
            assert!(MemoryGuard::default().check(&huge(0.3), 0, 0..5, Sharing::NONE).is_err());
            assert!(MemoryGuard::default().check(&huge(0.0), 0, 0..5, Sharing::NONE).is_ok());
        }
        let none = Model { time_step: 0.1, ..Model::default() };
        assert!(check_largest_release(&none, 10, Sharing::NONE).is_ok());
        assert!(MemoryGuard::default().check(&none, 1000, 0..5, Sharing::NONE).is_ok());
    }

    /// 1000 particles in each of 10⁹ steps, which live for a step.
    #[test]
    fn steady_run_needs_the_memory_of_the_next_steps() {
        let text = "time-step = 1e-6\nsteps = 1000000000\n[[species]]\nname = 'A'\n\
                    [[decay]]\nequation = 'A ->'\nrate = 1e6\n\
                    [[transmitter]]\nname = 'tx'\nrelease = [{ species = 'A', rate = 1e9 }]\n\
                    [output]\nevery = 1000000000\n";
        let directory = tempfile::tempdir().unwrap();
        let scenario = Scenario::parse(Path::new("s.toml"), text.to_owned()).unwrap();
        let run = Run::new(scenario, "s.toml", directory.path().join("out"));
        let mut calls = 0;
        let (_, simulation) = run
            .run(|_| {
                calls += 1;
                if calls < 20 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
            })
            .unwrap();
        // The steady state is the release per lifetime.
        let present = simulation.totals().present[0] as f64;
        assert!((present - 1000.0).abs() < 4.0 * 1000.0_f64.sqrt(), "{present}");
    }

    #[test]
    fn all_transmitters_release_at_once() {
        let burst = Transmitter { release: vec![(0, 20_000_000)], ..Transmitter::default() };
        let model = Model { transmitters: vec![burst; 10], time_step: 0.1, ..Model::default() };
        for steps in [0, 100] {
            assert_eq!(largest_release(&model, steps), 200_000_000);
        }
    }
}
