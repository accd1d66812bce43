use std::time::Duration;

use lazygrid_kernels::{Algorithm, Sphere};

use super::measure::{compare_times, crossing, time};
use crate::Error;
use crate::gpu::config::GpuConfig;
use crate::gpu::costs::AdapterProfile;
use crate::gpu::device::GpuDevice;
use crate::gpu::plan::GpuPhase;
use crate::gpu::session::GpuSession;

const SIZES: [u32; 5] = [1 << 17, 1 << 18, 1 << 19, 1 << 20, 1 << 21];
const MAX_CROSSOVER: u32 = 2 * SIZES[SIZES.len() - 1];
const ROUNDS: usize = 3;
const MAX_SAMPLE_TIME: Duration = Duration::from_millis(50);

/// Returns the spheres at which the radix sort overtakes counting; at least the assumed number if counting always wins.
pub(super) fn radix_sort_from(gpu: &GpuDevice) -> Result<u32, Error> {
    let mut sessions = [session(gpu, u32::MAX)?, session(gpu, 0)?];
    let times = |scene: &[Sphere]| {
        let [counted, sorted] = &mut sessions;
        Ok([busy(counted, scene)?, busy(sorted, scene)?])
    };
    let continues = |spheres, least: [Duration; 2]| {
        log::debug!("{spheres} spheres by counting and by radix: {least:?}");
        least[0] <= MAX_SAMPLE_TIME
    };
    let samples = compare_times(&SIZES, 1, ROUNDS, times, continues)?;
    let assumed = AdapterProfile::assumed(&gpu.adapter).radix_sort_from;
    let counting_wins = samples.last().is_some_and(|(_, [counted, sorted])| counted < sorted);
    Ok(crossing(&samples, MAX_CROSSOVER).max(if counting_wins { assumed } else { 0 }))
}

fn session(gpu: &GpuDevice, radix_sort_from: u32) -> Result<GpuSession, Error> {
    let algorithm = Algorithm::CellList;
    let settings =
        GpuConfig::default().algorithm(algorithm).radix_sort_from(radix_sort_from).timestamps(true);
    GpuSession::new(gpu.clone(), settings)
}

/// Returns the device's busy time, because the upload may take longer; without timestamps, the wall time.
fn busy(session: &mut GpuSession, spheres: &[Sphere]) -> Result<Duration, Error> {
    let whole = time(session, spheres)?;
    let is_phase = |name: &str| GpuPhase::ALL.iter().any(|phase| phase.name() == name);
    let phases = session.timings().iter().filter(|timing| is_phase(timing.name));
    let busy: Duration = phases.map(|timing| timing.time).sum();
    Ok(if busy.is_zero() { whole } else { busy })
}
