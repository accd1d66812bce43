//! Compares searches for pairs of the same spheres, in interleaved rounds.

mod finders;
pub mod memory;
mod options;
mod present;

use std::error::Error;
use std::hint::black_box;
use std::time::{Duration, Instant};

use lazygrid::{Config, Detector, Pair, PhaseTime, Sphere};
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use crate::SpeciesScene;
use lazygrid_check::checksum;
use lazygrid_io::scenes::Scene;

use finders::{Count, List, Stream};
pub use options::{Options, QuickMode};
pub use present::{Spread, markdown, provenance};

#[derive(Clone, Copy, Debug)]
pub enum Found<'a> {
    Pairs(&'a [Pair]),
    Count(u64),
}

pub trait PairFinder {
    /// Receives the spheres, untimed, for programs with their own memory.
    fn prepare(&mut self, _spheres: &[Sphere]) -> Result<(), Box<dyn Error>> {
        Ok(())
    }

    /// The spheres have moved slightly since the last call.
    fn run(&mut self, spheres: &[Sphere]) -> Result<Found<'_>, Box<dyn Error>>;

    /// Returns the phases of the last call; empty if unknown.
    fn phases(&self) -> Vec<PhaseTime> {
        Vec::new()
    }

    fn gpu_time(&self) -> Option<Duration> {
        None
    }

    fn note(&self) -> String {
        String::new()
    }
}

pub type Make = Box<dyn Fn() -> Result<Box<dyn PairFinder>, Box<dyn Error>>>;

pub struct ContenderFactory {
    pub name: String,
    pub make: Make,
}

impl ContenderFactory {
    pub fn new<S: PairFinder + 'static>(
        name: impl Into<String>,
        make: impl Fn() -> Result<S, Box<dyn Error>> + 'static,
    ) -> Self {
        Self { name: name.into(), make: Box::new(move || Ok(Box::new(make()?))) }
    }

    pub fn list(name: impl Into<String>, config: Config) -> Self {
        Self::new(name, move || Ok(List { detector: Detector::new(config.clone())?, species: None }))
    }

    pub fn list_by_species(name: impl Into<String>, config: Config, scene: SpeciesScene) -> Self {
        Self::new(name, move || {
            let detector = Detector::new(config.clone().interactions(scene.table()?))?;
            Ok(List { detector, species: Some((scene, Vec::new())) })
        })
    }

    pub fn count(name: impl Into<String>, config: Config) -> Self {
        Self::new(name, move || Ok(Count(Detector::new(config.clone())?)))
    }

    pub fn stream(name: impl Into<String>, config: Config) -> Self {
        Self::new(name, move || Ok(Stream(Detector::new(config.clone())?)))
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Plan {
    pub scene: Scene,
    pub n: usize,
    pub seed: u64,
    /// Measured rounds, after one to warm up.
    pub rounds: usize,
    /// Steps per contender and round, at least one.
    pub steps: usize,
    /// Displacement per step, in radii.
    pub step_length: f32,
    /// `true` creates a new search at each step.
    pub fresh: bool,
}

#[derive(Clone, Debug)]
pub struct Timing {
    pub name: String,
    /// Nanoseconds per sphere and step, by round.
    pub nanos: Vec<f64>,
    pub note: String,
    pub pairs: u64,
}

impl Timing {
    pub fn median(&self) -> f64 {
        Spread::from_values(&self.nanos).median
    }

    /// Returns a ratio per round.
    pub fn over(&self, other: &Self) -> Spread {
        let ratios: Vec<f64> = self.nanos.iter().zip(&other.nanos).map(|(a, b)| a / b).collect();
        Spread::from_values(&ratios)
    }
}

/// A digest that ignores the order of pairs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Digest {
    pub pairs: u64,
    /// `None` if pairs were only counted.
    pub sum: Option<u64>,
}

impl Digest {
    pub fn from_found(found: &Found<'_>) -> Self {
        match found {
            Found::Count(pairs) => Self { pairs: *pairs, sum: None },
            Found::Pairs(pairs) => Self { pairs: pairs.len() as u64, sum: Some(checksum(pairs)) },
        }
    }

    /// Returns `true` if the counts and, if both exist, the checksums are equal.
    pub fn agrees(&self, other: &Self) -> bool {
        self.pairs == other.pairs && (self.sum.is_none() || other.sum.is_none() || self.sum == other.sum)
    }
}

/// Runs all contenders on the same moving spheres, and compares their pairs with the first that lists them,
/// untimed. Every contender runs every step, because a skipped step would double the next displacement.
pub fn compare(plan: &Plan, contenders: &[ContenderFactory]) -> Result<Vec<Timing>, Box<dyn Error>> {
    let mut runs = contenders.iter().map(ContenderRun::new).collect::<Result<Vec<_>, _>>()?;
    let mut motion = MovingScene::new(plan);
    // All contenders read the same memory, as in a simulation.
    let mut now = motion.frames[0].clone();
    for round in 0..=plan.rounds {
        let frames = motion.next_round();
        let mut expected = vec![None; frames.len()];
        for k in random_order(runs.len(), plan.seed.wrapping_add(round as u64)) {
            runs[k].play(plan, frames, &mut expected, &mut now)?;
        }
    }
    Ok(runs.into_iter().map(ContenderRun::timing).collect())
}

