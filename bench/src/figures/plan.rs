//! What each figure is made of: scenes, numbers of spheres, engines and runs.

use lazygrid::Algorithm;
use serde::{Deserialize, Serialize};

use super::{Engine, Figure};
use lazygrid_io::scenes::{Scene, Transceivers};

/// How large the figures are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scale {
    /// Some hundred spheres: answers are checked, times mean nothing.
    Smallest,
    /// Under three minutes on two cores.
    Quick,
    /// The paper's sizes as far as the time allows.
    Full,
}

/// What to run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// How large.
    pub scale: Scale,
    /// Which figures.
    pub only: Vec<Figure>,
    /// The most runs, or steps, of an engine at a point; none: as many as the paper's, fewer where `scale` is not full.
    pub runs: Option<usize>,
    /// About how many minutes it may take.
    pub minutes: f64,
    /// Seed of all scenes.
    pub seed: u64,
    /// The command that asked for it, for the report; empty where there was none.
    #[serde(default)]
    pub command: String,
}

/// How spheres change from one run to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Motion {
    /// Another sample of the scene each time.
    Fresh,
    /// Each sphere moves by this part of its radius.
    Steps {
        /// Which.
        part: f32,
    },
    /// By a simulation, from a burst on, for so many steps.
    Simulated {
        /// How many.
        steps: u32,
    },
    /// Each engine runs in a process of its own.
    Processes,
}

/// One number of spheres of one scene in one figure, and who takes part.
#[derive(Clone, Debug)]
pub(super) struct Point {
    pub(super) figure: Figure,
    pub(super) scene: Scene,
    pub(super) n: usize,
    pub(super) motion: Motion,
    pub(super) engines: Vec<Engine>,
    pub(super) runs: usize,
}

impl Point {
    /// A name for files, one per point.
    pub(super) fn key(&self) -> String {
        let moves = self.moves();
        match self.figure {
            Figure::Moves => format!("{}-{}-{}-{moves}", self.figure, self.name(), self.n),
            _ => format!("{}-{}-{}", self.figure, self.name(), self.n),
        }
    }

    /// The part of its radius by which a sphere moves in a step, where there are steps.
    pub(super) fn moves(&self) -> f32 {
        if let Motion::Steps { part } = self.motion { part } else { Scene::STEP }
    }

    /// The scene with its parameters.
    pub(super) fn name(&self) -> String {
        match self.scene {
            Scene::Transceivers(Transceivers { count, ratio }) => format!("{count}-transceivers-x{ratio}"),
            scene => scene.name().to_owned(),
        }
    }

    /// The scene with those of its parameters that its figure does not vary.
    pub(super) fn kind(&self) -> String {
        match (self.figure, self.scene) {
            (Figure::Transceivers, Scene::Transceivers(of)) => format!("transceivers-x{}", of.ratio),
            (Figure::SizeRatio, Scene::Transceivers(of)) => format!("{}-transceivers", of.count),
            (_, scene) => scene.name().to_owned(),
        }
    }

    /// The value of what its figure varies, which is a parameter of the scene or of the engine.
    pub(super) fn setting(&self, engine: Engine) -> Option<f64> {
        match (self.figure, self.scene) {
            // As it is written: 0.1 and not the nearest number of 32 bits.
            (Figure::Moves, _) => self.moves().to_string().parse().ok(),
            (Figure::Transceivers, Scene::Transceivers(of)) => Some(of.count.into()),
            (Figure::SizeRatio, Scene::Transceivers(of)) => Some(of.ratio.into()),
            (figure, _) => figure.varied().and_then(|_| engine.setting()),
        }
    }

    /// What share of the time it gets, in arbitrary units.
    pub(super) fn weight(&self) -> f64 {
        let share = match self.figure {
            // Several moments.
            Figure::F5a | Figure::F5b => 4.0,
            // Trees that are slow now and then need many steps.
            Figure::F4 => 3.0,
            // Of one number of spheres, and many of them.
            Figure::Transceivers | Figure::SizeRatio => 0.3,
            // Steps that are over soon.
            Figure::Moves => 0.5,
            _ => 1.0,
        };
        share * self.engines.len() as f64 * (self.n.max(1000) as f64 / 1000.0).powf(0.4)
    }
}

impl Settings {
    /// Every point, small ones first, so that what they leave of their time goes to the large ones.
    pub(super) fn points(&self) -> Vec<Point> {
        let mut points: Vec<Point> = self.only.iter().flat_map(|&figure| self.points_of(figure)).collect();
        points.sort_by_key(|point| (point.n, point.figure));
        points
    }

