mod report;
mod speeds;

use std::time::{Instant, SystemTime};

use indicatif::ProgressBar;
use lazygrid::Error;
use lazygrid::gpu::{GpuDevice, SoftwareAdapter};
use lazygrid_check::detectors::compare::{self, FailedCase, Pace, SceneCase};
use lazygrid_check::detectors::sequence::{Sequence, Tally};
use lazygrid_check::kernels::CHECKS;
use lazygrid_check::{DetectorVariant, Gpu, catch_panic};
use lazygrid_io::memory_of_driver_threads;

use self::report::Report;
use crate::args::{Check, Checked};
use crate::commands::check_memory;
use crate::error::CliError;
use crate::progress;

/// Weights in the progress bar: about seconds on a slow machine.
const KERNELS: u64 = 20;
const SCENES: u64 = 40;
const SPEEDS: u64 = 60;

/// Slower scenes are skipped; `--full` multiplies the limit by 20.
const SCENE_SECONDS: f64 = 0.2;

/// Bytes of the scenes, and of the smallest timed calls; larger ones are skipped if memory is short.
const CPU_BYTES: u64 = 64 << 20;
const FULL_CPU_BYTES: u64 = 1 << 30;
/// Bytes that a software driver maps (llvmpipe). It ends the process if memory is refused to it.
const GPU_BYTES: u64 = 700 << 20;

/// Attempts to shrink a failing case.
const MAX_SHRINK_ATTEMPTS: usize = 1500;

/// Failing rounds that end the fuzzer.
const MAX_WRONG_ROUNDS: usize = 10;

pub(crate) fn run(args: &Check) -> Result<(), CliError> {
    check_memory("the check", cpu_bytes(args))?;
    let gpu = open(args)?;
    let (gpu, skipped) = match gpu {
        Ok(gpu) => (gpu, None),
        Err(reason) => (None, Some(reason)),
    };
    let on_cpu = args.backend != Checked::Gpu;
    // Caught panics are reported as failures.
    std::panic::set_hook(Box::new(|panic| log::info!("{panic}")));
    let backends = u64::from(on_cpu) + u64::from(gpu.is_some());
    let fuzz = args.fuzz.map_or(0, |time| time.as_secs());
    let weight = match args.seed {
        Some(_) => 1,
        None => gpu.as_ref().map_or(0, |_| KERNELS) + backends * (SCENES + SPEEDS) + fuzz,
    };
    let context = CheckContext { args, gpu, on_cpu, bar: progress::working(weight) };
    let mut report = Report::new(args, context.gpu.as_ref(), skipped);
    let result = catch_panic(|| {
        match args.seed {
            Some(seed) => context.repeat(seed, &mut report),
            None => context.all(&mut report),
        }
        Ok(())
    });
    context.bar.finish_and_clear();
    if let Err(what) = result {
        let name = "the check itself".to_owned();
        report.failure(FailedCase { name, what, ..FailedCase::default() });
    }
    report.finish()
}

fn cpu_bytes(args: &Check) -> u64 {
    if args.full { FULL_CPU_BYTES } else { CPU_BYTES }
}

fn open(args: &Check) -> Result<Result<Option<Gpu>, String>, CliError> {
    if args.backend == Checked::Cpu {
        return match &args.adapter {
            Some(adapter) => {
                Err(CliError::Setting(lazygrid::Error::AdapterOnCpu { adapter: adapter.to_string() }))
            }
            None => Ok(Ok(None)),
        };
    }
    let enough = check_memory("the check of a GPU", cpu_bytes(args) + GPU_BYTES + memory_of_driver_threads());
    match enough {
        Err(lacking) if args.backend == Checked::All && args.adapter.is_none() => {
            return Ok(Err(lacking.to_string()));
        }
        enough => enough?,
    }
    let gpu = match &args.adapter {
        Some(adapter) => GpuDevice::shared_adapter(adapter),
        None => GpuDevice::shared(SoftwareAdapter::Allow),
    };
    match gpu {
        Ok(device) => Ok(Ok(Some(Gpu { device, adapter: args.adapter.clone() }))),
        Err(error @ Error::NoAdapter { .. }) if args.backend == Checked::All && args.adapter.is_none() => {
            Ok(Err(error.to_string()))
        }
        Err(error) => Err(CliError::Setting(lazygrid::Error::GpuUnavailable { reason: error.to_string() })),
    }
}

