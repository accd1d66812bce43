use lazygrid::{Algorithm, Simd, Sphere};
use lazygrid_check::{DetectorVariant, TargetDevice};
use serde::{Deserialize, Serialize};

use super::{Contender, Figure};
use crate::SpeciesScene;
use crate::measure::ContenderFactory;
use lazygrid_io::scenes::{Scene, Transceivers};

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RunScale {
    /// A few hundred spheres; times are meaningless.
    Smoke,
    /// Under three minutes on two cores.
    Quick,
    /// The paper's sizes, within the time budget.
    Full,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    pub scale: RunScale,
    pub only: Vec<Figure>,
    /// Maximum number of runs, or steps, of an engine at a point; `None` for the numbers of the paper, or
    /// fewer below full scale.
    pub runs: Option<usize>,
    pub minutes: f64,
    pub seed: u64,
    #[serde(default)]
    pub command: String,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum SceneUpdate {
    Fresh,
    Species(SpeciesScene),
    Steps {
        step_length: f32,
    },
    Simulated {
        steps: u32,
    },
    /// Runs each engine in a separate process.
    Processes,
}

#[derive(Clone, Debug)]
pub(super) struct DataPoint {
    pub(super) figure: Figure,
    pub(super) scene: Scene,
    pub(super) n: usize,
    pub(super) update: SceneUpdate,
    pub(super) contenders: Vec<Contender>,
    pub(super) runs: usize,
}

impl DataPoint {
    pub(super) fn key(&self) -> String {
        let step_length = self.step_length();
        match self.figure {
            Figure::StepLength => format!("{}-{}-{}-{step_length}", self.figure, self.name(), self.n),
            _ => format!("{}-{}-{}", self.figure, self.name(), self.n),
        }
    }

    pub(super) fn step_length(&self) -> f32 {
        if let SceneUpdate::Steps { step_length } = self.update { step_length } else { Scene::STEP }
    }

    pub(super) fn name(&self) -> String {
        match self.scene {
            Scene::Transceivers(Transceivers { count, ratio }) => format!("{count}-transceivers-x{ratio}"),
            scene => self.species().map_or(scene.name(), SpeciesScene::name).to_owned(),
        }
    }

    pub(super) fn species(&self) -> Option<SpeciesScene> {
        if let SceneUpdate::Species(scene) = self.update { Some(scene) } else { None }
    }

    pub(super) fn factory(&self, contender: Contender) -> ContenderFactory {
        match self.species() {
            None => contender.factory(self.scene, self.step_length()),
            Some(scene) => contender.by_species(scene),
        }
    }

    pub(super) fn sample(&self, seed: u64) -> Vec<Sphere> {
        self.species().map_or_else(|| self.scene.spheres(self.n, seed), |scene| scene.spheres(self.n, seed))
    }

    pub(super) fn kind(&self) -> String {
        match (self.figure, self.scene) {
            (Figure::Transceivers, Scene::Transceivers(mixture)) => {
                format!("transceivers-x{}", mixture.ratio)
            }
            (Figure::SizeRatio, Scene::Transceivers(mixture)) => format!("{}-transceivers", mixture.count),
            _ => self.name(),
        }
    }

    pub(super) fn setting(&self, contender: Contender) -> Option<f64> {
        match (self.figure, self.scene) {
            // Gives 0.1 rather than the nearest `f32`.
            (Figure::StepLength, _) => self.step_length().to_string().parse().ok(),
            (Figure::Transceivers, Scene::Transceivers(mixture)) => Some(mixture.count.into()),
            (Figure::SizeRatio, Scene::Transceivers(mixture)) => Some(mixture.ratio.into()),
            (figure, _) => figure.varied().and_then(|_| contender.setting()),
        }
    }

    pub(super) fn weight(&self) -> f64 {
        let factor = match self.figure {
            Figure::F5a | Figure::F5b => 4.0,
            // Trees are slow only occasionally and need many steps.
            Figure::F4 => 3.0,
            Figure::Transceivers | Figure::SizeRatio => 0.3,
            Figure::StepLength => 0.5,
            _ => 1.0,
        };
        factor * self.contenders.len() as f64 * (self.n.max(1000) as f64 / 1000.0).powf(0.4)
    }
}

impl Settings {
    /// Returns small points first, so large ones get unused time.
    pub(super) fn points(&self) -> Vec<DataPoint> {
        let mut points: Vec<DataPoint> =
            self.only.iter().flat_map(|&figure| self.points_of(figure)).collect();
        points.sort_by_key(|point| (point.n, point.figure));
        points
    }

    fn points_of(&self, figure: Figure) -> Vec<DataPoint> {
        let sizes = self.sizes(figure);
        let points_at = |(scene, n): (Scene, usize)| {
            self.updates(figure, n).into_iter().map(move |update| DataPoint {
                figure,
                scene,
                n,
                update,
                contenders: contenders(figure),
                runs: self.runs.unwrap_or(self.runs_of(figure)),
            })
        };
        let scenes = self.scenes(figure).into_iter();
        scenes.flat_map(|scene| sizes.iter().map(move |&n| (scene, n))).flat_map(points_at).collect()
    }

    fn updates(&self, figure: Figure, n: usize) -> Vec<SceneUpdate> {
        match figure {
            Figure::F3a | Figure::F3b | Figure::Point => vec![SceneUpdate::Fresh],
            Figure::Species => SpeciesScene::ALL.map(SceneUpdate::Species).into(),
            Figure::F5a | Figure::F5b => {
                vec![SceneUpdate::Simulated { steps: self.steps_of_a_burst(figure, n) }]
            }
            Figure::Memory => vec![SceneUpdate::Processes],
            Figure::F4 | Figure::Transceivers | Figure::SizeRatio => {
                vec![SceneUpdate::Steps { step_length: Scene::STEP }]
            }
            Figure::Tau | Figure::Ratio | Figure::Threads => {
                vec![SceneUpdate::Steps { step_length: Scene::STEP }]
            }
            Figure::StepLength => {
                [0.001, 0.01, 0.1].map(|step_length| SceneUpdate::Steps { step_length }).into()
            }
        }
    }

    /// A step takes about 0.2 µs per carrier on two cores.
    fn steps_of_a_burst(&self, figure: Figure, n: usize) -> u32 {
        let moves: usize = match (self.scale, figure) {
            (RunScale::Smoke, _) => 20_000,
            (RunScale::Quick, _) => 10_000_000,
            (RunScale::Full, Figure::F5a) => 200_000_000,
            (RunScale::Full, _) => 100_000_000,
        };
        (moves / n.max(1)).clamp(1, 1_000_000) as u32
    }

    fn runs_of(&self, figure: Figure) -> usize {
        match (self.scale, figure) {
            (RunScale::Smoke, _) => 2,
            (RunScale::Quick, Figure::F5a | Figure::F5b) => 5,
            (_, Figure::Memory) => 3,
            (RunScale::Quick, _) => 20,
            (RunScale::Full, Figure::F3a | Figure::F3b) => 200,
            (RunScale::Full, Figure::F4 | Figure::StepLength) => 100,
            (RunScale::Full, Figure::F5a | Figure::F5b) => 10,
            (RunScale::Full, _) => 30,
        }
    }

    fn scenes(&self, figure: Figure) -> Vec<Scene> {
        match figure {
            Figure::F3a | Figure::StepLength | Figure::Species => vec![Scene::Equal],
            Figure::F3b => vec![Scene::FiveSizes],
            Figure::F4 | Figure::Threads => vec![Scene::Equal, Scene::FiveSizes],
            Figure::F5a | Figure::F5b => vec![Scene::Burst],
            Figure::Point => vec![Scene::Point],
            Figure::Transceivers => match self.scale {
                RunScale::Smoke => mixtures(&[1, 20], &[10]),
                RunScale::Quick => mixtures(&[1, 100], &[10, 1000]),
                RunScale::Full => mixtures(&[1, 10, 30, 100, 1000, 10_000], &[10, 100, 1000]),
            },
            Figure::SizeRatio => match self.scale {
                RunScale::Smoke => mixtures(&[2], &[1, 4, 64]),
                RunScale::Quick => mixtures(&[10], &[1, 4, 16, 64, 256]),
                RunScale::Full => mixtures(&[10], &[1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024]),
            },
            Figure::Tau | Figure::Ratio | Figure::Memory => {
                vec![Scene::Equal, Scene::FiveSizes, Scene::Burst]
            }
        }
    }

    fn sizes(&self, figure: Figure) -> &'static [usize] {
        use Figure::*;
        match (self.scale, figure) {
            (RunScale::Smoke, Memory) => &[1000],
            (RunScale::Smoke, Point) => &[60],
            (RunScale::Smoke, _) => &[200],
            (RunScale::Quick, F3a | F3b | F4) => &[1000, 10_000, 100_000],
            (RunScale::Quick, F5a) => &[20_000],
            (RunScale::Quick, F5b) => &[1000, 10_000],
            (RunScale::Quick, Tau | Ratio | Transceivers | SizeRatio | StepLength | Species) => &[20_000],
            (RunScale::Quick, Threads | Memory) => &[100_000],
            (RunScale::Quick, Point) => &[100, 1000],
            (RunScale::Full, F3a | F3b) => &[100, 300, 1000, 3000, 10_000, 100_000, 1_000_000, 10_000_000],
            (RunScale::Full, F4) => &[1000, 3000, 10_000, 30_000, 100_000, 300_000, 1_000_000],
            (RunScale::Full, F5a) => &[500_000],
            (RunScale::Full, F5b) => &[1000, 10_000, 100_000, 1_000_000],
            (RunScale::Full, Tau | Ratio | Transceivers | SizeRatio | StepLength) => &[100_000],
            (RunScale::Full, Species) => &[10_000, 100_000],
            (RunScale::Full, Threads) => &[10_000, 100_000, 1_000_000],
            // Trees for a million spheres take minutes to build.
            (RunScale::Full, Memory) => &[100_000],
            (RunScale::Full, Point) => &[100, 1000, 3000, 10_000],
        }
    }
}