/// A random order: in a rotation, each contender would keep its predecessor.
pub fn random_order(count: usize, seed: u64) -> Vec<usize> {
    let mut random_order: Vec<usize> = (0..count).collect();
    random_order.shuffle(&mut ChaCha8Rng::seed_from_u64(seed));
    random_order
}

struct MovingScene {
    seed: u64,
    step_length: f32,
    step: u32,
    frames: Vec<Vec<Sphere>>,
}

impl MovingScene {
    fn new(plan: &Plan) -> Self {
        let start = plan.scene.spheres(plan.n, plan.seed);
        Self {
            seed: plan.seed,
            step_length: plan.step_length,
            step: 0,
            frames: vec![start; plan.steps.max(1)],
        }
    }

    fn next_round(&mut self) -> &[Vec<Sphere>] {
        let mut last = self.frames[self.frames.len() - 1].clone();
        for frame in &mut self.frames {
            Scene::advance_by(self.step_length, &mut last, self.seed, self.step);
            self.step += 1;
            frame.copy_from_slice(&last);
        }
        &self.frames
    }
}

struct ContenderRun<'a> {
    contender: &'a ContenderFactory,
    search: Box<dyn PairFinder>,
    timing: Timing,
}

impl<'a> ContenderRun<'a> {
    fn new(contender: &'a ContenderFactory) -> Result<Self, Box<dyn Error>> {
        let timing = Timing { name: contender.name.clone(), nanos: vec![], note: String::new(), pairs: 0 };
        Ok(Self { contender, search: (contender.make)()?, timing })
    }

    fn play(
        &mut self,
        plan: &Plan,
        frames: &[Vec<Sphere>],
        expected: &mut [Option<Digest>],
        now: &mut [Sphere],
    ) -> Result<(), Box<dyn Error>> {
        let mut total = Duration::ZERO;
        for (k, frame) in frames.iter().enumerate() {
            now.copy_from_slice(frame);
            if plan.fresh {
                self.search = (self.contender.make)()?;
            }
            self.search.prepare(now)?;
            let start = Instant::now();
            let found = black_box(self.search.run(black_box(now))?);
            let time = start.elapsed();
            let digest = Digest::from_found(&found);
            let reference = expected[k].get_or_insert(digest);
            if !digest.agrees(reference) {
                return Err(format!(
                    "{} found {digest:?}, but an earlier search found {reference:?}: {} of {}, step {k} of a round",
                    self.timing.name, plan.scene, plan.n
                )
                .into());
            }
            if reference.sum.is_none() {
                *reference = digest;
            }
            self.timing.pairs = digest.pairs;
            total += time;
        }
        self.timing.nanos.push(total.as_nanos() as f64 / frames.len() as f64 / plan.n.max(1) as f64);
        Ok(())
    }

    fn timing(self) -> Timing {
        let nanos = self.timing.nanos[1..].to_vec();
        Timing { nanos, note: self.search.note(), ..self.timing }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Fixed(Vec<Pair>);

    impl PairFinder for Fixed {
        fn run(&mut self, _: &[Sphere]) -> Result<Found<'_>, Box<dyn Error>> {
            Ok(Found::Pairs(&self.0))
        }
    }

    fn fixed(pairs: &'static [[u32; 2]]) -> ContenderFactory {
        ContenderFactory::new("fixed", || Ok(Fixed(pairs.iter().map(|&[i, j]| Pair::new(i, j)).collect())))
    }

    const PLAN: Plan = Plan {
        scene: Scene::Equal,
        n: 10,
        seed: 1,
        rounds: 3,
        steps: 2,
        step_length: Scene::STEP,
        fresh: false,
    };

    #[test]
    fn answers_are_compared_as_sets() {
        let timings = compare(&PLAN, &[fixed(&[[0, 1], [2, 3]]), fixed(&[[2, 3], [0, 1]])]);
        let timings = timings.expect("the same set");
        assert_eq!((timings[0].nanos.len(), timings[1].pairs), (3, 2));
        let wrong = compare(&PLAN, &[fixed(&[[0, 1], [2, 3]]), fixed(&[[0, 2], [1, 3]])]);
        assert!(wrong.is_err_and(|e| e.to_string().contains("equal of 10")));
        assert!(compare(&PLAN, &[fixed(&[[0, 1]]), fixed(&[])]).is_err());
    }

    #[test]
    fn all_contenders_run_and_predecessors_change() {
        let mut before_the_last = std::collections::BTreeSet::new();
        for seed in 0..50 {
            let random_order = random_order(5, seed);
            let position = |k| {
                random_order.iter().position(|&contender| contender == k).expect("each contender has a turn")
            };
            assert_eq!((random_order.len(), (0..5).map(position).sum::<usize>()), (5, 10));
            before_the_last.insert(position(4).checked_sub(1).map(|position| random_order[position]));
        }
        assert_eq!(before_the_last.len(), 5, "none and each of the other four");
    }

    #[test]
    fn ratios_are_taken_within_rounds() {
        let timing = |nanos: &[f64]| Timing {
            name: String::new(),
            nanos: nanos.to_vec(),
            note: String::new(),
            pairs: 0,
        };
        let ratio = timing(&[2.0, 40.0, 6.0]).over(&timing(&[1.0, 20.0, 2.0]));
        assert_eq!(ratio, Spread { median: 2.0, low: 2.0, high: 3.0 });
    }
}
