use glam::DVec3;
use lazygrid::{Algorithm, Order, Simd};

use super::request::{Ending, Layout, Output, Request};
use super::{Sequence, Settings, Step};
use crate::detectors::compare::with_species;
use crate::detectors::variant::TargetDevice;
use crate::scenes::motion::{skin_of, stride, walk};
use crate::scenes::periodic::PeriodicSceneFamily;
use crate::scenes::{hard, periodic, triclinic};
use crate::{DetectorVariant, EXCLUSION_WORDS, ElementSeed, Random, SceneSeed, TestInput};

pub(super) fn round(seed: u64, on_cpu: bool, on_gpu: bool) -> Sequence {
    let mut random = Random(seed);
    let variant = variant(&mut random, on_cpu, on_gpu);
    let order = if random.below(3) == 0 { Order::Unordered } else { Order::Canonical };
    let max_pairs = if random.below(4) == 0 { random.below(50).into() } else { u64::from(u32::MAX) };
    let triclinic = (random.below(4) == 0).then(|| Triclinic::drawn(&mut random));
    let (first_output, first) = (output(&mut random), scene(&mut random, triclinic));
    let settings = Settings {
        variant,
        skin: skin_of(&first.spheres, variant.skin),
        order,
        max_pairs,
        space: first.space,
        rows: first.mixture.as_ref().map(|mixture| mixture.rows.clone()),
    };
    let mut steps = vec![step(first_output, first)];
    for _ in 0..random.below(if variant.skin > 0.0 { 6 } else { 3 }) {
        let last = &steps[steps.len() - 1].scenario;
        if variant.skin > 0.0 && random.below(4) != 0 && stays_near(last) {
            let mut moved = last.clone();
            walk(&mut moved.spheres, 0.3 * variant.skin * random.unit(), random.word());
            steps.push(step(output(&mut random), moved));
            continue;
        }
        let mut scenario = scene(&mut random, triclinic);
        scenario.space = settings.space;
        scenario.mixture = steps[0].scenario.mixture.clone().map(|mut mixture| {
            let count = mixture.rows.len() as u32;
            mixture.species = scenario.spheres.iter().map(|_| random.below(count)).collect();
            mixture
        });
        steps.push(step(output(&mut random), scenario));
    }
    Sequence { seed, settings, steps }
}

fn step(output: Output, scenario: TestInput) -> Step {
    let layout = Layout::Rows;
    let request = Request { output, split: None, layout, is_stopped: false, has_foreign_exclusions: false };
    Step { scenario, changes: Vec::new(), request }
}

/// Fixes the cell of all scenes. Spheres of another family may be too many boxes away for `f64` to
/// distinguish the images.
#[derive(Clone, Copy)]
struct Triclinic {
    family: PeriodicSceneFamily,
    setup: ElementSeed,
}

impl Triclinic {
    fn drawn(random: &mut Random) -> Self {
        let family = one_of(random, &triclinic::FAMILIES);
        Self { family, setup: SceneSeed::drawn(random, 0).setup }
    }
}

/// Returns `true` if `f64` still distinguishes images after a [walk].
fn stays_near(scenario: &TestInput) -> bool {
    let least = 1e-6 * f64::from(stride(&scenario.spheres));
    let mut cell_vectors = scenario.space.cell_vectors().into_iter().flatten();
    scenario.space.triclinic_cell().is_none()
        || cell_vectors.all(|vector| DVec3::from(vector).length() > least)
}

fn one_of<T: Copy>(random: &mut Random, values: &[T]) -> T {
    values[random.below(values.len() as u32) as usize]
}

pub(super) fn variant(random: &mut Random, on_cpu: bool, on_gpu: bool) -> DetectorVariant {
    let is_on_gpu = on_gpu && (!on_cpu || random.below(2) == 0);
    let simd = [Simd::Avx512, Simd::Avx2, Simd::Portable][random.below(3) as usize];
    let threads = [None, Some(1), Some(2), Some(7)][random.below(4) as usize];
    let target =
        if is_on_gpu { TargetDevice::Gpu { subgroups: true } } else { TargetDevice::Cpu { simd, threads } };
    let algorithms: &[Algorithm] = if is_on_gpu { Algorithm::GPU } else { Algorithm::CPU };
    let algorithm = match random.below(algorithms.len() as u32 + 1) as usize {
        0 => Algorithm::Auto,
        k => algorithms[k - 1],
    };
    let tau = [0, 1, 2, 8, 32, u32::MAX, random.below(600)][random.below(7) as usize];
    let ratio = [0.5, 1.0, 1.5, 2.0, 16.0, 0.5 + 15.5 * random.unit()][random.below(6) as usize];
    let may_use_candidates = is_on_gpu || matches!(algorithm, Algorithm::Auto | Algorithm::CellList);
    DetectorVariant {
        skin: if may_use_candidates && random.below(3) == 0 {
            [0.01, 0.3, 2.0][random.below(3) as usize]
        } else {
            0.0
        },
        tau: (random.below(2) == 0).then_some(tau),
        cell_ratio: (random.below(2) == 0).then_some(ratio),
        ..DetectorVariant::new(algorithm, target)
    }
}

fn output(random: &mut Random) -> Output {
    match random.below(4) {
        0 => Output::List,
        1 => Output::Count,
        2 => Output::Neighbors,
        _ => Output::Stream { chunk: 1 + random.below(40) as usize, ending: Ending::All },
    }
}

fn scene(random: &mut Random, triclinic: Option<Triclinic>) -> TestInput {
    let elements = match random.below(8) {
        0..3 => random.below(12),
        7 => 120 + random.below(480),
        _ => 12 + random.below(108),
    };
    let words = SceneSeed::drawn(random, elements as usize);
    let mut scenario = match triclinic {
        Some(Triclinic { family, setup }) => (family.scene)(&SceneSeed { setup, ..words }),
        None => not_triclinic(random, &words),
    };
    if random.below(4) == 0 {
        let space = scenario.space;
        scenario = TestInput { space, ..with_species(scenario.spheres, random) };
    }
    match random.below(4) {
        0 => scenario.with_exclusions(&[(); EXCLUSION_WORDS].map(|()| random.word())),
        _ => scenario,
    }
}

fn not_triclinic(random: &mut Random, words: &SceneSeed) -> TestInput {
    let mut scenario = match random.below(3) {
        0 => (one_of(random, &periodic::FAMILIES).scene)(words),
        _ => (one_of(random, &hard::FAMILIES).spheres)(words).into(),
    };
    if random.below(4) == 0 {
        let more = SceneSeed::drawn(random, words.elements.len() / 2);
        scenario.spheres.extend((one_of(random, &hard::FAMILIES).spheres)(&more));
    }
    scenario
}
