use crate::common::{Random, device, download, limited, scenes, submit, upload};
use lazygrid::gpu::{
    GpuConfig, GpuDevice, GpuSkinDetector, GpuSpheres, Outcome, SkinState, SphereCount, wgpu,
};
use lazygrid::{Algorithm, Interaction, Pair, Space, Sphere};
use lazygrid_check::scenes::cloud;
use lazygrid_check::{SpeciesSetup, TestInput};

fn ask(
    gpu: &GpuDevice,
    detector: &mut GpuSkinDetector,
    scenario: &TestInput,
) -> (Outcome, Vec<Pair>, SkinState) {
    let n = scenario.spheres.len() as u32;
    let at_most = n + 5;
    let input = upload(gpu, &[&scenario.spheres[..], &[Sphere::default(); 5]].concat());
    let species =
        scenario.mixture.as_ref().map(|mixture| upload(gpu, &[&mixture.species[..], &[0; 5]].concat()));
    let known = upload(gpu, &[n]);
    let count = if n.is_multiple_of(2) {
        SphereCount::Host(n)
    } else {
        SphereCount::Buffer { buffer: &known, at_most }
    };
    let spheres = GpuSpheres::new(&input, count);
    let spheres = species.iter().fold(spheres, |spheres, species| spheres.with_species(species));
    let output = submit(gpu, |encoder| detector.encode(encoder, &spheres)).expect("recorded");
    let outcome = download::<Outcome>(gpu, &output.outcome, 1)[0];
    let state = download::<SkinState>(gpu, detector.state().expect("after a call"), 1)[0];
    (outcome, download(gpu, &output.pairs, outcome.found().min(output.capacity.into()) as usize), state)
}

fn verify(gpu: &GpuDevice, detector: &mut GpuSkinDetector, scenario: &TestInput, case: &str) -> SkinState {
    let (outcome, pairs, state) = ask(gpu, detector, scenario);
    assert_eq!(outcome.overflow, 0, "{case}: {outcome:?}");
    let invalid = scenario.spheres.iter().filter(|sphere| !sphere.is_valid()).count();
    assert_eq!(outcome.quarantined as usize, invalid, "{case}");
    scenes::verify(case, scenario, &pairs);
    state
}

fn walk(spheres: &mut [Sphere], radii: f32, random: &mut Random) {
    for sphere in spheres {
        let far = if sphere.radius.is_finite() { radii * sphere.radius } else { radii };
        sphere.center += glam::Vec3::from([(); 3].map(|()| (2.0 * random.unit() - 1.0) * far));
    }
}

#[test]
fn candidate_lists_never_change_an_answer() {
    let Some(gpu) = device() else { return };
    let rows = vec![vec![Interaction::Never], vec![Interaction::Within(0.9), Interaction::Touch]];
    let boxed = Space::periodic([Some(9.0), None, Some(8.5)]).expect("a box");
    let cases = [
        (Algorithm::CellList, Space::UNBOUNDED, false),
        (Algorithm::CellList, boxed, true),
        (Algorithm::CellList, Space::UNBOUNDED, true),
        (Algorithm::LazyGrid, boxed, false),
        (Algorithm::Naive, Space::UNBOUNDED, false),
    ];
    for (count, (algorithm, space, has_species)) in
        [1500, 1501].into_iter().flat_map(|n| cases.map(|c| (n, c)))
    {
        let case = format!("{count}, {algorithm}, {space:?}, species {has_species}");
        let mut scenario = TestInput {
            spheres: cloud(3, count, 9.0, |random| [0.4, 0.1][random.below(2) as usize]),
            mixture: has_species.then(|| SpeciesSetup {
                species: (0..count as u32).map(|k| k % 2).collect(),
                rows: rows.clone(),
            }),
            space,
            ..TestInput::default()
        };
        let table = scenario.interactions().expect("two species");
        let settings = GpuConfig::default().algorithm(algorithm).space(space).interactions(table);
        let mut detector = GpuSkinDetector::new(&gpu.device, settings, 0.3).expect("made");
        scenario.spheres[17].center.x = f32::INFINITY;
        let mut random = Random(4);
        let (mut served, mut rebuilt) = (0, 0);
        for step in 0..16 {
            let state = verify(&gpu, &mut detector, &scenario, &format!("{case}, step {step}"));
            *if state.rebuild_reason == 0 { &mut served } else { &mut rebuilt } += 1;
            walk(&mut scenario.spheres, if step == 12 { 3.0 } else { 0.1 }, &mut random);
        }
        assert!(served >= 8 && rebuilt >= 3, "{case}: {served} served, {rebuilt} rebuilt");
    }
}