    fn points_of(&self, figure: Figure) -> Vec<Point> {
        let sizes = self.sizes(figure);
        let of = |(scene, n): (Scene, usize)| {
            self.motions(figure, n).into_iter().map(move |motion| Point {
                figure,
                scene,
                n,
                motion,
                engines: engines(figure),
                runs: self.runs.unwrap_or(self.runs_of(figure)),
            })
        };
        let scenes = self.scenes(figure).into_iter();
        scenes.flat_map(|scene| sizes.iter().map(move |&n| (scene, n))).flat_map(of).collect()
    }

    fn motions(&self, figure: Figure, n: usize) -> Vec<Motion> {
        match figure {
            Figure::F3a | Figure::F3b | Figure::Point => vec![Motion::Fresh],
            Figure::F5a | Figure::F5b => vec![Motion::Simulated { steps: self.steps_of_a_burst(figure, n) }],
            Figure::Memory => vec![Motion::Processes],
            Figure::F4 | Figure::Transceivers | Figure::SizeRatio => {
                vec![Motion::Steps { part: Scene::STEP }]
            }
            Figure::Tau | Figure::Ratio | Figure::Threads => vec![Motion::Steps { part: Scene::STEP }],
            Figure::Moves => [0.001, 0.01, 0.1].map(|part| Motion::Steps { part }).into(),
        }
    }

    /// How far a burst of so many carriers is followed. A step takes about 0.2 µs for each of them on two cores.
    fn steps_of_a_burst(&self, figure: Figure, n: usize) -> u32 {
        let moves: usize = match (self.scale, figure) {
            (Scale::Smallest, _) => 20_000,
            (Scale::Quick, _) => 10_000_000,
            (Scale::Full, Figure::F5a) => 200_000_000,
            (Scale::Full, _) => 100_000_000,
        };
        (moves / n.max(1)).clamp(1, 1_000_000) as u32
    }

    /// By default as many as the paper has.
    fn runs_of(&self, figure: Figure) -> usize {
        match (self.scale, figure) {
            (Scale::Smallest, _) => 2,
            (Scale::Quick, Figure::F5a | Figure::F5b) => 5,
            (_, Figure::Memory) => 3,
            (Scale::Quick, _) => 20,
            (Scale::Full, Figure::F3a | Figure::F3b) => 200,
            (Scale::Full, Figure::F4 | Figure::Moves) => 100,
            (Scale::Full, Figure::F5a | Figure::F5b) => 10,
            (Scale::Full, _) => 30,
        }
    }

    fn scenes(&self, figure: Figure) -> Vec<Scene> {
        match figure {
            Figure::F3a | Figure::Moves => vec![Scene::Equal],
            Figure::F3b => vec![Scene::FiveSizes],
            Figure::F4 | Figure::Threads => vec![Scene::Equal, Scene::FiveSizes],
            Figure::F5a | Figure::F5b => vec![Scene::Burst],
            Figure::Point => vec![Scene::Point],
            Figure::Transceivers => match self.scale {
                Scale::Smallest => mixtures(&[1, 20], &[10]),
                Scale::Quick => mixtures(&[1, 100], &[10, 1000]),
                Scale::Full => mixtures(&[1, 10, 30, 100, 1000, 10_000], &[10, 100, 1000]),
            },
            Figure::SizeRatio => match self.scale {
                Scale::Smallest => mixtures(&[2], &[1, 4, 64]),
                Scale::Quick => mixtures(&[10], &[1, 4, 16, 64, 256]),
                Scale::Full => mixtures(&[10], &[1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024]),
            },
            Figure::Tau | Figure::Ratio | Figure::Memory => {
                vec![Scene::Equal, Scene::FiveSizes, Scene::Burst]
            }
        }
    }

    fn sizes(&self, figure: Figure) -> &'static [usize] {
        use Figure::*;
        match (self.scale, figure) {
            (Scale::Smallest, Memory) => &[1000],
            (Scale::Smallest, Point) => &[60],
            (Scale::Smallest, _) => &[200],
            (Scale::Quick, F3a | F3b | F4) => &[1000, 10_000, 100_000],
            (Scale::Quick, F5a) => &[20_000],
            (Scale::Quick, F5b) => &[1000, 10_000],
            (Scale::Quick, Tau | Ratio | Transceivers | SizeRatio | Moves) => &[20_000],
            (Scale::Quick, Threads | Memory) => &[100_000],
            (Scale::Quick, Point) => &[100, 1000],
            (Scale::Full, F3a | F3b) => &[100, 300, 1000, 3000, 10_000, 100_000, 1_000_000, 10_000_000],
            (Scale::Full, F4) => &[1000, 3000, 10_000, 30_000, 100_000, 300_000, 1_000_000],
            (Scale::Full, F5a) => &[500_000],
            (Scale::Full, F5b) => &[1000, 10_000, 100_000, 1_000_000],
            (Scale::Full, Tau | Ratio | Transceivers | SizeRatio | Moves) => &[100_000],
            (Scale::Full, Threads) => &[10_000, 100_000, 1_000_000],
            // Trees take minutes to be built of a million, each in a process of its own.
            (Scale::Full, Memory) => &[100_000],
            (Scale::Full, Point) => &[100, 1000, 3000, 10_000],
        }
    }
}

