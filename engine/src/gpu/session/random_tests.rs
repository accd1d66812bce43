//! Random sequences of calls, two in flight, with retries, windows and continuations.

use std::ops::ControlFlow;

use lazygrid_kernels::{Interaction, Interactions, Sphere};

use super::*;
use crate::gpu::detector::GpuSpheres;
use crate::gpu::device::device_or_skip;
use crate::gpu::test_support::{Random, with_binding_limit};

const ALGORITHMS: [Algorithm; 6] = [
    Algorithm::Auto,
    Algorithm::Naive,
    Algorithm::ArrayGrid,
    Algorithm::EagerGrid,
    Algorithm::LazyGrid,
    Algorithm::CellList,
];
const SKINS: [Option<f32>; 4] = [None, Some(0.0625), Some(0.25), Some(2.0)];
const STEPS: usize = 70;

fn below(random: &mut Random, end: u32) -> u32 {
    (random.bits() >> 33) as u32 % end
}

#[derive(Debug)]
struct Scene {
    spheres: Vec<Sphere>,
    species: Vec<u32>,
    pairs: Vec<Pair>,
}

/// Coordinates and radii are multiples of a power of two, so that results agree exactly.
fn scene(random: &mut Random, number: u32) -> Vec<Sphere> {
    let mut cloud = |spheres: u32| -> Vec<Sphere> {
        let sphere = |_| {
            let center = [(); 3].map(|()| below(random, 512) as f32 / 64.0);
            Sphere::new(center, (1 + below(random, 24)) as f32 / 64.0)
        };
        (0..spheres).map(sphere).collect()
    };
    match number {
        0 => vec![],
        1 => cloud(300),
        // More pairs than the first readback holds.
        2 => vec![Sphere::new([1.0; 3], 0.25); 110],
        // Several sizes at one point, so entries overflow.
        3 => {
            let center = |group: i32| [(group % 4) as f32 * 2.0, (group / 4) as f32 * 2.0, 1.0];
            (0..800).map(|k| Sphere::new(center(k % 8), 0.25 * 0.5_f32.powi(k / 8 % 12))).collect()
        }
        // In one cell, which continuations search.
        4 => {
            let tiny = (0..1200).map(|k| Sphere::new([k as f32 / 4096.0, 0.0, 0.0], 0.75 / 4096.0));
            tiny.chain(cloud(60)).collect()
        }
        // More pairs than an output holds.
        _ => vec![Sphere::new([1.0; 3], 0.25); 200],
    }
}

fn scenes(random: &mut Random, space: Space, table: Option<&Interactions>) -> Vec<Scene> {
    let mut scenes = Vec::new();
    for number in 0..6 {
        let spheres = scene(random, number);
        let mut moved = spheres.clone();
        moved.iter_mut().step_by(3).for_each(|sphere| sphere.center.x += 1.0 / 64.0);
        let species: Vec<u32> = spheres.iter().map(|_| below(random, 3)).collect();
        for spheres in [spheres, moved] {
            let is_pair = |&(i, j): &(usize, usize)| {
                let [a, b] = [i, j].map(|k| spheres[k]);
                let interaction = table.map_or(Interaction::Touch, |table| table.get(species[i], species[j]));
                let cutoff = match interaction {
                    Interaction::Touch => f64::from(a.radius) + f64::from(b.radius),
                    Interaction::Within(distance) => distance,
                    _ => return false,
                };
                space.distance_squared(a.center, b.center) <= cutoff * cutoff
            };
            let all = (0..spheres.len()).flat_map(|i| (i + 1..spheres.len()).map(move |j| (i, j)));
            let pair = |(i, j): (usize, usize)| Pair { i: i as u32, j: j as u32 };
            let pairs = all.filter(is_pair).map(pair).collect();
            scenes.push(Scene { spheres, species: species.clone(), pairs });
        }
    }
    scenes
}

#[derive(Debug)]
struct Begun {
    ticket: Ticket,
    expected: Vec<Pair>,
    algorithm: Algorithm,
    has_skin: bool,
}

struct Calls {
    random: Random,
    session: GpuSession,
    scenes: Vec<Scene>,
    has_species: bool,
    begun: Vec<Begun>,
    scene: usize,
    totals: Totals,
}

/// Shows that the calls were retried in each manner.
#[derive(Debug, Default)]
struct Totals {
    calls: u32,
    searches: u32,
    parts: u32,
    copies: u32,
    reused_layouts: u32,
    /// Calls that a candidate list answered.
    served: u32,
    /// Calls on one level instead of several.
    flattened: u32,
}

