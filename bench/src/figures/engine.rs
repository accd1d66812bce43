use std::fmt;

use lazygrid::{Algorithm, Backend, Config, Order, Skin};

use super::race::Unavailable;
use crate::measure::ContenderFactory;
use crate::peers::{cell_list, lammps, octree, parry, sweep, verlet};
use lazygrid_io::scenes::Scene;

/// A contender in the figures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Contender {
    /// A lazygrid algorithm on the CPU; pairs in any order. Only `Auto` keeps candidates between steps.
    Cpu {
        /// The algorithm; `Auto` lets the CPU path choose.
        algorithm: Algorithm,
        /// The number of threads; `None` for all.
        threads: Option<usize>,
        /// τ, or `None` for the default.
        tau: Option<u32>,
        /// The cell ratio, or `None` for the default.
        ratio: Option<f32>,
    },
    /// A lazygrid algorithm on the GPU adapter, or a software adapter if there is no other; pairs in any order, read
    /// back to the host.
    Gpu(Algorithm),
    /// Bullet's `btDbvtBroadphase` with default settings.
    BulletAsShipped,
    /// Bullet's `btDbvtBroadphase` with the fastest margin for the scene.
    BulletTuned,
    /// parry3d's tree, refitted at each step.
    Parry,
    /// parry3d's tree with boxes larger than the spheres, so that few are updated.
    ParryMargin,
    /// parry3d's tree, partly rebuilt at each step.
    ParryOptimised,
    /// The plain cell list, which is the baseline.
    PlainCellList,
    /// A Verlet list with the fastest skin for the scene and its steps.
    Verlet,
    /// LAMMPS with the fastest skin for the steps, including forces.
    Lammps,
    /// Sweep and prune along one axis.
    SortAndSweep,
    /// An octree with sweep and prune in its leaves.
    Octree,
}

impl Contender {
    /// A CPU algorithm with default settings.
    pub const fn cpu(algorithm: Algorithm, threads: Option<usize>) -> Self {
        Self::Cpu { algorithm, threads, tau: None, ratio: None }
    }

    /// Creates the factory of searches for `n` spheres of a scene that move by `moves` radii per step.
    pub fn factory(self, scene: Scene, n: usize, moves: f32) -> ContenderFactory {
        let name = self.to_string();
        match self {
            Self::Cpu { .. } => ContenderFactory::list(name, self.config()),
            Self::Gpu(algorithm) => {
                let config = Config::default().backend(Backend::Gpu).algorithm(algorithm);
                ContenderFactory::list(name, config.order(Order::Unordered))
            }
            Self::BulletAsShipped | Self::BulletTuned => self.bullet(scene, n),
            Self::Parry => parry::refitted(name),
            Self::ParryMargin => parry::with_margin(name),
            Self::ParryOptimised => parry::optimised(name),
            Self::PlainCellList => cell_list::tuned(name, scene),
            Self::Verlet => verlet::tuned(name, scene, moves),
            Self::Lammps if lammps::is_named() => lammps::tuned(name, moves),
            Self::Lammps => Unavailable::LAMMPS.factory(name),
            Self::SortAndSweep => sweep::incremental(),
            Self::Octree => octree::incremental(),
        }
    }

    /// The settings of a CPU algorithm; the defaults for other engines.
    fn config(self) -> Config {
        let config = Config::default().backend(Backend::Cpu).order(Order::Unordered);
        let Self::Cpu { algorithm, threads, tau, ratio } = self else { return config };
        // A named algorithm must search at each step; `Auto` may keep candidates.
        let skin = if algorithm == Algorithm::Auto { Skin::Auto } else { Skin::Off };
        let mut config = config.algorithm(algorithm).skin(skin);
        if let Some(threads) = threads {
            config = config.threads(threads);
        }
        if let Some(tau) = tau {
            config = config.tau(tau);
        }
        if let Some(ratio) = ratio {
            config = config.raster_ratio(ratio);
        }
        config
    }

    #[cfg(feature = "bullet")]
    fn bullet(self, scene: Scene, n: usize) -> ContenderFactory {
        use crate::peers::bullet::{Tuning, incremental};
        let tuning = if self == Self::BulletTuned { Tuning::best(scene, n) } else { Tuning::SHIPPED };
        incremental(self.to_string(), tuning)
    }

    #[cfg(not(feature = "bullet"))]
    fn bullet(self, _: Scene, _: usize) -> ContenderFactory {
        Unavailable::BULLET.factory(self.to_string())
    }

    /// The varied parameter of the sweeps: τ, the cell ratio, or the number of threads.
    pub(super) fn setting(self) -> Option<f64> {
        match self {
            Self::Cpu { tau: Some(tau), .. } => Some(tau.into()),
            Self::Cpu { ratio: Some(ratio), .. } => Some(ratio.into()),
            Self::Cpu { threads: Some(threads), .. } => Some(threads as f64),
            _ => None,
        }
    }

    /// Returns `true` if the time grows about quadratically with the number of spheres.
    pub(super) fn is_quadratic(self) -> bool {
        matches!(
            self,
            Self::Cpu { algorithm: Algorithm::Naive, .. } | Self::Gpu(Algorithm::Naive) | Self::SortAndSweep
        )
    }

    /// Returns `true` if pairs within 4 ulp of tangency may be found or missed.
    pub(super) fn rounds_freely(self) -> bool {
        matches!(self, Self::Gpu(_))
    }

    /// All engines of the memory measurements, single-threaded.
    pub(super) fn for_memory() -> Vec<Self> {
        let ours = [Algorithm::CellList, Algorithm::RecursiveGrid, Algorithm::ArrayGrid, Algorithm::HashGrid];
        let peers =
            [Self::PlainCellList, Self::Parry, Self::ParryMargin, Self::BulletAsShipped, Self::BulletTuned];
        ours.map(|a| Self::cpu(a, Some(1))).into_iter().chain(peers).collect()
    }
}

impl fmt::Display for Contender {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = match self {
            Self::Cpu { algorithm: Algorithm::Auto, .. } => "CPU path's own choice",
            Self::Cpu { algorithm, .. } => algorithm.name(),
            Self::Gpu(algorithm) => return write!(f, "{algorithm} (GPU)"),
            Self::BulletAsShipped => "Bullet as shipped",
            Self::BulletTuned => "Bullet tuned",
            Self::Parry => "parry3d refit",
            Self::ParryMargin => "parry3d refit, margin",
            Self::ParryOptimised => "parry3d refit, optimised",
            Self::PlainCellList => "plain cell list",
            Self::Verlet => "Verlet list",
            Self::Lammps => "LAMMPS",
            Self::SortAndSweep => "sort-and-sweep (N3Sim)",
            Self::Octree => "octree (BiNS2)",
        };
        f.pad(name)
    }
}