/// So many transceivers, so many times as large as the carriers: all combinations.
fn mixtures(counts: &[u32], ratios: &[u32]) -> Vec<Scene> {
    let of =
        |&ratio: &u32| counts.iter().map(move |&count| Scene::Transceivers(Transceivers { count, ratio }));
    ratios.iter().flat_map(of).collect()
}

fn engines(figure: Figure) -> Vec<Engine> {
    let on_gpu = |algorithms: &[Algorithm]| algorithms.iter().map(|&a| Engine::Gpu(a)).collect::<Vec<_>>();
    let gpu = on_gpu(&Algorithm::GPU);
    let grids = [Algorithm::HashGrid, Algorithm::ArrayGrid, Algorithm::RecursiveGrid];
    match figure {
        Figure::F3a | Figure::F3b | Figure::Point => {
            let cpu = Algorithm::CPU.map(|a| Engine::cpu(a, None));
            cpu.into_iter().chain(gpu).collect()
        }
        Figure::F4 => {
            // In a pool of one thread.
            let ours = [Algorithm::RecursiveGrid, Algorithm::CellList, Algorithm::Auto];
            let ours = ours.map(|a| Engine::cpu(a, None));
            let trees = [Engine::BulletAsShipped, Engine::BulletTuned, Engine::Parry];
            let more = [Engine::ParryMargin, Engine::ParryOptimised, Engine::PlainCellList, Engine::Verlet];
            ours.into_iter().chain(trees).chain(more).collect()
        }
        Figure::Moves => {
            let ours = [Algorithm::CellList, Algorithm::Auto].map(|a| Engine::cpu(a, None));
            ours.into_iter().chain([Engine::PlainCellList, Engine::Verlet, Engine::Lammps]).collect()
        }
        Figure::F5a | Figure::F5b => {
            // The paper's grid, and what the GPU path takes for so many spheres: few are compared all with all.
            let gpu = on_gpu(&[Algorithm::LazyGrid, Algorithm::Auto]);
            let cpu = [Engine::cpu(Algorithm::Auto, None), Engine::Octree, Engine::SortAndSweep];
            gpu.into_iter().chain(cpu).collect()
        }
        Figure::Tau => [4, 8, 16, 32, 64, 128, 256, 512, 1024]
            .map(|tau| Engine::Cpu {
                algorithm: Algorithm::RecursiveGrid,
                threads: None,
                tau: Some(tau),
                ratio: None,
            })
            .into(),
        Figure::Ratio => {
            let ratios = [0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0];
            let of = |algorithm| {
                ratios.map(|ratio| Engine::Cpu { algorithm, threads: None, tau: None, ratio: Some(ratio) })
            };
            grids.into_iter().flat_map(of).collect()
        }
        Figure::Threads => {
            let cores = std::thread::available_parallelism().map_or(1, usize::from);
            let threads = || std::iter::successors(Some(1), |t| Some(t * 2)).take_while(|&t| t < cores);
            let of = |algorithm| {
                threads().chain([cores]).map(move |threads| Engine::cpu(algorithm, Some(threads)))
            };
            grids.into_iter().chain([Algorithm::CellList]).flat_map(of).collect()
        }
        Figure::Memory => Engine::for_memory(),
        Figure::Transceivers | Figure::SizeRatio => {
            let ours = grids.into_iter().chain([Algorithm::CellList, Algorithm::Auto]);
            let peers = [Engine::BulletTuned, Engine::Parry, Engine::PlainCellList];
            let earlier = [Engine::SortAndSweep, Engine::Octree];
            ours.map(|a| Engine::cpu(a, None)).chain(peers).chain(earlier).collect()
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    /// Or one would take what another left in the folder, or stand in another's place in a table.
    #[test]
    fn every_point_has_a_file_and_every_row_a_place_of_its_own() {
        for scale in [Scale::Smallest, Scale::Quick, Scale::Full] {
            let (only, command) = (Figure::ALL.to_vec(), String::new());
            let points = Settings { scale, only, runs: None, minutes: 1.0, seed: 1, command }.points();
            let files: BTreeSet<String> = points.iter().map(Point::key).collect();
            assert_eq!(files.len(), points.len(), "{scale:?}");
            let place = |point: &Point, engine: Engine| {
                let setting = point.setting(engine).map(f64::to_bits);
                (point.figure, point.kind(), point.n, setting, engine.to_string())
            };
            let rows = || points.iter().flat_map(|p| p.engines.iter().map(move |&e| place(p, e)));
            assert_eq!(rows().count(), rows().collect::<BTreeSet<_>>().len(), "{scale:?}");
        }
    }
}
