use std::env;
use std::fmt;
use std::sync::LazyLock;

use lazygrid::{Algorithm, Backend, Config, Detector, Order, Pair, Sphere};
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::{TestInput, Tolerance, difference};

/// The numbers of threads of the CPU variants: one, a few, and usually more than cores.
pub const THREADS: [usize; 3] = [1, 2, 7];

/// A detector variant. The suite runs all scenarios with all variants.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Subject {
    /// The backend.
    pub backend: Backend,
    /// The algorithm.
    pub algorithm: Algorithm,
    /// The number of threads on the CPU.
    pub threads: usize,
}

impl Subject {
    /// All variants. A new backend is added here. `LAZYGRID_SUBJECTS=cpu` or `=gpu` selects the variants of one
    /// backend: changing a GPU driver or its settings does not affect the CPU. `LAZYGRID_SUBJECTS=gpu/cell-list`
    /// selects one GPU algorithm.
    ///
    /// # Panics
    /// Panics if `LAZYGRID_SUBJECTS` has another value, or if a required GPU is missing.
    pub fn all() -> Vec<Self> {
        let cpu = |algorithm| THREADS.map(|threads| Self { backend: Backend::Cpu, algorithm, threads });
        let on_cpu = Algorithm::CPU.iter().copied().chain([Algorithm::Auto]).flat_map(cpu);
        match env::var("LAZYGRID_SUBJECTS").as_deref() {
            Err(_) => on_cpu.chain(crate::gpu::subjects()).collect(),
            Ok("cpu") => on_cpu.collect(),
            Ok("gpu") => crate::gpu::subjects(),
            Ok(other) => {
                let named = |algorithm: &Algorithm| other.strip_prefix("gpu/") == Some(algorithm.name());
                assert!(
                    Algorithm::GPU.iter().any(named),
                    "LAZYGRID_SUBJECTS is {other}; choose cpu, gpu, or gpu/ and an algorithm"
                );
                crate::gpu::subjects().into_iter().filter(|subject| named(&subject.algorithm)).collect()
            }
        }
    }

    /// The variants for one of many scenarios: all CPU variants, and two GPU variants chosen by the scenario. A
    /// property with many cases thus covers each GPU variant, which is slow on a software adapter. All variants if
    /// `LAZYGRID_SUBJECTS` is set.
    ///
    /// # Panics
    /// Panics like [`all`](Self::all).
    pub fn in_turn(scenario: &TestInput) -> Vec<Self> {
        let mut subjects = Self::all();
        if env::var_os("LAZYGRID_SUBJECTS").is_none() {
            let gpus = Algorithm::GPU.len();
            let first = drawn(scenario) % gpus;
            let is_drawn = |at: usize| (at + gpus - first) % gpus < 2;
            let mut on_gpu = 0..;
            subjects.retain(|subject| subject.backend == Backend::Cpu || on_gpu.next().is_some_and(is_drawn));
        }
        subjects
    }

    /// The variants with the fewest threads: one for each backend and algorithm.
    pub fn each_algorithm() -> Vec<Self> {
        Self::all().into_iter().filter(|subject| subject.threads == THREADS[0]).collect()
    }

    /// The settings of this variant.
    pub fn config(self) -> Config {
        Config::default().backend(self.backend).algorithm(self.algorithm)
    }

    /// The deviation from the definition that results may have.
    pub fn tolerance(self) -> Tolerance {
        match self.backend {
            Backend::Cpu => Tolerance::Exact,
            _ => Tolerance::Tangent,
        }
    }

    /// Runs `work` with this variant's number of threads.
    pub fn run<T: Send>(self, work: impl FnOnce() -> T + Send) -> T {
        in_pool(self.threads, work)
    }

    /// Finds the pairs with a new detector of these settings.
    ///
    /// # Errors
    /// Returns the library's error as text.
    pub fn pairs(self, scenario: &TestInput, settings: Config) -> Result<Vec<Pair>, String> {
        let config = scenario.config(settings).map_err(|e| e.to_string())?;
        let config = config.backend(self.backend).algorithm(self.algorithm);
        self.run(|| {
            let mut detector = Detector::new(config).map_err(|e| e.to_string())?;
            detector.pairs(scenario.query()).map_err(|e| e.to_string())?;
            Ok(detector.into_pairs())
        })
    }

    /// The reference for this variant's other results: the `expected` pairs if it is exact. Otherwise its own list,
    /// compared with them, as tangent pairs may be found or missed.
    ///
    /// # Errors
    /// Describes the first difference of its list, or its error.
    pub fn own_pairs(self, scenario: &TestInput, expected: &[Pair]) -> Result<Vec<Pair>, String> {
        if self.tolerance() == Tolerance::Exact {
            return Ok(expected.to_vec());
        }
        let found = self.pairs(scenario, Config::default())?;
        difference(scenario, &found, expected, self.tolerance()).map_err(|text| format!("{self}: {text}"))?;
        Ok(found)
    }

    /// Checks this variant on a scenario with known pairs, in both orders. GPU variants use one of the orders, as only
    /// the host sorts pairs.
    ///
    /// # Errors
    /// Describes the first difference, or the error.
    pub fn judge(self, scenario: &TestInput, expected: &[Pair], settings: &Config) -> Result<(), String> {
        let orders = [Order::Canonical, Order::Unordered];
        let orders = match self.backend {
            Backend::Gpu => &orders[drawn(scenario) / Algorithm::GPU.len() % 2..][..1],
            _ => &orders[..],
        };
        for &order in orders {
            let complain = |text: String| format!("{self}, {order:?}: {text}");
            let found = self.pairs(scenario, settings.clone().order(order)).map_err(complain)?;
            difference(scenario, &found, expected, self.tolerance()).map_err(complain)?;
            if order == Order::Canonical && !found.is_sorted() {
                return Err(complain("the pairs are not in canonical order".to_owned()));
            }
        }
        Ok(())
    }
}

/// A number derived from the scenario's spheres.
fn drawn(scenario: &TestInput) -> usize {
    let word = |hash: u32, bits: u32| (hash.rotate_left(5) ^ bits).wrapping_mul(0x9e37_79b9);
    let hash = |hash, sphere: &Sphere| word(word(hash, sphere.center.x.to_bits()), sphere.radius.to_bits());
    (scenario.spheres.iter().fold(1, hash) >> 16) as usize
}

impl fmt::Display for Subject {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} on {} ({} threads)", self.algorithm, self.backend, self.threads)
    }
}

/// Runs `work` in one of the suite's pools. They are created once, as creating a pool takes longer than most scenarios.
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
