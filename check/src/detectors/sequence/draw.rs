use glam::Vec3;
use lazygrid::{Algorithm, Interaction, Order, Skin, Space, Sphere};

use super::events::World;
use super::faults::spoil;
use super::request::{Ending, Layout, Output, Request};
use super::round;
use super::{Sequence, Settings, Step};
use crate::detectors::variant::TargetDevice;
use crate::scenes::{hard, periodic, triclinic};
use crate::{DetectorVariant, Random, SceneSeed, SpeciesSetup, TestInput};

/// Makes a sequence unrelated to the round of the same seed.
const OTHER: u64 = 0x5e90_e4ce;
/// First of the eight kinds of spaces with tilted cell vectors.
const TRICLINIC: u32 = 6;
/// Maximum number of spheres in general, and in triclinic cells, where the definition tests many images.
const MAX_SPHERES: [usize; 2] = [5000, 1300];
/// The number of spheres may grow by this factor in its space.
const MAX_NUMBER_GROWTH: usize = 4;

pub(super) fn sequence(seed: u64, variant: impl FnOnce(&mut Random) -> DetectorVariant) -> Sequence {
    let mut random = Random(seed ^ OTHER);
    let variant = DetectorVariant { skin: 0.0, ..variant(&mut random) };
    let is_on_gpu = matches!(variant.target, TargetDevice::Gpu { .. });
    let mut world = world(&mut random, variant);
    let settings = Settings {
        variant,
        skin: skin(&mut random, variant, world.radius),
        order: if random.below(3) == 0 { Order::Unordered } else { Order::Canonical },
        max_pairs: if random.below(6) == 0 { random.below(400).into() } else { u64::from(u32::MAX) },
        space: world.scenario.space,
        rows: world.scenario.mixture.as_ref().map(|mixture| mixture.rows.clone()),
    };
    let calls = if is_on_gpu { 3 + random.below(6) } else { 3 + random.below(12) };
    let steps = (0..calls).map(|k| step(&mut random, &mut world, k)).collect();
    Sequence { seed, settings, steps }
}

/// Prefers algorithms that keep candidates.
pub(super) fn variant(random: &mut Random, on_cpu: bool, on_gpu: bool) -> DetectorVariant {
    let variant = round::variant(random, on_cpu, on_gpu);
    let keeper = [Algorithm::Auto, Algorithm::CellList][random.below(2) as usize];
    let threads = [Some(1), Some(1), None, None, None, Some(2), Some(2), Some(7)][random.below(8) as usize];
    let target = match variant.target {
        TargetDevice::Cpu { simd, .. } => TargetDevice::Cpu { simd, threads },
        on_gpu => on_gpu,
    };
    DetectorVariant {
        target,
        algorithm: if random.below(3) == 0 { variant.algorithm } else { keeper },
        ..variant
    }
}

fn skin(random: &mut Random, variant: DetectorVariant, radius: f32) -> Skin {
    let may_use_candidates = matches!(variant.algorithm, Algorithm::Auto | Algorithm::CellList);
    match random.below(12) {
        0 => Skin::Off,
        1..=6 => Skin::Auto,
        _ if !may_use_candidates => Skin::Auto,
        _ => {
            let skin_in_radii = [0.01, 0.1, 0.5, 0.5, 2.0, 20.0][random.below(6) as usize];
            Skin::Fixed((skin_in_radii * radius).clamp(1e-14, 1e17).into())
        }
    }
}

/// Prefers numbers near the crossover to a cell list.
pub(super) fn number(random: &mut Random, variant: DetectorVariant, most: usize) -> usize {
    let is_on_gpu = matches!(variant.target, TargetDevice::Gpu { .. });
    let about_crossover = if variant.algorithm == Algorithm::Auto { 9 } else { 4 };
    let n = match random.below(16) {
        0 => random.below(5),
        k if k <= about_crossover && is_on_gpu => 200 + random.below(300),
        k if k <= about_crossover => 380 + random.below(900),
        15 if !is_on_gpu && random.below(4) == 0 => 1000 + random.below(4000),
        14 | 15 => 100 + random.below(600),
        _ => 5 + random.below(100),
    };
    (n as usize).min(most)
}

fn world(random: &mut Random, variant: DetectorVariant) -> World {
    // Sizes far from 1 make the detector give up candidate lists.
    let scales = [1.0, 1.0, 1.0, 1.0, 0.01, 37.0, 1e-12, 1e12];
    let radius = scales[random.below(8) as usize];
    let family = random.below(8);
    let mut world = World {
        scenario: TestInput::default(),
        history: Vec::new(),
        radius,
        extent: [radius; 3],
        motion: [0.0, 1e-6, 1e-3, 1e-3, 0.01, 0.01, 0.05, 0.3][random.below(8) as usize],
        calm: [4, 6, 8][random.below(3) as usize],
        variant,
        most: 600,
        held: 0,
    };
    if family == 0 {
        world.scenario = adversarial(random);
        world.radius = crate::scenes::motion::stride(&world.scenario.spheres);
        world.extent = [4.0 * world.radius; 3];
    } else {
        let space = random.below(8);
        let n = number(random, variant, MAX_SPHERES[usize::from(space >= TRICLINIC)]);
        world.most = MAX_SPHERES[usize::from(space >= TRICLINIC)].min(MAX_NUMBER_GROWTH * n + 500);
        let neighbors = [0.3, 2.0, 2.0, 8.0][random.below(4) as usize];
        let side = world.radius * (n.max(8) as f32 * 33.5 / neighbors).cbrt();
        let shape = [[1.0; 3], [1.0; 3], [1.0, 1.3, 0.8], [4.0, 4.0, 0.05]][random.below(4) as usize];
        world.extent = shape.map(|relative| relative * side);
        world.scenario.space = draw_space(random, space, world.extent);
        world.scenario.spheres = world.new_spheres(random, n);
    }
    if random.below(2) == 0 {
        let rows = rows(random, world.radius);
        let species = world.scenario.spheres.iter().map(|_| random.below(rows.len() as u32)).collect();
        world.scenario.mixture = Some(SpeciesSetup { species, rows });
    }
    if random.below(5) == 0 {
        world.change_exclusions(random);
    }
    world
}