fn mixtures(counts: &[u32], ratios: &[u32]) -> Vec<Scene> {
    let with_ratio =
        |&ratio: &u32| counts.iter().map(move |&count| Scene::Transceivers(Transceivers { count, ratio }));
    ratios.iter().flat_map(with_ratio).collect()
}

fn contenders(figure: Figure) -> Vec<Contender> {
    let on_cpu = |algorithm| {
        DetectorVariant::new(algorithm, TargetDevice::Cpu { simd: Simd::detect(), threads: None })
    };
    let on_gpu = |algorithms: &[Algorithm]| algorithms.iter().map(|&a| Contender::gpu(a)).collect::<Vec<_>>();
    let gpu = on_gpu(Algorithm::GPU);
    let grids = [Algorithm::HashGrid, Algorithm::ArrayGrid, Algorithm::RecursiveGrid];
    match figure {
        Figure::F3a | Figure::F3b | Figure::Point => {
            let cpu = Algorithm::CPU.iter().map(|&a| Contender::cpu(a, None));
            cpu.chain(gpu).collect()
        }
        Figure::F4 => {
            let ours = [Algorithm::RecursiveGrid, Algorithm::CellList, Algorithm::Auto];
            let ours = ours.map(|a| Contender::cpu(a, None));
            let trees = [Contender::BulletAsShipped, Contender::BulletTuned, Contender::Parry];
            let more = [
                Contender::ParryMargin,
                Contender::ParryOptimized,
                Contender::PlainCellList,
                Contender::Verlet,
            ];
            ours.into_iter().chain(trees).chain(more).collect()
        }
        Figure::StepLength => {
            let ours = [Algorithm::CellList, Algorithm::Auto].map(|a| Contender::cpu(a, None));
            ours.into_iter().chain([Contender::PlainCellList, Contender::Verlet, Contender::Lammps]).collect()
        }
        Figure::F5a | Figure::F5b => {
            // The paper's grid, and the GPU path's choice.
            let gpu = on_gpu(&[Algorithm::LazyGrid, Algorithm::Auto]);
            let cpu = [Contender::cpu(Algorithm::Auto, None), Contender::Octree, Contender::SortAndSweep];
            gpu.into_iter().chain(cpu).collect()
        }
        Figure::Species => {
            let cpu = Algorithm::CPU.iter().map(|&a| Contender::cpu(a, None));
            cpu.chain([Contender::gpu(Algorithm::CellList)]).collect()
        }
        Figure::Tau => [4, 8, 16, 32, 64, 128, 256, 512, 1024]
            .map(|tau| {
                Contender::Lazygrid(DetectorVariant { tau: Some(tau), ..on_cpu(Algorithm::RecursiveGrid) })
            })
            .into(),
        Figure::Ratio => {
            let ratios = [0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0];
            let variants = |algorithm| {
                ratios.map(|ratio| {
                    Contender::Lazygrid(DetectorVariant { cell_ratio: Some(ratio), ..on_cpu(algorithm) })
                })
            };
            grids.into_iter().flat_map(variants).collect()
        }
        Figure::Threads => {
            let cores = std::thread::available_parallelism().map_or(1, usize::from);
            let threads = || std::iter::successors(Some(1), |t| Some(t * 2)).take_while(|&t| t < cores);
            let variants = |algorithm| {
                threads().chain([cores]).map(move |threads| Contender::cpu(algorithm, Some(threads)))
            };
            grids.into_iter().chain([Algorithm::CellList]).flat_map(variants).collect()
        }
        Figure::Memory => Contender::for_memory(),
        Figure::Transceivers | Figure::SizeRatio => {
            let ours = grids.into_iter().chain([Algorithm::CellList, Algorithm::Auto]);
            let peers = [Contender::BulletTuned, Contender::Parry, Contender::PlainCellList];
            let earlier = [Contender::SortAndSweep, Contender::Octree];
            ours.map(|a| Contender::cpu(a, None)).chain(peers).chain(earlier).collect()
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn point_files_and_row_cells_are_unique() {
        for scale in [RunScale::Smoke, RunScale::Quick, RunScale::Full] {
            let (only, command) = (Figure::ALL.to_vec(), String::new());
            let points = Settings { scale, only, runs: None, minutes: 1.0, seed: 1, command }.points();
            let files: BTreeSet<String> = points.iter().map(DataPoint::key).collect();
            assert_eq!(files.len(), points.len(), "{scale:?}");
            let cell = |point: &DataPoint, contender: Contender| {
                let setting = point.setting(contender).map(f64::to_bits);
                (point.figure, point.kind(), point.n, setting, contender.to_string())
            };
            let rows = || points.iter().flat_map(|p| p.contenders.iter().map(move |&e| cell(p, e)));
            assert_eq!(rows().count(), rows().collect::<BTreeSet<_>>().len(), "{scale:?}");
        }
    }
}