impl Calls {
    fn begin(&mut self) {
        let Self { random, session, scenes, scene, .. } = self;
        // Often the last scene, whose candidate list is still valid.
        *scene = match below(random, 3) {
            0 => *scene,
            1 => *scene ^ 1,
            _ => below(random, scenes.len() as u32) as usize,
        };
        let Scene { spheres, species, pairs } = &scenes[*scene];
        let count = spheres.len() as u32;
        let mut cut = || below(random, count + 1);
        let (window, split) = match cut() % 4 {
            0 => (GpuSpheres::ALL, cut()),
            1 => (cut()..cut(), 0),
            _ => (GpuSpheres::ALL, 0),
        };
        let is_searched =
            |pair: &&Pair| window.contains(&pair.i) && (split == 0 || (pair.i < split && pair.j >= split));
        let expected = pairs.iter().filter(is_searched).copied().collect();
        let spheres = match self.has_species {
            true => Spheres::from(spheres).with_species(species).expect("an id for each"),
            false => Spheres::from(spheres),
        };
        let algorithm = ALGORITHMS[below(random, ALGORITHMS.len() as u32) as usize];
        session.set_algorithm(algorithm).expect("it has kernels");
        let call = QueuedCall { window, split, ..session.call(algorithm) };
        // A small readback, so that pairs are copied.
        session.expected = 1 << 10;
        match session.begin_as(call, spheres) {
            Ok(ticket) => {
                let has_skin = session.skin.is_some();
                self.begun.push(Begun { ticket, expected, algorithm, has_skin });
            }
            Err(error) => assert_eq!((error, self.begun.len()), (Error::TooManyInFlight { calls: 2 }, 2)),
        }
        assert!(self.begun.len() <= 2);
    }

    fn finish(&mut self) {
        let Self { random, session, begun, totals, .. } = self;
        if begun.is_empty() {
            return;
        }
        let index = below(random, begun.len() as u32) as usize;
        let Begun { ticket, expected, algorithm, has_skin } = begun.swap_remove(index);
        let found = expected.len() as u64;
        let mut list = Vec::new();
        match below(random, 5) {
            0 => assert_eq!(session.finish_count(ticket), Ok(found)),
            1 if found > 0 => {
                let limit = found - 1;
                let refused = session.finish(ticket, limit).map(<[Pair]>::len);
                assert_eq!(refused, Err(Error::TooManyPairs { found, limit }));
            }
            2 => {
                let take = |pairs: &mut Vec<Pair>| {
                    list.append(pairs);
                    ControlFlow::Continue(())
                };
                session.finish_in_parts(ticket, take).expect("found");
                list.sort_unstable();
                assert!(list == expected, "{} pairs in parts, not {found}", list.len());
            }
            _ => {
                list.extend_from_slice(session.finish(ticket, found).expect("found"));
                list.sort_unstable();
                assert!(list == expected, "{} pairs, not {found}", list.len());
            }
        }
        assert_eq!(session.outcome().found(), found);
        assert!(session.submissions().searches > 0 && (has_skin || session.candidate_list_stats().is_none()));
        let SubmissionCounts { searches, reused_layouts, parts, copies } = session.submissions();
        totals.calls += 1;
        totals.searches += searches;
        totals.parts += parts;
        totals.copies += copies;
        totals.reused_layouts += reused_layouts;
        totals.served += u32::from(session.cost().is_none());
        let ran = session.algorithm();
        let is_own = match algorithm {
            Algorithm::Auto => ran != Algorithm::Auto,
            Algorithm::EagerGrid | Algorithm::LazyGrid => ran == algorithm || ran == Algorithm::ArrayGrid,
            _ => ran == algorithm,
        };
        let has_levels = matches!(algorithm, Algorithm::EagerGrid | Algorithm::LazyGrid);
        totals.flattened += u32::from(has_levels && ran != algorithm);
        assert!(is_own, "{ran} instead of {algorithm}");
    }

    fn step(&mut self) {
        match below(&mut self.random, 14) {
            0..6 => self.begin(),
            6..12 => self.finish(),
            12 if !self.begun.is_empty() => {
                let index = below(&mut self.random, self.begun.len() as u32) as usize;
                drop(self.begun.swap_remove(index));
            }
            _ => {
                let skin = SKINS[below(&mut self.random, SKINS.len() as u32) as usize];
                self.session.set_skin(skin).expect("valid");
            }
        }
    }
}

#[test]
fn random_calls_in_flight_find_the_pairs_of_a_double_loop() {
    let Some(gpu) = device_or_skip() else { return };
    let gpu = with_binding_limit(&gpu, 1 << 16);
    let mut table = Interactions::new(3, Interaction::Touch).expect("few species");
    table.set(0, 1, Interaction::Within(0.375)).expect("a known species");
    table.set(1, 1, Interaction::Never).expect("a known species");
    let mut totals = Totals::default();
    for seed in 0..6 {
        let table = (seed % 2 == 1).then_some(&table);
        let length = (seed % 4 > 1).then_some(8.0);
        let space = Space::periodic([length, None, length]).expect("valid");
        let config = GpuConfig::default()
            .pair_capacity(if seed % 3 == 0 { 1 << 13 } else { 1 << 11 })
            .cell_ratio(if seed < 3 { GpuConfig::CELL_RATIO } else { GpuConfig::MAX_CELL_RATIO })
            .max_tests_per_dispatch(1 << 18)
            .timestamps(true)
            .space(space)
            .interactions(table.cloned());
        let mut random = Random(seed);
        let scenes = scenes(&mut random, space, table);
        let session = GpuSession::new(gpu.clone(), config).expect("made");
        let has_species = table.is_some();
        let (begun, scene) = Default::default();
        let mut calls = Calls { random, session, scenes, has_species, begun, scene, totals };
        (0..STEPS).for_each(|_| calls.step());
        while !calls.begun.is_empty() {
            calls.finish();
        }
        totals = calls.totals;
    }
    let Totals { calls, searches, parts, copies, reused_layouts, served, flattened } = totals;
    assert!(searches > calls && parts > searches, "{totals:?}");
    assert!([copies, reused_layouts, served, flattened].iter().all(|&count| count > 0), "{totals:?}");
}