#[test]
fn displacement_within_the_limit_keeps_the_list() {
    let Some(gpu) = device() else { return };
    for (radius, skin) in [(1.0_f32, 0.5_f32), (1.0, 1e-3), (1e-6, 1e-7), (1e6, 1e4)] {
        let mut detector = GpuSkinDetector::new(&gpu.device, GpuConfig::default(), skin).expect("made");
        let at = |displacement: f32| {
            let x = radius + 0.4985 * skin - displacement;
            TestInput::from(vec![Sphere::new([-x, 0.0, 0.0], radius), Sphere::new([x, 0.0, 0.0], radius)])
        };
        let mut served = 0;
        for step in 0..40 {
            let displacement = 0.4994 * skin * (step as f32 / 30.0).min(1.0);
            let state =
                verify(&gpu, &mut detector, &at(displacement), &format!("{radius}, {skin}, step {step}"));
            served += u32::from(state.rebuild_reason == 0);
        }
        assert!(served == 39, "{radius}, {skin}: {served} served");
    }
}

#[test]
fn displacement_beyond_the_limit_rebuilds_the_list() {
    let Some(gpu) = device() else { return };
    for (radius, skin) in [(1.0_f32, 0.5_f32), (1e-6, 1e-7), (1e6, 1e4)] {
        let mut detector = GpuSkinDetector::new(&gpu.device, GpuConfig::default(), skin).expect("made");
        for (displacement, rebuilt) in [(0.0, SkinState::NO_LIST), (0.503 * skin, SkinState::DISPLACEMENT)] {
            let x = radius + 0.502 * skin - displacement;
            let spheres = [-x, x].map(|x| Sphere::new([x, 0.0, 0.0], radius));
            let case = format!("{radius}, {skin}, moved {displacement}");
            let state = verify(&gpu, &mut detector, &TestInput::from(spheres.to_vec()), &case);
            assert_eq!(state.rebuild_reason, rebuilt, "{case}: {state:?}");
        }
    }
}

#[test]
fn changed_spheres_rebuild_the_list() {
    let Some(gpu) = device() else { return };
    let mut detector = GpuSkinDetector::new(&gpu.device, GpuConfig::default(), 0.5).expect("made");
    let mut scenario = TestInput::from(cloud(6, 900, 6.0, |_| 0.3));
    let mut ask = |scenario: &TestInput, rebuilt: u32, case: &str| {
        let state = verify(&gpu, &mut detector, scenario, case);
        assert_eq!(state.rebuild_reason, rebuilt, "{case}: {state:?}");
    };
    ask(&scenario, SkinState::NO_LIST, "the first");
    ask(&scenario, 0, "the same");
    scenario.spheres[500].radius = 1.5;
    ask(&scenario, SkinState::INPUT_CHANGED, "a larger one");
    scenario.spheres[501].radius = f32::NAN;
    ask(&scenario, SkinState::INPUT_CHANGED, "one that is no more valid");
    ask(&scenario, 0, "nothing new");
    scenario.spheres[501].radius = 0.3;
    ask(&scenario, SkinState::INPUT_CHANGED, "one that is valid again");
    scenario.spheres.swap(3, 4);
    ask(&scenario, SkinState::DISPLACEMENT, "two that changed places");
    scenario.spheres.truncate(800);
    ask(&scenario, SkinState::INPUT_CHANGED, "fewer");
    scenario.spheres.extend(cloud(7, 500, 6.0, |_| 0.3));
    ask(&scenario, SkinState::NO_LIST, "more than ever");
    ask(&scenario, 0, "nothing new");
}

fn two_species(gpu: &GpuDevice, of_second: [Interaction; 2]) -> (TestInput, GpuSkinDetector) {
    let rows = vec![vec![Interaction::Touch], of_second.to_vec()];
    let species: Vec<u32> = (0..700).map(|k| k % 2).collect();
    let scenario = TestInput {
        spheres: cloud(9, 700, 7.0, |_| 0.3),
        mixture: Some(SpeciesSetup { species, rows }),
        ..TestInput::default()
    };
    let settings = GpuConfig::default().interactions(scenario.interactions().expect("two species"));
    let detector = GpuSkinDetector::new(&gpu.device, settings, 0.2).expect("made");
    (scenario, detector)
}

