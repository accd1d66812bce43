use std::fmt;
use std::time::Duration;

use lazygrid::{Algorithm, Backend, Config, Order, Simd, Skin};
use lazygrid_check::{DetectorVariant, TargetDevice};

use super::comparison::Unavailable;
use crate::SpeciesScene;
use crate::measure::ContenderFactory;
use crate::peers::{cell_list, lammps, octree, parry, sweep_and_prune, verlet};
use lazygrid_io::scenes::Scene;

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Contender {
    /// A detector that delivers pairs in any order. On the CPU, only `Auto` keeps candidates between steps. A
    /// GPU variant may use a software adapter, and reads its pairs back.
    Lazygrid(DetectorVariant),
    BulletAsShipped,
    /// Bullet with the fastest margin for the scene.
    BulletTuned,
    /// A tree that is refitted at each step.
    Parry,
    /// A tree with enlarged boxes, of which few are updated.
    ParryMargin,
    /// A tree that is partly rebuilt at each step.
    ParryOptimized,
    PlainCellList,
    /// A Verlet list with the fastest skin for the scene and its steps.
    Verlet,
    /// LAMMPS with the fastest skin for the steps; its times include forces.
    Lammps,
    SortAndSweep,
    Octree,
}

impl Contender {
    /// Returns a CPU detector with all threads if `threads` is `None`.
    pub fn cpu(algorithm: Algorithm, threads: Option<usize>) -> Self {
        let target = TargetDevice::Cpu { simd: Simd::detect(), threads };
        Self::Lazygrid(DetectorVariant::new(algorithm, target))
    }

    pub fn gpu(algorithm: Algorithm) -> Self {
        Self::Lazygrid(DetectorVariant::new(algorithm, TargetDevice::Gpu { subgroups: true }))
    }

    pub(super) fn by_species(self, scene: SpeciesScene) -> ContenderFactory {
        let name = self.to_string();
        match self {
            Self::Lazygrid(variant) => ContenderFactory::list_by_species(name, config(variant), scene),
            _ => Unavailable::SPECIES.factory(name),
        }
    }

    /// `step_length` is in radii.
    pub fn factory(self, scene: Scene, step_length: f32) -> ContenderFactory {
        let name = self.to_string();
        match self {
            Self::Lazygrid(variant) => ContenderFactory::list(name, config(variant)),
            Self::BulletAsShipped | Self::BulletTuned => self.bullet(scene),
            Self::Parry => parry::refitted(name),
            Self::ParryMargin => parry::with_margin(name),
            Self::ParryOptimized => parry::optimized(name),
            Self::PlainCellList => cell_list::tuned(name, scene),
            Self::Verlet => verlet::tuned(name, scene, step_length),
            Self::Lammps if lammps::is_named() => lammps::tuned(name, step_length),
            Self::Lammps => Unavailable::LAMMPS.factory(name),
            Self::SortAndSweep => sweep_and_prune::incremental(),
            Self::Octree => octree::incremental(),
        }
    }

    #[cfg(feature = "bullet")]
    fn bullet(self, scene: Scene) -> ContenderFactory {
        use crate::peers::bullet::{Tuning, incremental};
        let tuning = if self == Self::BulletTuned { Tuning::best(scene) } else { Tuning::SHIPPED };
        incremental(self.to_string(), tuning)
    }

    #[cfg(not(feature = "bullet"))]
    fn bullet(self, _: Scene) -> ContenderFactory {
        Unavailable::BULLET.factory(self.to_string())
    }

    pub(super) fn setting(self) -> Option<f64> {
        let Self::Lazygrid(variant) = self else { return None };
        let threads = match variant.target {
            TargetDevice::Cpu { threads, .. } => threads,
            TargetDevice::Gpu { .. } => None,
        };
        let [tau, ratio] = [variant.tau.map(f64::from), variant.cell_ratio.map(f64::from)];
        tau.or(ratio).or(threads.map(|threads| threads as f64))
    }

    pub(super) fn is_quadratic(self) -> bool {
        let is_naive = |variant: DetectorVariant| variant.algorithm == Algorithm::Naive;
        matches!(self, Self::SortAndSweep) || matches!(self, Self::Lazygrid(variant) if is_naive(variant))
    }

    /// Returns `true` if pairs within 4 ulp of tangency may differ.
    pub(super) fn rounds_freely(self) -> bool {
        matches!(self, Self::Lazygrid(variant) if variant.backend() == Backend::Gpu)
    }

    pub(super) fn for_memory() -> Vec<Self> {
        let ours = [Algorithm::CellList, Algorithm::RecursiveGrid, Algorithm::ArrayGrid, Algorithm::HashGrid];
        let peers =
            [Self::PlainCellList, Self::Parry, Self::ParryMargin, Self::BulletAsShipped, Self::BulletTuned];
        ours.map(|a| Self::cpu(a, Some(1))).into_iter().chain(peers).collect()
    }
}

const TIMEOUT: Duration = Duration::from_secs(600);

fn config(variant: DetectorVariant) -> Config {
    // A named algorithm on the CPU must search at each step.
    let skin = match (variant.backend(), variant.algorithm) {
        (Backend::Cpu, Algorithm::Auto) | (Backend::Gpu, _) => Skin::Auto,
        _ => Skin::Off,
    };
    let config = variant.config(None).order(Order::Unordered).skin(skin);
    if variant.backend() == Backend::Gpu { config.timeout(TIMEOUT) } else { config }
}

impl fmt::Display for Contender {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = match self {
            Self::Lazygrid(variant) => match (variant.backend(), variant.algorithm) {
                (Backend::Gpu, algorithm) => return write!(f, "{algorithm} (GPU)"),
                (_, Algorithm::Auto) => "CPU path's own choice",
                (_, algorithm) => algorithm.name(),
            },
            Self::BulletAsShipped => "Bullet as shipped",
            Self::BulletTuned => "Bullet tuned",
            Self::Parry => "parry3d refit",
            Self::ParryMargin => "parry3d refit, margin",
            Self::ParryOptimized => "parry3d refit, optimized",
            Self::PlainCellList => "plain cell list",
            Self::Verlet => "Verlet list",
            Self::Lammps => "LAMMPS",
            Self::SortAndSweep => "sort-and-sweep (N3Sim)",
            Self::Octree => "octree (BiNS2)",
        };
        f.pad(name)
    }
}