fn adversarial(random: &mut Random) -> TestInput {
    let elements = 5 + random.below(150) as usize;
    let words = SceneSeed::drawn(random, elements);
    let family = random.below((hard::FAMILIES.len() + periodic::FAMILIES.len()) as u32) as usize;
    match hard::FAMILIES.get(family) {
        Some(family) => (family.spheres)(&words).into(),
        None => (periodic::FAMILIES[family - hard::FAMILIES.len()].scene)(&words),
    }
}

fn draw_space(random: &mut Random, kind: u32, extent: [f32; 3]) -> Space {
    let mut length = |k: usize| {
        let factor = [1.0, 1.0, 0.7, 1.5, 0.2][random.below(5) as usize];
        (random.below(4) != 0).then_some(extent[k] * factor)
    };
    let lengths = [length(0), length(1), length(2)];
    match kind {
        0..=3 => Space::UNBOUNDED,
        4 | 5 => periodic::space(lengths),
        TRICLINIC.. => {
            let mut tilt = |along: usize| (2.0 * random.unit() - 1.0) * 0.8 * extent[along];
            let tilts = [tilt(0), tilt(0), tilt(1)];
            triclinic::space(triclinic::tilted(lengths, tilts))
        }
    }
}

/// Interactions of the first species ignore radii.
fn rows(random: &mut Random, radius: f32) -> Vec<Vec<Interaction>> {
    let count = 1 + random.below(4);
    let mut interaction = |may_touch: bool| match random.below(8) {
        0 | 1 => Interaction::Never,
        2..=5 if may_touch => Interaction::Touch,
        _ => {
            let factor = [0.0, 0.5, 1.0, 2.0, 2.0, 4.0][random.below(6) as usize];
            Interaction::Within((radius * factor).into())
        }
    };
    (0..count).map(|a| (0..=a).map(|b| interaction(b > 0)).collect()).collect()
}

fn step(random: &mut Random, world: &mut World, k: u32) -> Step {
    let before = world.scenario.clone();
    let mut changes = if k > 0 { change(random, world, k) } else { Vec::new() };
    let mut request = request(random, world.scenario.spheres.len());
    world.remember(before.clone());
    let mut scenario = world.scenario.clone();
    if random.below(if changes.is_empty() { 14 } else { 5 }) == 0 {
        changes.push(spoil(random, &mut scenario, world.radius));
        if random.below(4) == 0 {
            world.scenario = before;
        } else {
            world.held = world.held.max(1);
        }
    } else if random.below(60) == 0 {
        request.has_foreign_exclusions = true;
    }
    Step { scenario, changes, request }
}

/// Small steps get no name.
fn change(random: &mut Random, world: &mut World, k: u32) -> Vec<&'static str> {
    if world.held > 0 {
        world.held -= 1;
        return vec!["still"];
    }
    // Lets the detector build a candidate list.
    let most = if k < 3 { world.calm.max(8) } else { world.calm };
    match random.below(10) {
        kind if kind < most => {
            world.walk(random);
            Vec::new()
        }
        _ if random.below(4) == 0 => vec!["still"],
        _ if random.below(5) == 0 => vec![world.back(random)],
        _ => {
            let events = 1 + random.below(3) / 2;
            world.held = random.below(3);
            (0..events).map(|_| world.event(random)).collect()
        }
    }
}

fn request(random: &mut Random, spheres: usize) -> Request {
    let output = match random.below(20) {
        0..=8 => Output::List,
        9..=12 => Output::Count,
        13 | 14 => Output::Neighbors,
        _ => {
            let at = 1 + random.below(3) as usize;
            let ending = match random.below(10) {
                0..=4 => Ending::All,
                5 | 6 => Ending::Break(at),
                7 | 8 => Ending::Panic(at),
                _ => Ending::Stop(at),
            };
            Output::Stream { chunk: [1, 7, 64, 1 << 20][random.below(4) as usize], ending }
        }
    };
    Request {
        output,
        split: (random.below(9) == 0).then(|| random.below(spheres as u32 + 1) as usize),
        layout: match random.below(7) {
            0 => Layout::Columns,
            1 => Layout::WideRows,
            _ => Layout::Rows,
        },
        is_stopped: random.below(40) == 0,
        has_foreign_exclusions: false,
    }
}

pub(super) fn random_position(random: &mut Random, extent: [f32; 3]) -> Vec3 {
    Vec3::from(extent.map(|extent| random.unit() * extent))
}

pub(super) fn radius(random: &mut Random, kind: u32, k: usize, radius: f32) -> f32 {
    let powers = |most: usize| 0.5_f32.powi((k % most) as i32);
    radius
        * match kind {
            0..=2 => 1.0,
            3 => powers(2),
            4 => powers(4),
            5 => powers(9),
            6 => (-6.0 * random.unit()).exp2(),
            7 => [0.0, 1.0, 0.5][random.below(3) as usize],
            8 if k == 0 => 12.0,
            8 => 0.3,
            _ => 0.0,
        }
}

pub(super) fn at_new_positions(random: &mut Random, extent: [f32; 3], radii: &[f32]) -> Vec<Sphere> {
    radii.iter().map(|&radius| Sphere::new(random_position(random, extent), radius)).collect()
}
