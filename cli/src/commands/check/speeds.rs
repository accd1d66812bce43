use std::time::Instant;

use lazygrid::{Algorithm, Backend, Sphere};
use lazygrid_check::detectors::compare::FailedCase;
use lazygrid_check::kernels::KernelError;
use lazygrid_check::timing::bandwidth::{GpuTimer, Measured};
use lazygrid_check::timing::speed::{self, FULL, SkipReason, Speed, forecast};
use lazygrid_check::{Effort, Gpu, catch_panic};
use lazygrid_io::scenes::Scene;

use super::report::{Primitive, Report, TimingLabel};
use super::{CheckContext, SPEEDS};

/// Seconds for one call and for a backend's calls, and the factor of `--full`.
const CALL: f64 = 2.5;
const ALL: f64 = 25.0;
const FULL_TIMES: f64 = 12.0;

const ROUNDS: usize = 7;

/// Times the CPU first, because the GPU's counts are compared with the CPU's.
pub(super) fn run(context: &CheckContext<'_>, report: &mut Report) {
    let scenes: &[Scene] = match context.args.effort() {
        Effort::Full => &[Scene::FiveSizes, Scene::Equal, Scene::Burst],
        _ => &[Scene::FiveSizes],
    };
    if context.on_cpu {
        BackendTimings::new(context, Backend::Cpu, &speed::on_cpu).run(scenes, Algorithm::CPU, report);
    }
    if let Some(gpu) = &context.gpu {
        primitives(context, gpu, report);
        let time = |algorithm, spheres: &[Sphere]| speed::on_gpu(&gpu.device, algorithm, spheres);
        BackendTimings::new(context, Backend::Gpu, &time).run(scenes, Algorithm::GPU, report);
    }
}

fn primitives(context: &CheckContext<'_>, gpu: &Gpu, report: &mut Report) {
    context.bar.set_message("speeds: copy, scan and sort");
    let watch = GpuTimer::new(gpu.device.clone(), ROUNDS);
    let measured = catch_panic(|| {
        let watch = watch.map_err(|error| error.to_string())?;
        let text = |fault: KernelError| fault.to_string();
        let mut rows = Vec::new();
        let mut seconds = 0.0;
        let sizes: &[u32] = if context.args.quick { &[100_000] } else { &[1_000_000, 10_000_000] };
        for &values in sizes {
            // The next size is ten times as large.
            if seconds * 10.0 * (ROUNDS + 1) as f64 > 4.0 * CALL {
                break;
            }
            let copy = watch.copy(values).map_err(text)?;
            let bandwidth = copy.bandwidth();
            let row = |what: &str, measured: Measured| Primitive {
                what: what.to_owned(),
                values,
                seconds: measured.median(),
                bandwidth: measured.bandwidth(),
                of_copy: measured.bandwidth() / bandwidth,
            };
            rows.push(row("copy", copy));
            rows.push(row("scan", watch.scan(values, true).map_err(text)?));
            rows.push(row("sort, 24 bits", watch.sort(values, 24, true).map_err(text)?));
            seconds = rows[rows.len() - 1].seconds;
        }
        Ok((watch.has_gpu_timestamps(), rows))
    });
    match measured {
        Ok((has_gpu_clock, rows)) => context.suspend_bar(|| report.primitives(has_gpu_clock, rows)),
        Err(what) => {
            let name = "copy, scan and sort by the clock".to_owned();
            context.suspend_bar(|| report.failure(FailedCase { name, what, ..FailedCase::default() }))
        }
    }
}

type Time<'a> = &'a dyn Fn(Algorithm, &[Sphere]) -> Result<Speed, SkipReason>;

struct BackendTimings<'a> {
    context: &'a CheckContext<'a>,
    backend: Backend,
    time: Time<'a>,
    from: u64,
    spent: f64,
}

struct AlgorithmTimes {
    algorithm: Algorithm,
    times: Vec<(usize, f64)>,
    /// `true` after a skipped call.
    is_out: bool,
}

impl<'a> BackendTimings<'a> {
    fn new(context: &'a CheckContext<'a>, backend: Backend, time: Time<'a>) -> Self {
        Self { context, backend, time, from: context.bar.position(), spent: 0.0 }
    }

