use std::env;
use std::sync::LazyLock;

use lazygrid::gpu::{GpuDevice, SoftwareAdapter};
use lazygrid::{Algorithm, Backend, Config, Detector, Order, Pair, Simd, Sphere};
use lazygrid_check::{DetectorVariant, TargetDevice};
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::adapter::or_skip;
use crate::{TestInput, Tolerance, difference};

/// Numbers of threads: one, a few, and usually more than there are cores.
pub const THREADS: [usize; 3] = [1, 2, 7];

/// Returns all variants. `LAZYGRID_TEST_VARIANTS=cpu` or `=gpu` selects one backend, and `=gpu/cell-list` one
/// GPU algorithm.
///
/// # Panics
/// Panics if `LAZYGRID_TEST_VARIANTS` has another value, or a required GPU is missing.
pub fn all() -> Vec<DetectorVariant> {
    match env::var("LAZYGRID_TEST_VARIANTS").as_deref() {
        Err(_) => on_cpu().chain(on_gpu()).collect(),
        Ok("cpu") => on_cpu().collect(),
        Ok("gpu") => on_gpu(),
        Ok(other) => {
            let named = |algorithm: &Algorithm| other.strip_prefix("gpu/") == Some(algorithm.name());
            assert!(
                Algorithm::GPU.iter().any(named),
                "LAZYGRID_TEST_VARIANTS is {other}; choose cpu, gpu, or gpu/ and an algorithm"
            );
            on_gpu().into_iter().filter(|variant| named(&variant.algorithm)).collect()
        }
    }
}

fn on_cpu() -> impl Iterator<Item = DetectorVariant> {
    let simd = Simd::detect();
    let with = move |algorithm| {
        THREADS.map(|threads| {
            DetectorVariant::new(algorithm, TargetDevice::Cpu { simd, threads: Some(threads) })
        })
    };
    Algorithm::CPU.iter().copied().chain([Algorithm::Auto]).flat_map(with)
}

fn on_gpu() -> Vec<DetectorVariant> {
    let Some(gpu) = or_skip(GpuDevice::shared(SoftwareAdapter::Allow)) else { return Vec::new() };
    let target = TargetDevice::Gpu { subgroups: gpu.adapter.has_subgroups };
    Algorithm::GPU.iter().map(|&algorithm| DetectorVariant::new(algorithm, target)).collect()
}

/// Returns all CPU variants, and two GPU variants chosen by the scenario, as software adapters are slow.
/// Returns all variants if `LAZYGRID_TEST_VARIANTS` is set.
///
/// # Panics
/// See [`all`].
pub fn for_scenario(scenario: &TestInput) -> Vec<DetectorVariant> {
    let mut variants = all();
    if env::var_os("LAZYGRID_TEST_VARIANTS").is_none() {
        let gpus = Algorithm::GPU.len();
        let first = drawn(scenario) % gpus;
        let is_drawn = |at: usize| (at + gpus - first) % gpus < 2;
        let mut on_gpu = 0..;
        variants.retain(|variant| variant.backend() == Backend::Cpu || on_gpu.next().is_some_and(is_drawn));
    }
    variants
}

/// Returns each algorithm once, with the fewest threads.
pub fn each_algorithm() -> Vec<DetectorVariant> {
    all().into_iter().filter(|variant| variant.threads() == THREADS[0]).collect()
}

pub trait SuiteVariant: Copy {
    /// Returns the number of CPU threads, which on a GPU do the host's work.
    fn threads(self) -> usize;

    /// Sets no number of threads: detectors use the pool in which they [run](Self::run).
    fn settings(self) -> Config;

    fn run<T: Send>(self, work: impl FnOnce() -> T + Send) -> T {
        in_pool(self.threads(), work)
    }

    fn find(self, scenario: &TestInput, settings: Config) -> Result<Vec<Pair>, String>;

    /// Returns the reference for other results: the `expected` pairs, or if tangent pairs may differ the
    /// variant's own list after a comparison.
    fn own_pairs(self, scenario: &TestInput, expected: &[Pair]) -> Result<Vec<Pair>, String>;

    /// Checks both orders; GPU variants need one, as only the host sorts pairs.
    fn verify(self, scenario: &TestInput, expected: &[Pair], settings: &Config) -> Result<(), String>;
}

impl SuiteVariant for DetectorVariant {
    fn threads(self) -> usize {
        match self.target {
            TargetDevice::Cpu { threads, .. } => threads.unwrap_or(THREADS[0]),
            TargetDevice::Gpu { .. } => THREADS[0],
        }
    }

    fn settings(self) -> Config {
        Config::default().backend(self.backend()).algorithm(self.algorithm)
    }

    fn find(self, scenario: &TestInput, settings: Config) -> Result<Vec<Pair>, String> {
        let config = scenario.config(settings).map_err(|e| e.to_string())?;
        let config = config.backend(self.backend()).algorithm(self.algorithm);
        self.run(|| {
            let mut detector = Detector::new(config).map_err(|e| e.to_string())?;
            detector.pairs(scenario.query()).map_err(|e| e.to_string())?;
            Ok(detector.into_pairs())
        })
    }

    fn own_pairs(self, scenario: &TestInput, expected: &[Pair]) -> Result<Vec<Pair>, String> {
        if self.tolerance() == Tolerance::Exact {
            return Ok(expected.to_vec());
        }
        let found = self.find(scenario, Config::default())?;
        difference(scenario, &found, expected, self.tolerance()).map_err(|text| format!("{self}: {text}"))?;
        Ok(found)
    }

    fn verify(self, scenario: &TestInput, expected: &[Pair], settings: &Config) -> Result<(), String> {
        let orders = [Order::Canonical, Order::Unordered];
        let orders = match self.backend() {
            Backend::Gpu => &orders[drawn(scenario) / Algorithm::GPU.len() % 2..][..1],
            _ => &orders[..],
        };
        for &order in orders {
            let complain = |text: String| format!("{self}, {order:?}: {text}");
            let found = self.find(scenario, settings.clone().order(order)).map_err(complain)?;
            difference(scenario, &found, expected, self.tolerance()).map_err(complain)?;
            if order == Order::Canonical && !found.is_sorted() {
                return Err(complain("the pairs are not in canonical order".to_owned()));
            }
        }
        Ok(())
    }
}

fn drawn(scenario: &TestInput) -> usize {
    let word = |hash: u32, bits: u32| (hash.rotate_left(5) ^ bits).wrapping_mul(0x9e37_79b9);
    let hash = |hash, sphere: &Sphere| word(word(hash, sphere.center.x.to_bits()), sphere.radius.to_bits());
    (scenario.spheres.iter().fold(1, hash) >> 16) as usize
}

/// Runs `work` in a shared pool: creating one takes longer than most scenarios.
///
/// # Panics
/// Panics if `threads` is not one of [`THREADS`].
pub fn in_pool<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    static POOLS: LazyLock<[ThreadPool; 3]> = LazyLock::new(|| {
        THREADS.map(|n| ThreadPoolBuilder::new().num_threads(n).build().expect("threads of the system"))
    });
    let pool = THREADS.iter().position(|&n| n == threads).expect("one of THREADS");
    POOLS[pool].install(work)
}