#[test]
fn changed_species_rebuild_the_list() {
    let Some(gpu) = device() else { return };
    let (mut scenario, mut detector) = two_species(&gpu, [Interaction::Within(1.5), Interaction::Never]);
    for (change, rebuilt) in
        [(None, SkinState::NO_LIST), (None, 0), (Some(601), SkinState::INPUT_CHANGED), (None, 0)]
    {
        if let (Some(k), Some(mixture)) = (change, &mut scenario.mixture) {
            mixture.species[k] = 1 - mixture.species[k];
        }
        let state = verify(&gpu, &mut detector, &scenario, &format!("{change:?}"));
        assert_eq!(state.rebuild_reason, rebuilt, "{change:?}: {state:?}");
    }
}

#[test]
fn spheres_that_never_pair_may_move_and_grow() {
    let Some(gpu) = device() else { return };
    let (mut scenario, mut detector) = two_species(&gpu, [Interaction::Never; 2]);
    let mut ask = |scenario: &TestInput, rebuilt, case| {
        let state = verify(&gpu, &mut detector, scenario, case);
        assert_eq!(state.rebuild_reason, rebuilt, "{case}: {state:?}");
    };
    ask(&scenario, SkinState::NO_LIST, "the first call");
    let idle = scenario.spheres.iter_mut().skip(1).step_by(2);
    idle.for_each(|sphere| (sphere.center.x, sphere.radius) = (sphere.center.x + 1.0, 2.0));
    ask(&scenario, 0, "without effect");
    scenario.spheres[1].radius = f32::NAN;
    ask(&scenario, SkinState::INPUT_CHANGED, "one more is invalid");
    scenario.mixture.as_mut().expect("species").species[3] = 0;
    ask(&scenario, SkinState::INPUT_CHANGED, "it pairs where it is now");
    scenario.spheres[3].center.x -= 1.0;
    ask(&scenario, SkinState::DISPLACEMENT, "far");
}

/// Radii to which half a skin cannot be added without loss.
#[test]
fn largest_radii_have_no_candidate_list() {
    let Some(gpu) = device() else { return };
    for radius in [2e30, f32::MAX] {
        let mut detector = GpuSkinDetector::new(&gpu.device, GpuConfig::default(), 0.5).expect("made");
        let mut scenario = TestInput::from(cloud(11, 300, 6.0, |_| 0.3));
        scenario.spheres[7].radius = radius;
        for rebuilt in [SkinState::NO_LIST, SkinState::INPUT_CHANGED, SkinState::INPUT_CHANGED] {
            let state = verify(&gpu, &mut detector, &scenario, &format!("{radius:e}"));
            assert_eq!(state.rebuild_reason, rebuilt, "{radius:e}: {state:?}");
        }
    }
}

#[test]
fn candidate_overflow_reports_the_needed_capacity() {
    let Some(gpu) = device() else { return };
    let settings = GpuConfig::default().pair_capacity(600_000);
    let mut detector = GpuSkinDetector::new(&gpu.device, settings, 0.5).expect("made");
    detector.set_candidate_capacity(1000);
    let scenario = TestInput::from(vec![Sphere::new([1.0; 3], 0.5); 1000]);
    for _ in 0..2 {
        let (outcome, ..) = ask(&gpu, &mut detector, &scenario);
        assert_eq!(
            (outcome.overflow, outcome.entries_needed()),
            (Outcome::OVERFLOW_CANDIDATES, 499_500),
            "{outcome:?}"
        );
    }
    detector.set_candidate_capacity(500_000);
    assert_eq!(verify(&gpu, &mut detector, &scenario, "with room").rebuild_reason, SkinState::NO_LIST);
    assert_eq!(verify(&gpu, &mut detector, &scenario, "reused").rebuild_reason, 0);
}

/// Four candidates per pair of the output would exceed the binding.
#[test]
fn candidates_of_a_large_output_are_limited_to_the_device() {
    let Some(gpu) = device() else { return };
    let gpu = limited(&gpu, |limits| wgpu::Limits { max_storage_buffer_binding_size: 1 << 20, ..limits });
    let settings = GpuConfig::default().pair_capacity(1 << 16);
    let mut detector = GpuSkinDetector::new(&gpu.device, settings, 0.5).expect("made");
    let scenario = TestInput::from(cloud(12, 900, 6.0, |_| 0.3));
    for rebuilt in [SkinState::NO_LIST, 0] {
        let state = verify(&gpu, &mut detector, &scenario, "a large output");
        assert_eq!(state.rebuild_reason, rebuilt, "{state:?}");
    }
}

#[test]
fn skins_out_of_range_are_refused() {
    let Some(gpu) = device() else { return };
    for skin in [0.0, -1.0, f32::NAN, f32::INFINITY, 1e-20, 1e20] {
        let refused = GpuSkinDetector::new(&gpu.device, GpuConfig::default(), skin);
        assert!(refused.expect_err("refused").to_string().contains("1e-14"), "{skin}");
    }
}
