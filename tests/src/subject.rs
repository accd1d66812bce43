use std::env;
use std::fmt;
use std::sync::LazyLock;

use lazygrid::{Algorithm, Backend, Config, Detector, Order, Pair, Sphere};
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::{Scenario, Tolerance, difference};

/// The numbers of threads that every CPU detector is run with: none to share with, a few, and more than cores.
pub const THREADS: [usize; 3] = [1, 2, 7];

/// One way to run a detector: what the suite's every scenario is given to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Subject {
    /// Where it runs.
    pub backend: Backend,
    /// Which detector.
    pub algorithm: Algorithm,
    /// How many threads the CPU path has.
    pub threads: usize,
}

impl Subject {
    /// Every subject. A backend joins the suite here. `LAZYGRID_SUBJECTS=gpu` leaves out those of the CPU, which a
    /// GPU's driver or its settings change nothing for; `LAZYGRID_SUBJECTS=gpu/cell-list` leaves one algorithm, and
    /// `LAZYGRID_SUBJECTS=cpu` those of the CPU.
    ///
    /// # Panics
    /// Where `LAZYGRID_SUBJECTS` has another value, or a GPU that is required is missing.
    pub fn all() -> Vec<Self> {
        let cpu = |algorithm| THREADS.map(|threads| Self { backend: Backend::Cpu, algorithm, threads });
        let on_cpu = Algorithm::CPU.into_iter().chain([Algorithm::Auto]).flat_map(cpu);
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

    /// The subjects for one of many scenarios: all of the CPU, and two of the GPU's, which the scenario draws, so that a
    /// property of many cases has each of them often enough on a driver in software. All where `LAZYGRID_SUBJECTS` is set.
    ///
    /// # Panics
    /// As [`all`](Self::all).
    pub fn in_turn(scenario: &Scenario) -> Vec<Self> {
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

    /// The subjects on their fewest threads: one for each backend and algorithm.
    pub fn each_algorithm() -> Vec<Self> {
        Self::all().into_iter().filter(|subject| subject.threads == THREADS[0]).collect()
    }

    /// Settings that ask for this subject.
    pub fn config(self) -> Config {
        Config::default().backend(self.backend).algorithm(self.algorithm)
    }

    /// How far results may be from the definition.
    pub fn tolerance(self) -> Tolerance {
        match self.backend {
            Backend::Cpu => Tolerance::Exact,
            _ => Tolerance::Tangent,
        }
    }

    /// Runs `work` with this subject's threads.
    pub fn run<T: Send>(self, work: impl FnOnce() -> T + Send) -> T {
        in_pool(self.threads, work)
    }

    /// Asks a new detector with these settings for the pairs.
    ///
    /// # Errors
    /// The library's error, as text.
    pub fn pairs(self, scenario: &Scenario, settings: Config) -> Result<Vec<Pair>, String> {
        let config = scenario.config(settings).map_err(|e| e.to_string())?;
        let config = config.backend(self.backend).algorithm(self.algorithm);
        self.run(|| {
            let mut detector = Detector::new(config).map_err(|e| e.to_string())?;
            detector.pairs(scenario.query()).map_err(|e| e.to_string())?;
            Ok(detector.into_pairs())
        })
    }

    /// The list that this subject's other results are held against: the `expected` pairs, or its own list, itself
    /// held against them, where pairs in tangency may fall either way.
    ///
    /// # Errors
    /// What is wrong with its list.
    pub fn own_pairs(self, scenario: &Scenario, expected: &[Pair]) -> Result<Vec<Pair>, String> {
        if self.tolerance() == Tolerance::Exact {
            return Ok(expected.to_vec());
        }
        let found = self.pairs(scenario, Config::default())?;
        difference(scenario, &found, expected, self.tolerance()).map_err(|text| format!("{self}: {text}"))?;
        Ok(found)
    }

    /// Judges this subject on a scenario whose pairs are known: in both orders, on the GPU in one of them, as only the host
    /// puts pairs in order.
    ///
    /// # Errors
    /// What is wrong with its result.
    pub fn judge(self, scenario: &Scenario, expected: &[Pair], settings: &Config) -> Result<(), String> {
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

/// A number by the scenario's spheres.
fn drawn(scenario: &Scenario) -> usize {
    let word = |hash: u32, bits: u32| (hash.rotate_left(5) ^ bits).wrapping_mul(0x9e37_79b9);
    let hash = |hash, sphere: &Sphere| word(word(hash, sphere.center.x.to_bits()), sphere.radius.to_bits());
    (scenario.spheres.iter().fold(1, hash) >> 16) as usize
}

impl fmt::Display for Subject {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} on {} ({} threads)", self.algorithm, self.backend, self.threads)
    }
}

/// Runs `work` in one of the suite's pools, which are made once: a pool per detector would cost more than most
/// scenarios do.
///
/// # Panics
/// Where `threads` is not one of [`THREADS`].
pub fn in_pool<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    static POOLS: LazyLock<[ThreadPool; 3]> = LazyLock::new(|| {
        THREADS.map(|n| ThreadPoolBuilder::new().num_threads(n).build().expect("threads of the system"))
    });
    let pool = THREADS.iter().position(|&n| n == threads).expect("one of THREADS");
    POOLS[pool].install(work)
}
