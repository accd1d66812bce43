//! Calls of one session that reuse the cells of an earlier call.

use std::cell::Cell;

use lazygrid::gpu::{GpuConfig, GpuDevice, GpuSession};
use lazygrid::{Algorithm, Backend, Interaction, Space, Sphere};
use lazygrid_tests::{SpeciesSetup, TestInput, Tolerance, difference, variants};
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::select;

use crate::properties::check;

#[derive(Clone, Copy, Debug)]
enum Change {
    Drift(f32),
    Jump(f32),
    Radius(usize, f32),
    Position(usize, f32),
    Radii(f32),
    Point,
    Spread(f32),
    Species(u32),
    Truncate(usize),
    Repeat(usize),
}

fn change() -> impl Strategy<Value = Change> {
    let extreme =
        || select(vec![f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, -1.0, 0.0, 1e-30, 1e19]);
    prop_oneof![
        8 => (-0.3_f32..0.3).prop_map(Change::Drift),
        2 => select(vec![-1e6_f32, -300.0, 40.0, 1e9]).prop_map(Change::Jump),
        2 => (0..400_usize, select(vec![0.3_f32, 0.9, 1.5, 4.0, 100.0])).prop_map(|(k, r)| Change::Radius(k, r)),
        1 => (0..400_usize, extreme()).prop_map(|(k, r)| Change::Radius(k, r)),
        1 => (0..400_usize, extreme()).prop_map(|(k, x)| Change::Position(k, x)),
        1 => select(vec![0.01_f32, 0.7, 1.3, 30.0]).prop_map(Change::Radii),
        1 => Just(Change::Point),
        1 => select(vec![0.5_f32, 3.0, 100.0]).prop_map(Change::Spread),
        1 => (1..3_u32).prop_map(Change::Species),
        1 => (0..400_usize).prop_map(Change::Truncate),
        1 => (0..100_usize).prop_map(Change::Repeat),
    ]
}

impl Change {
    fn apply(self, input: &mut TestInput) {
        let count = input.spheres.len().max(1);
        let spheres = &mut input.spheres;
        let directions = [[1.0, 0.3, -0.7], [-0.9, 0.5, 0.2], [0.1, -1.0, 0.6]];
        match self {
            Self::Drift(by) => (0..).zip(spheres).for_each(|(k, sphere): (usize, _)| {
                sphere.center += glam::Vec3::from(directions[k % 3]) * by;
            }),
            Self::Jump(by) => spheres.iter_mut().for_each(|sphere| sphere.center += by),
            Self::Radius(k, radius) => {
                spheres.iter_mut().skip(k % count).take(1).for_each(|s| s.radius = radius)
            }
            Self::Position(k, x) => spheres.iter_mut().skip(k % count).take(1).for_each(|s| s.center.y = x),
            Self::Radii(factor) => spheres.iter_mut().for_each(|sphere| sphere.radius *= factor),
            Self::Point => spheres.iter_mut().for_each(|sphere| sphere.center = [1.5; 3].into()),
            Self::Spread(factor) => spheres.iter_mut().for_each(|sphere| sphere.center *= factor),
            Self::Species(by) => {
                let species = input.mixture.iter_mut().flat_map(|mixture| &mut mixture.species);
                species.for_each(|id| *id = (*id + by) % 3);
            }
            Self::Truncate(length) => {
                spheres.truncate(length);
                input.mixture.iter_mut().for_each(|mixture| mixture.species.truncate(length));
            }
            Self::Repeat(more) => {
                spheres.extend_from_within(..more.min(spheres.len()));
                if let Some(mixture) = &mut input.mixture {
                    mixture.species.extend_from_within(..more.min(mixture.species.len()));
                }
            }
        }
    }
}

fn start() -> impl Strategy<Value = TestInput> {
    let sphere = ([0_u32..1024, 0..1024, 0..1024], 0..5_usize).prop_map(|(at, size)| {
        Sphere::new(at.map(|x| x as f32 / 64.0 - 3.0), [0.5, 0.4, 0.2, 0.06, 0.02][size])
    });
    let lengths = select(vec![[None; 3], [Some(16.0), None, Some(17.5)], [Some(2.0); 3]]);
    (vec(sphere, 1..400), lengths, any::<bool>()).prop_map(|(spheres, lengths, has_species)| {
        let species = (0..spheres.len() as u32).map(|k| k % 3).collect();
        let rows = vec![
            vec![Interaction::Touch],
            vec![Interaction::Within(0.75), Interaction::Never],
            vec![Interaction::Never, Interaction::Touch, Interaction::Never],
        ];
        let mixture = has_species.then_some(SpeciesSetup { species, rows });
        let space = Space::periodic(lengths).expect("valid lengths");
        TestInput { space, mixture, ..spheres.into() }
    })
}