    fn run(mut self, scenes: &[Scene], algorithms: &[Algorithm], report: &mut Report) {
        self.context.suspend_bar(|| report.speeds_of(self.backend));
        let mut sizes = speed::SIZES.to_vec();
        match self.context.args.effort() {
            Effort::Quick => sizes.truncate(1),
            Effort::Default => {}
            Effort::Full => sizes.push(FULL),
        }
        let mut done = 0;
        for &scene in scenes {
            let untimed = |&algorithm: &Algorithm| AlgorithmTimes { algorithm, times: vec![], is_out: false };
            let mut all_times: Vec<AlgorithmTimes> = algorithms.iter().map(untimed).collect();
            for &n in &sizes {
                let what = format!("speeds of {}: {n} spheres, {scene}", self.backend);
                self.context.step(self.from, SPEEDS, [done, sizes.len() * scenes.len()], &what);
                done += 1;
                let mut spheres = Vec::new();
                for algorithm_times in &mut all_times {
                    let label = TimingLabel {
                        backend: self.backend,
                        algorithm: algorithm_times.algorithm,
                        scene,
                        spheres: n,
                    };
                    self.call(algorithm_times, label, &mut spheres, report);
                }
            }
        }
        self.context.bar.set_position(self.from + SPEEDS);
    }

    fn call(
        &mut self,
        algorithm_times: &mut AlgorithmTimes,
        label: TimingLabel,
        spheres: &mut Vec<Sphere>,
        report: &mut Report,
    ) {
        let TimingLabel { algorithm, scene, spheres: n, .. } = label;
        if algorithm_times.is_out {
            return;
        }
        if let Some(why) = self.too_long(forecast(algorithm, &algorithm_times.times, n)) {
            algorithm_times.is_out = true;
            return self.context.suspend_bar(|| report.left_out(label, &why));
        }
        if spheres.is_empty() {
            // The scene draws all radii first.
            let needed = n * (size_of::<Sphere>() + size_of::<f32>());
            if let Err(why) = speed::check_memory(needed as u64) {
                algorithm_times.is_out = true;
                return self.context.suspend_bar(|| report.left_out(label, &why));
            }
            *spheres = scene.spheres(n, 0);
        }
        let start = Instant::now();
        let speed = (self.time)(algorithm, spheres);
        self.spent += start.elapsed().as_secs_f64();
        match speed {
            Ok(speed) => {
                algorithm_times.times.push((n, speed.seconds));
                self.context.suspend_bar(|| report.speed(label, &speed))
            }
            // An algorithm that never runs is a failure.
            Err(SkipReason::TooLarge(what)) if n > speed::SIZES[0] => {
                algorithm_times.is_out = true;
                self.context.suspend_bar(|| report.left_out(label, &what))
            }
            Err(SkipReason::TooLarge(what) | SkipReason::Failed(what)) => {
                algorithm_times.is_out = true;
                let name = format!("{algorithm} on {}, {n} spheres, {scene}", self.backend);
                let fault = FailedCase { name, what, ..FailedCase::default() };
                self.context.suspend_bar(|| report.failure(fault))
            }
        }
    }

    fn too_long(&self, seconds: f64) -> Option<String> {
        let times = if self.context.args.full { FULL_TIMES } else { 1.0 };
        let remedy = if self.context.args.full { "" } else { "; --full gives more time" };
        if seconds > CALL * times {
            return Some(format!("about {seconds:.0} s a call{remedy}"));
        }
        (self.spent + 2.0 * seconds > ALL * times).then(|| format!("no time left{remedy}"))
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;
    use crate::args::{Args, Command};
    use crate::progress;

    #[test]
    fn memory_refused_at_the_smallest_size_is_a_failure() {
        let args = Args::try_parse_from(["lazygrid", "check", "--json", "--backend", "cpu"]).unwrap();
        let Command::Check(args) = args.command else { panic!("another command") };
        let context = CheckContext { args: &args, gpu: None, on_cpu: true, bar: progress::working(1) };
        let failures = |refused_from: usize| {
            let mut report = Report::new(&args, None, None);
            let time = |_: Algorithm, spheres: &[Sphere]| match spheres.len() >= refused_from {
                true => Err(SkipReason::TooLarge("no memory".to_owned())),
                false => speed::on_cpu(Algorithm::CellList, spheres),
            };
            BackendTimings::new(&context, Backend::Cpu, &time).run(
                &[Scene::FiveSizes],
                &[Algorithm::CellList],
                &mut report,
            );
            report.finish().is_err()
        };
        assert!(failures(0));
        assert!(!failures(speed::SIZES[0] + 1));
    }
}