struct VariantResult<'a> {
    variant: &'a DetectorVariant,
    pace: Pace,
    left_out: usize,
    not_taken: usize,
    wrong: usize,
    smallest: Option<(&'a SceneCase, String)>,
}

impl<'a> VariantResult<'a> {
    fn new(variant: &'a DetectorVariant) -> Self {
        Self { variant, pace: Pace::default(), left_out: 0, not_taken: 0, wrong: 0, smallest: None }
    }

    fn note(&mut self, case: &'a SceneCase, fault: Option<String>) {
        let Some(what) = fault else { return };
        self.wrong += 1;
        let spheres = |case: &SceneCase| case.scenario.spheres.len();
        if self.smallest.as_ref().is_none_or(|(other, _)| spheres(case) < spheres(other)) {
            self.smallest = Some((case, what));
        }
    }
}

fn by_algorithm(
    results: &[VariantResult<'_>],
    scenes: fn(&VariantResult<'_>) -> usize,
) -> Vec<(String, usize)> {
    let mut sums: Vec<(String, usize)> = Vec::new();
    for (variant, scenes) in results.iter().map(|result| (result.variant, scenes(result))) {
        let name = format!("{} on {}", variant.algorithm, variant.backend());
        match sums.iter_mut().find(|(other, _)| *other == name) {
            _ if scenes == 0 => {}
            Some((_, sum)) => *sum += scenes,
            None => sums.push((name, scenes)),
        }
    }
    sums
}

struct CheckContext<'a> {
    args: &'a Check,
    gpu: Option<Gpu>,
    on_cpu: bool,
    bar: ProgressBar,
}

impl CheckContext<'_> {
    fn all(&self, report: &mut Report) {
        if let Some(gpu) = &self.gpu {
            self.kernels(gpu, report);
        }
        self.scenes(report);
        speeds::run(self, report);
        self.fuzz(report)
    }

    fn step(&self, from: u64, weight: u64, [done, all]: [usize; 2], what: &str) {
        self.bar.set_position(from + weight * done as u64 / all.max(1) as u64);
        self.bar.set_message(what.to_owned());
    }

    fn kernels(&self, gpu: &Gpu, report: &mut Report) {
        let (from, start) = (self.bar.position(), Instant::now());
        for (k, check) in CHECKS.iter().enumerate() {
            self.step(from, KERNELS, [k, CHECKS.len()], &format!("kernels: {}", check.name));
            let checked = catch_panic(|| {
                (check.run)(&gpu.device, self.args.effort()).map_err(|fault| fault.to_string())
            });
            if let Err(what) = checked {
                let name = format!("{} ({})", check.name, check.kernels.join(", "));
                self.suspend_bar(|| report.failure(FailedCase { name, what, ..FailedCase::default() }));
            }
        }
        let kernels = CHECKS.iter().map(|check| check.kernels.len()).sum();
        self.bar.set_position(from + KERNELS);
        self.suspend_bar(|| report.kernels(kernels, start.elapsed()));
    }

    fn scenes(&self, report: &mut Report) {
        let (from, start) = (self.bar.position(), Instant::now());
        let cases = compare::cases(self.args.effort());
        let on_gpu = self
            .gpu
            .as_ref()
            .map_or_else(Vec::new, |gpu| DetectorVariant::on_gpu(&gpu.device, self.args.effort()));
        let on_cpu = if self.on_cpu { DetectorVariant::on_cpu() } else { Vec::new() };
        let backends = u64::from(!on_gpu.is_empty()) + u64::from(self.on_cpu);
        let most = if self.args.full { SCENE_SECONDS * 20.0 } else { SCENE_SECONDS };
        let mut results: Vec<VariantResult<'_>> =
            on_gpu.iter().chain(&on_cpu).map(VariantResult::new).collect();
        for (k, case) in cases.iter().enumerate() {
            self.step(from, backends * SCENES, [k, cases.len()], &format!("scenes: {}", case.name));
            let expected = match compare::expected(&case.scenario) {
                Ok(expected) => expected,
                Err(what) => {
                    let (name, scenario) = (format!("{}: reference", case.name), Some(case.scenario.clone()));
                    self.suspend_bar(|| {
                        report.failure(FailedCase { name, what, scenario, ..FailedCase::default() })
                    });
                    continue;
                }
            };
            let spheres = case.scenario.spheres.len();
            for result in &mut results {
                if !result.variant.takes(self.gpu.as_ref(), &case.scenario) {
                    result.not_taken += 1;
                    continue;
                }
                if result.pace.forecast(result.variant, spheres) > most {
                    result.left_out += 1;
                    continue;
                }
                let start = Instant::now();
                let fault = case.fault(result.variant, self.gpu.as_ref(), &expected);
                result.pace.saw(result.variant, spheres, start.elapsed().as_secs_f64());
                result.note(case, fault);
            }
        }
        let [left_out, not_taken] =
            [|result: &VariantResult<'_>| result.left_out, |result: &VariantResult<'_>| result.not_taken]
                .map(|scenes| by_algorithm(&results, scenes));
        for VariantResult { variant, wrong, smallest, .. } in results {
            if let Some((case, what)) = smallest {
                self.bar.set_message(format!("making small: {}", case.name));
                let mut fault = case.failure(variant, self.gpu.as_ref(), what, MAX_SHRINK_ATTEMPTS);
                fault.what += &format!("; wrong in {wrong} of {} scenes, this was the smallest", cases.len());
                self.suspend_bar(|| report.failure(fault));
            }
        }
        self.bar.set_position(from + backends * SCENES);
        let skipped = [&left_out[..], &not_taken];
        self.suspend_bar(|| {
            report.scenes([cases.len(), on_gpu.len(), on_cpu.len()], skipped, start.elapsed())
        });
    }

    fn fuzz(&self, report: &mut Report) {
        let Some(time) = self.args.fuzz else { return };
        let (from, start) = (self.bar.position(), Instant::now());
        let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        let first = u64::from(since.subsec_nanos()) * 1000;
        let (mut rounds, mut wrong, mut tally) = (0, 0, Tally::default());
        while start.elapsed() < time && wrong < MAX_WRONG_ROUNDS {
            self.bar.set_position(from + start.elapsed().as_secs());
            self.bar.set_message(format!("fuzz: {rounds} rounds"));
            wrong += self.round(first + rounds, &mut tally, report);
            rounds += 1;
        }
        self.suspend_bar(|| report.fuzz(first, rounds, &tally, start.elapsed()));
    }

    fn round(&self, seed: u64, tally: &mut Tally, report: &mut Report) -> usize {
        let (gpu, has_gpu) = (self.gpu.as_ref(), self.gpu.is_some());
        let round = Sequence::round(seed, self.on_cpu, has_gpu).check(
            gpu,
            MAX_SHRINK_ATTEMPTS,
            &mut Tally::default(),
        );
        let sequence = Sequence::drawn(seed, self.on_cpu, has_gpu).check(gpu, MAX_SHRINK_ATTEMPTS, tally);
        let faults: Vec<_> = round.into_iter().chain(sequence).collect();
        let wrong = faults.len();
        faults.into_iter().for_each(|fault| self.suspend_bar(|| report.failure(fault)));
        wrong
    }

    fn repeat(&self, seed: u64, report: &mut Report) {
        let (start, mut tally) = (Instant::now(), Tally::default());
        self.round(seed, &mut tally, report);
        self.suspend_bar(|| report.fuzz(seed, 1, &tally, start.elapsed()));
    }

    fn suspend_bar(&self, say: impl FnOnce()) {
        self.bar.suspend(say);
    }
}
