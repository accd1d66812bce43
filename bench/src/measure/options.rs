use clap::Args;

use super::Plan;
use lazygrid_io::scenes::Scene;

/// The options that all benchmark programs share.
#[derive(Args, Clone, Debug)]
pub struct Options {
    /// Scenes, separated by commas
    #[arg(long, value_delimiter = ',', default_values_t = [Scene::Equal, Scene::FiveSizes, Scene::Burst])]
    pub scene: Vec<Scene>,
    /// Numbers of spheres, separated by commas
    #[arg(long, value_delimiter = ',', default_values_t = [100_000])]
    pub n: Vec<usize>,
    /// Rounds, after one to warm up
    #[arg(long, default_value_t = 9)]
    pub rounds: usize,
    /// Steps of each contender in each round
    #[arg(long, default_value_t = 10)]
    pub steps: usize,
    /// Seed of the spheres and their motion
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Displacement of a sphere per step, in radii
    #[arg(long, default_value_t = Scene::STEP)]
    pub step_length: f32,
    #[command(flatten)]
    mode: QuickMode,
}

/// The choice between measurements and a quick check, which benchmark programs share.
#[derive(Args, Clone, Debug)]
pub struct QuickMode {
    /// Check answers at small sizes instead of measuring (the default except in `cargo bench`)
    #[arg(long)]
    quick: bool,
    #[arg(long, hide = true)]
    bench: bool,
}

impl QuickMode {
    pub fn is_quick(&self) -> bool {
        self.quick || !self.bench
    }
}

impl Options {
    pub fn is_quick(&self) -> bool {
        self.mode.is_quick()
    }

    pub fn shrunk(self) -> Self {
        if self.is_quick() { Self { n: vec![300], rounds: 1, steps: 2, ..self } } else { self }
    }

    pub fn plans(&self) -> Vec<Plan> {
        let Self { rounds, steps, seed, step_length, .. } = *self;
        let plans_of_scene = |scene: Scene| {
            self.n.iter().map(move |&n| Plan { scene, n, seed, rounds, steps, step_length, fresh: false })
        };
        self.scene.iter().flat_map(|&scene| plans_of_scene(scene)).collect()
    }
}
