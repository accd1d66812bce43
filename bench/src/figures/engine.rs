use std::fmt;

use lazygrid::{Algorithm, Backend, Config, Order, Skin};

use super::race::Unavailable;
use crate::measure::Contender;
use crate::peers::{cell_list, lammps, octree, parry, sweep, verlet};
use lazygrid_io::scenes::Scene;

/// A way to find pairs that takes part in the figures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Engine {
    /// A lazygrid algorithm on the CPU; pairs in any order. Only its own choice keeps candidates from step to step.
    Cpu {
        /// Which; `Auto` is the CPU path's own choice.
        algorithm: Algorithm,
        /// Threads; `None`: all.
        threads: Option<usize>,
        /// τ, where it is not the default.
        tau: Option<u32>,
        /// Raster ratio, where it is not the default.
        ratio: Option<f32>,
    },
    /// A lazygrid algorithm on the GPU adapter, a software one if there is no other; pairs in any order, on the host.
    Gpu(Algorithm),
    /// Bullet's `btDbvtBroadphase` as the library comes.
    BulletAsShipped,
    /// The same with the margin that is fastest for the scene.
    BulletTuned,
    /// parry3d's tree, refitted at every step.
    Parry,
    /// The same with boxes larger than the spheres, so that few are written.
    ParryMargin,
    /// The same, a part of the tree rebuilt at every step.
    ParryOptimised,
    /// The yardstick.
    PlainCellList,
    /// A Verlet list with the skin that is fastest for the scene and its steps.
    Verlet,
    /// LAMMPS with the skin that is fastest for the steps, forces included.
    Lammps,
    /// Sort and sweep.
    SortAndSweep,
    /// An octree with sort and sweep in its leaves.
    Octree,
}

impl Engine {
    /// A CPU algorithm with its defaults.
    pub const fn cpu(algorithm: Algorithm, threads: Option<usize>) -> Self {
        Self::Cpu { algorithm, threads, tau: None, ratio: None }
    }

    /// Makes the contender for `n` spheres of a scene that move by this part of their radius in a step.
    pub fn contender(self, scene: Scene, n: usize, moves: f32) -> Contender {
        let name = self.to_string();
        match self {
            Self::Cpu { .. } => Contender::list(name, self.config()),
            Self::Gpu(algorithm) => {
                let config = Config::default().backend(Backend::Gpu).algorithm(algorithm);
                Contender::list(name, config.order(Order::Unordered))
            }
            Self::BulletAsShipped | Self::BulletTuned => self.bullet(scene, n),
            Self::Parry => parry::refitted(name),
            Self::ParryMargin => parry::with_margin(name),
            Self::ParryOptimised => parry::optimised(name),
            Self::PlainCellList => cell_list::tuned(name, scene),
            Self::Verlet => verlet::tuned(name, scene, moves),
            Self::Lammps if lammps::is_named() => lammps::tuned(name, moves),
            Self::Lammps => Unavailable::LAMMPS.contender(name),
            Self::SortAndSweep => sweep::running(),
            Self::Octree => octree::running(),
        }
    }

    /// The settings of a CPU algorithm; the default ones for everybody else.
    fn config(self) -> Config {
        let config = Config::default().backend(Backend::Cpu).order(Order::Unordered);
        let Self::Cpu { algorithm, threads, tau, ratio } = self else { return config };
        // An algorithm that is asked for is to show what it takes; the CPU path's own choice keeps what it likes.
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
    fn bullet(self, scene: Scene, n: usize) -> Contender {
        use crate::peers::bullet::{Tuning, running};
        let tuning = if self == Self::BulletTuned { Tuning::best(scene, n) } else { Tuning::SHIPPED };
        running(self.to_string(), tuning)
    }

    #[cfg(not(feature = "bullet"))]
    fn bullet(self, _: Scene, _: usize) -> Contender {
        Unavailable::BULLET.contender(self.to_string())
    }

    /// What is varied in the sweeps: τ, the raster ratio, or the number of threads.
    pub(super) fn setting(self) -> Option<f64> {
        match self {
            Self::Cpu { tau: Some(tau), .. } => Some(tau.into()),
            Self::Cpu { ratio: Some(ratio), .. } => Some(ratio.into()),
            Self::Cpu { threads: Some(threads), .. } => Some(threads as f64),
            _ => None,
        }
    }

    /// Whether its time grows with the square of the number of spheres, or nearly.
    pub(super) fn is_quadratic(self) -> bool {
        matches!(
            self,
            Self::Cpu { algorithm: Algorithm::Naive, .. } | Self::Gpu(Algorithm::Naive) | Self::SortAndSweep
        )
    }

    /// Whether pairs within 4 ulp of tangency may fall either way.
    pub(super) fn rounds_freely(self) -> bool {
        matches!(self, Self::Gpu(_))
    }

    /// Every engine by the name of the memory measurements, single-threaded.
    pub(super) fn for_memory() -> Vec<Self> {
        let ours = [Algorithm::CellList, Algorithm::RecursiveGrid, Algorithm::ArrayGrid, Algorithm::HashGrid];
        let peers =
            [Self::PlainCellList, Self::Parry, Self::ParryMargin, Self::BulletAsShipped, Self::BulletTuned];
        ours.map(|a| Self::cpu(a, Some(1))).into_iter().chain(peers).collect()
    }
}

impl fmt::Display for Engine {
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