fn settings() -> impl Strategy<Value = GpuConfig> {
    let tau = select(vec![0, 1, 8, GpuConfig::TAU, u32::MAX]);
    (tau, select(vec![0, u32::MAX]), select(vec![1.5_f32, 2.0, 8.0])).prop_map(|(tau, radix, ratio)| {
        let config = GpuConfig::default().algorithm(Algorithm::CellList);
        config.tau(tau).radix_sort_from(radix).cell_ratio(ratio)
    })
}

fn device() -> Option<GpuDevice> {
    let has_gpu = variants::all().iter().any(|variant| variant.backend() == Backend::Gpu);
    lazygrid_tests::device().filter(|_| has_gpu)
}

#[derive(Default)]
struct Tally {
    calls: Cell<u32>,
    reused: Cell<u32>,
    refused: Cell<u32>,
}

fn session(gpu: &GpuDevice, config: &GpuConfig, input: &TestInput) -> Result<GpuSession, String> {
    let table = input.interactions().map_err(|error| error.to_string())?;
    let config = config.clone().interactions(table).space(input.space);
    GpuSession::new(gpu.clone(), config).map_err(|error| error.to_string())
}

#[test]
fn answers_do_not_depend_on_reused_cells() {
    let Some(gpu) = device() else { return };
    let tally = Tally::default();
    let add = |to: &Cell<u32>, more: u32| to.set(to.get() + more);
    check(150, (start(), settings(), vec(change(), 1..10)), |(mut input, config, changes)| {
        let mut session = session(&gpu, &config, &input)?;
        for change in [None, None].into_iter().chain(changes.into_iter().map(Some)) {
            if let Some(change) = change {
                change.apply(&mut input);
            }
            let ticket = session.begin(input.view()).map_err(|error| error.to_string())?;
            let found = session.finish(ticket, u64::MAX).map_err(|error| error.to_string())?.to_vec();
            let counts = session.submissions();
            add(&tally.calls, 1);
            add(&tally.reused, u32::from(counts.reused_layouts == counts.searches));
            add(
                &tally.refused,
                u32::from(counts.reused_layouts < counts.searches && counts.reused_layouts > 0),
            );
            difference(&input, &found, &input.oracle_of_valid(), Tolerance::Tangent)
                .map_err(|text| format!("{change:?}, {counts:?}: {text}"))?;
        }
        Ok(())
    });
    let (calls, reused, refused) = (tally.calls.get(), tally.reused.get(), tally.refused.get());
    let enough = 20.min(calls / 20);
    assert!(
        reused >= enough && refused >= enough,
        "of {calls} calls {reused} reused cells, {refused} could not"
    );
}

#[test]
fn spheres_that_outgrow_their_cells_find_their_pairs() {
    let Some(gpu) = device() else { return };
    let at = |k: u32| [k % 9, k / 9 % 9, k / 81].map(|x| 1.4 * x as f32);
    let mut input = TestInput::from((0..729).map(|k| Sphere::new(at(k), 0.5)).collect::<Vec<_>>());
    let config = GpuConfig::default().algorithm(Algorithm::CellList).cell_ratio(1.5);
    let mut session = session(&gpu, &config, &input).expect("a session");
    for (call, radius) in [0.5, 0.5, 0.95, 0.95, 0.5].into_iter().enumerate() {
        // The radius stays in its size class, so the level does not change.
        input.spheres.iter_mut().step_by(7).for_each(|sphere| sphere.radius = radius);
        let ticket = session.begin(input.view()).expect("valid spheres");
        let found = session.finish(ticket, u64::MAX).expect("pairs").to_vec();
        difference(&input, &found, &input.oracle_of_valid(), Tolerance::Tangent)
            .unwrap_or_else(|text| panic!("call {call}: {text}"));
    }
}
