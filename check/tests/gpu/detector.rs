use crate::common::scenes::{cloud, detect, detect_with, scenes, settings, touching, verify};
use crate::common::{Random, device, download, four_species, upload};
use bytemuck::Zeroable;
use lazygrid::gpu::{GpuDetector, GpuDevice, GpuSpheres, Outcome, SphereCount, wgpu};
use lazygrid::{Algorithm, Backend, Error, Interaction, Interactions, Pair, Space, Sphere};
use lazygrid_check::{SpeciesSetup, TestInput};

const ALGORITHMS: &[Algorithm] = Algorithm::GPU;

#[test]
fn every_scene_agrees_with_all_pairs() {
    let Some(gpu) = device() else { return };
    for &algorithm in ALGORITHMS {
        for subgroups in [false, true] {
            let mut detector = GpuDetector::new(&gpu.device, settings(algorithm, subgroups)).expect("made");
            for (name, spheres) in scenes() {
                let scene = format!("{name}, {algorithm}, subgroups {subgroups}");
                let mut found = detect(&gpu, &mut detector, &spheres);
                if found.outcome.overflow & Outcome::OVERFLOW_ENTRIES != 0 {
                    // Many refined levels exceed the initial capacity.
                    assert!(detector.set_entry_capacity(found.outcome.entries_needed()), "{scene}");
                    found = detect(&gpu, &mut detector, &spheres);
                }
                assert_eq!(found.outcome.overflow & !Outcome::OVERFLOW_PAIRS, 0, "{scene}");
                assert_eq!(found.outcome.quarantined, 0, "{scene}");
                if found.outcome.overflow == 0 {
                    verify(&scene, &touching(&spheres), &found.pairs);
                } else {
                    let n = spheres.len() as u64;
                    assert_eq!(found.outcome.found(), n * (n - 1) / 2, "{scene}");
                }
            }
        }
    }
}

/// A periodic grid of two cells on an axis would make them neighbors on both sides.
#[test]
fn grid_of_few_cells_finds_each_pair_once() {
    let Some(gpu) = device() else { return };
    let mut detector = GpuDetector::new(&gpu.device, settings(Algorithm::CellList, true)).expect("made");
    for widths in [[0.5, 0.5, 0.5], [1.1, 0.5, 2.6], [0.2, 1.2, 0.0], [3.1, 0.6, 1.3]] {
        let mut random = Random(5);
        let mut coordinate = |width: f32| (random.unit() - 0.5) * width;
        let sphere = |radius| Sphere::new(widths.map(&mut coordinate), radius);
        let spheres: Vec<Sphere> = (0..300).map(|k| [0.5, 0.3][k % 2]).map(sphere).collect();
        let found = detect(&gpu, &mut detector, &spheres);
        verify(&format!("{widths:?}"), &touching(&spheres), &found.pairs);
    }
}

/// The crowd makes all small spheres leave the cells of the large ones.
#[test]
fn small_spheres_below_the_lowest_center_are_found() {
    let Some(gpu) = device() else { return };
    let settings = settings(Algorithm::CellList, true).tau(8);
    let mut detector = GpuDetector::new(&gpu.device, settings).expect("made");
    for (seed, spacing) in [(1, 2.3_f32), (2, 1.9), (3, 3.1)] {
        let mut random = Random(seed);
        let mut spheres = Vec::new();
        for k in 0..64_u8 {
            let center = glam::Vec3::from([k % 4, k / 4 % 4, k / 16].map(|c| f32::from(c) * spacing));
            spheres.push(Sphere::new(center, 0.5));
            spheres.extend((0..20).map(|_| {
                let out = glam::Vec3::from([(); 3].map(|()| random.unit() - 0.5)).normalize_or_zero();
                Sphere::new(center + out * 0.51, 0.02)
            }));
        }
        spheres.extend((0..600).map(|_| Sphere::new([(); 3].map(|()| 5.0 + 0.4 * random.unit()), 0.02)));
        let found = detect(&gpu, &mut detector, &spheres);
        verify(&format!("{spacing} apart"), &touching(&spheres), &found.pairs);
    }
}

#[test]
fn overflow_stops_writing_but_not_counting() {
    let Some(gpu) = device() else { return };
    let spheres = vec![Sphere::new([1.0, 2.0, 3.0], 0.5); 3000];
    for &algorithm in ALGORITHMS {
        for subgroups in [false, true] {
            let settings = settings(algorithm, subgroups).pair_capacity(1000);
            let mut detector = GpuDetector::new(&gpu.device, settings).expect("made");
            let found = detect(&gpu, &mut detector, &spheres);
            assert_eq!(found.outcome.found(), 4_498_500, "{algorithm}, subgroups {subgroups}");
            assert_eq!(found.outcome.overflow, Outcome::OVERFLOW_PAIRS);
            assert_eq!(found.pairs.len(), 1000);
            assert!(found.pairs.windows(2).all(|two| two[0] < two[1]), "distinct");
            assert!(found.pairs.iter().all(|pair| pair.i < pair.j && pair.j < 3000));
            let groups = [found.outcome.dispatch_x, found.outcome.dispatch_y, found.outcome.dispatch_z];
            assert_eq!(groups, [4, 1, 1], "a thread per written pair");
        }
    }
}

#[test]
fn bad_spheres_are_quarantined_and_counted() {
    let Some(gpu) = device() else { return };
    let mut spheres = cloud(20, 2000, 10.0, |_| 0.4);
    let good = spheres.clone();
    let bad = [
        [f32::NAN, 0.0, 0.0, 1.0],
        [0.0, f32::INFINITY, 0.0, 1.0],
        [0.0, 0.0, f32::NEG_INFINITY, 1.0],
        [5.0, 5.0, 5.0, f32::NAN],
        [5.0, 5.0, 5.0, f32::INFINITY],
        [5.0, 5.0, 5.0, -1.0],
        [5.0, 5.0, 5.0, -1e-40],
    ];
    let first_good = bad.len() as u32;
    spheres.splice(0..0, bad.map(Sphere::from));
    for &algorithm in ALGORITHMS {
        let mut detector = GpuDetector::new(&gpu.device, settings(algorithm, true)).expect("made");
        let found = detect(&gpu, &mut detector, &spheres);
        assert_eq!(found.outcome.quarantined, first_good, "{algorithm}");
        let shifted = found.pairs.iter().map(|p| Pair { i: p.i - first_good, j: p.j - first_good });
        verify("quarantine", &touching(&good), &shifted.collect::<Vec<_>>());
        let all_bad = detect(&gpu, &mut detector, &bad.map(Sphere::from));
        assert_eq!((all_bad.outcome.found(), all_bad.outcome.quarantined), (0, first_good));
    }
}

#[test]
fn sphere_count_is_read_from_a_buffer() {
    let Some(gpu) = device() else { return };
    let spheres = cloud(21, 3000, 12.0, |_| 0.4);
    let buffer = upload(&gpu, &spheres);
    for &algorithm in ALGORITHMS {
        let mut detector = GpuDetector::new(&gpu.device, settings(algorithm, true)).expect("made");
        let mut detect_first = |n: u32| {
            let count = upload(&gpu, &[n]);
            let count = SphereCount::Buffer { buffer: &count, at_most: 3000 };
            detect_with(&gpu, &mut detector, &GpuSpheres::new(&buffer, count))
        };
        for n in [0, 1, 257, 3000] {
            let found = detect_first(n);
            verify("count from a buffer", &touching(&spheres[..n as usize]), &found.pairs);
            assert_eq!((found.outcome.spheres, found.outcome.overflow), (n, 0));
        }
        let found = detect_first(4000);
        assert_eq!((found.outcome.spheres, found.outcome.overflow), (4000, Outcome::OVERFLOW_SPHERES));
    }
}

#[test]
fn interactions_determine_pairs() {
    let Some(gpu) = device() else { return };
    let spheres = cloud(22, 2500, 10.0, |random| 0.05 + 0.2 * random.unit());
    let mut random = Random(23);
    let species: Vec<u32> = (0..spheres.len()).map(|_| random.word() % 4).collect();
    let buffers = (upload(&gpu, &spheres), upload(&gpu, &species));
    let input_of_species = TestInput { mixture: Some(four_species(species)), ..spheres.into() };
    let input = GpuSpheres::new(&buffers.0, 2500).with_species(&buffers.1);
    for &algorithm in ALGORITHMS {
        for subgroups in [false, true] {
            let table = input_of_species.interactions().expect("small");
            let settings = settings(algorithm, subgroups).interactions(table);
            let mut detector = GpuDetector::new(&gpu.device, settings).expect("made");
            let found = detect_with(&gpu, &mut detector, &input);
            assert!(found.pairs.len() > 100, "{}", found.pairs.len());
            verify("interactions", &input_of_species, &found.pairs);
        }
    }
}

/// The bits of -0.0 are a large integer.
#[test]
fn sign_of_zero_is_ignored() {
    let Some(gpu) = device() else { return };
    let mut spheres = cloud(25, 1500, 4.0, |_| 0.5);
    for (k, sphere) in spheres.iter_mut().enumerate() {
        sphere.center.x = if k % 256 < 128 { 0.0 } else { -0.0 };
    }
    spheres.push(Sphere::new([0.0, 2.0, 2.0], -0.0));
    let touch = vec![vec![Interaction::Touch]];
    let within = vec![vec![Interaction::Touch], vec![Interaction::Within(-0.0); 2]];
    let buffer = upload(&gpu, &spheres);
    for &algorithm in ALGORITHMS {
        let mut detector = GpuDetector::new(&gpu.device, settings(algorithm, true)).expect("made");
        let found = detect(&gpu, &mut detector, &spheres);
        verify(&format!("zeroes, {algorithm}"), &touching(&spheres), &found.pairs);
        for (rows, last) in [(&touch, 0), (&within, 1)] {
            let mut alike = vec![0; spheres.len()];
            alike[1500] = last;
            let species = upload(&gpu, &alike);
            let mixture = Some(SpeciesSetup { species: alike, rows: rows.clone() });
            let input_of_species = TestInput { mixture, ..touching(&spheres) };
            let table = input_of_species.interactions().expect("small");
            let settings = settings(algorithm, true).interactions(table);
            let mut detector = GpuDetector::new(&gpu.device, settings).expect("made");
            let input = GpuSpheres::new(&buffer, 1501).with_species(&species);
            let found = detect_with(&gpu, &mut detector, &input);
            let scene = format!("zeroes, {algorithm}, the last of species {last}");
            verify(&scene, &input_of_species, &found.pairs);
        }
    }
}

#[test]
fn choice_reports_algorithm_and_reason() {
    let Some(gpu) = device() else { return };
    let detector = GpuDetector::new(&gpu.device, settings(Algorithm::Auto, true)).expect("made");
    for (spheres, expected) in [(10, Algorithm::Naive), (1_000_000, Algorithm::CellList)] {
        let (chosen, reason) = detector.choice(spheres);
        assert_eq!(chosen, expected);
        assert!(reason.contains(&format!("{expected}: {spheres} spheres")), "{reason}");
        let cost = detector.cost(spheres).expect("it fits");
        assert_eq!((cost.algorithm, cost.spheres), (expected, spheres));
    }
}

#[test]
fn calls_of_changing_size_reuse_buffers() {
    let Some(gpu) = device() else { return };
    let mut detector = GpuDetector::new(&gpu.device, settings(Algorithm::CellList, true)).expect("made");
    let reserved = detector.reserve(6000).expect("fits");
    for n in [10, 6000, 300, 5999, 1] {
        let spheres = cloud(n as u64, n, 15.0, |_| 0.4);
        let found = detect(&gpu, &mut detector, &spheres);
        verify("changing size", &touching(&spheres), &found.pairs);
        assert_eq!(detector.reserve(n as u32).as_ref(), Ok(&reserved), "nothing is allocated again");
    }
}

#[test]
fn oversized_input_is_refused_with_the_remedy() {
    let Some(gpu) = device() else { return };
    let mut detector = GpuDetector::new(&gpu.device, settings(Algorithm::ArrayGrid, true)).expect("made");
    let buffer = upload(&gpu, &[Sphere::zeroed(); 10]);
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    let too_short = GpuSpheres::new(&buffer, 11);
    let error = detector.encode(&mut encoder, &too_short).expect_err("11 do not fit into 10");
    assert_eq!(error, Error::BufferSize { what: "spheres", size: 160, needed: 176 });
    let with_species = GpuSpheres::new(&buffer, 2).with_species(&buffer);
    assert_eq!(detector.encode(&mut encoder, &with_species), Err(Error::SpeciesBuffer));
    let limit = gpu.device.limits().max_storage_buffer_binding_size;
    let beyond = u32::try_from(limit / 16 + 1).unwrap_or(u32::MAX);
    assert!(matches!(detector.reserve(beyond), Err(Error::LimitExceeded { .. })));
    for ratio in [0.5, 17.0, f32::NAN] {
        assert!(matches!(detector.set_cell_ratio(ratio), Err(Error::InvalidSetting { .. })));
    }
    let error = GpuDetector::new(&gpu.device, settings(Algorithm::HashGrid, true)).expect_err("CPU only");
    assert_eq!(error, Error::NotOnBackend { algorithm: Algorithm::HashGrid, backend: Backend::Gpu });
}

#[test]
fn windows_partition_the_result() {
    let Some(gpu) = device() else { return };
    let mut spheres = cloud(24, 2000, 12.0, |_| 0.4);
    spheres.extend(vec![Sphere::new([1.0; 3], 0.3); 700]);
    let n = spheres.len() as u32;
    let buffer = upload(&gpu, &spheres);
    for &algorithm in ALGORITHMS {
        let mut detector = GpuDetector::new(&gpu.device, settings(algorithm, true)).expect("made");
        let mut all = Vec::new();
        for window in [0..1, 1..900, 900..2500, 2500..n] {
            let input = GpuSpheres::new(&buffer, n).in_window(window.clone());
            let found = detect_with(&gpu, &mut detector, &input);
            assert!(found.pairs.iter().all(|pair| window.contains(&pair.i)));
            all.extend(found.pairs);
        }
        verify("windows", &touching(&spheres), &all);
    }
}

#[test]
fn first_set_and_window_may_be_given_in_either_order() {
    let Some(gpu) = device() else { return };
    let spheres = cloud(25, 300, 4.0, |_| 0.4);
    let buffer = upload(&gpu, &spheres);
    for &algorithm in ALGORITHMS {
        let mut detector = GpuDetector::new(&gpu.device, settings(algorithm, true)).expect("made");
        for (first, window) in [(0, 0..300), (120, 0..300), (120, 50..90)] {
            let input = GpuSpheres::new(&buffer, 300);
            let orders = [
                input.clone().across(first).in_window(window.clone()),
                input.in_window(window).across(first),
            ];
            let [a, b] = orders.map(|input| detect_with(&gpu, &mut detector, &input).outcome.found());
            assert_eq!((a, a > 0), (b, first > 0), "{algorithm}, {first}");
        }
    }
}

#[test]
fn species_outside_the_table_are_quarantined() {
    let Some(gpu) = device() else { return };
    let spheres = vec![Sphere::new([1.0; 3], 0.5); 400];
    let species: Vec<u32> = (0..400).map(|k| k % 4).collect();
    let table = Interactions::new(2, Interaction::Touch).expect("small");
    let buffers = (upload(&gpu, &spheres), upload(&gpu, &species));
    for &algorithm in ALGORITHMS {
        let settings = settings(algorithm, true).interactions(Some(table.clone()));
        let mut detector = GpuDetector::new(&gpu.device, settings).expect("made");
        let input = GpuSpheres::new(&buffers.0, 400).with_species(&buffers.1);
        let found = detect_with(&gpu, &mut detector, &input);
        assert_eq!((found.outcome.quarantined, found.outcome.found()), (200, 200 * 199 / 2), "{algorithm}");
    }
}

#[test]
fn default_limits_without_features_are_sufficient() {
    if device().is_none() {
        return;
    }
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapter = pollster::block_on(instance.request_adapter(&Default::default())).expect("one is there");
    let (device, queue) =
        pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor::default())).expect("defaults");
    device.on_uncaptured_error(std::sync::Arc::new(|error: wgpu::Error| panic!("leaked: {error}")));
    let wrapped = GpuDevice::from_wgpu(&device, &queue);
    let spheres = cloud(30, 2500, 12.0, |_| 0.4);
    for &algorithm in ALGORITHMS {
        let settings = settings(algorithm, true).timestamps(true);
        let mut detector = GpuDetector::new(&device, settings).expect("made");
        assert!(detector.ticks().is_none(), "timestamps were not requested");
        let found = detect(&wrapped, &mut detector, &spheres);
        verify("default limits", &touching(&spheres), &found.pairs);
    }
    let table = Interactions::new(2, Interaction::Touch).expect("small");
    let settings = settings(Algorithm::ArrayGrid, true).interactions(Some(table));
    let mut detector = GpuDetector::new(&device, settings).expect("made");
    let error = detector.reserve(1000).expect_err("ten storage buffers where the default is eight");
    assert!(matches!(error, Error::LimitExceeded { needed: 10, limit: 8, .. }), "{error}");
}

#[test]
fn caller_can_reuse_the_cell_order() {
    let Some(gpu) = device() else { return };
    let boxed = Space::periodic([Some(9.0), None, Some(8.5)]).expect("a box");
    let mut table = Interactions::new(2, Interaction::Touch).expect("two species");
    table.set(0, 0, Interaction::Never).expect("a species");
    for (space, radix_sort_from, species) in
        [(Space::UNBOUNDED, u32::MAX, false), (boxed, 1, false), (Space::UNBOUNDED, 1, true)]
    {
        let settings = settings(Algorithm::CellList, true)
            .pairs_in_cell_order(true)
            .space(space)
            .radix_sort_from(radix_sort_from)
            .interactions(species.then(|| table.clone()));
        let mut detector = GpuDetector::new(&gpu.device, settings).expect("made");
        let mut spheres = cloud(33, 4000, 10.0, |random| [0.3, 0.05][random.below(2) as usize]);
        spheres[7].radius = f32::NAN;
        let mut ids: Vec<u32> = (0..4000).map(|k| k % 2).collect();
        for step in 0..3 {
            let (input_buffer, of_species) = (upload(&gpu, &spheres), upload(&gpu, &ids));
            let input = GpuSpheres::new(&input_buffer, 4000);
            let input = if species { input.with_species(&of_species) } else { input };
            let found = detect_with(&gpu, &mut detector, &input);
            assert_eq!(found.outcome.pairs_in_cell_order, 1);
            let sorted = detector.reserve(4000).expect("reserved").sorted.expect("a cell list");
            let order = download::<u32>(&gpu, &sorted.order, 4000);
            let images: Vec<Sphere> = download(&gpu, &sorted.spheres, 4000);
            let mut indices = order.clone();
            indices.sort_unstable();
            assert!(indices.into_iter().eq(0..4000), "step {step}: each once");
            assert!(order[3999] == 7 || step > 0, "what is not valid comes last");
            for (image, &at) in images.iter().zip(&order) {
                let Sphere { center, radius } = spheres[at as usize];
                let same = image.center == space.wrap(center) && image.radius.to_bits() == radius.to_bits();
                assert!(same, "{image:?} of {center}");
            }
            let scenario = TestInput {
                mixture: species.then(|| SpeciesSetup {
                    species: order.iter().map(|&at| ids[at as usize]).collect(),
                    rows: vec![vec![Interaction::Never], vec![Interaction::Touch; 2]],
                }),
                spheres: images[..3999].to_vec(),
                space,
                ..TestInput::default()
            };
            assert!(found.pairs.len() > 1000);
            verify(&format!("step {step}"), &scenario, &found.pairs);
            ids = order.iter().map(|&at| ids[at as usize]).collect();
            if let Some(sorted) = &sorted.species {
                assert_eq!(download::<u32>(&gpu, sorted, 4000), ids);
            }
            spheres = images;
        }
    }
}

#[test]
fn only_the_cell_list_has_a_cell_order() {
    let Some(gpu) = device() else { return };
    for &algorithm in ALGORITHMS {
        let settings = settings(algorithm, true).pairs_in_cell_order(true);
        let mut detector = GpuDetector::new(&gpu.device, settings).expect("made");
        let spheres = cloud(34, 300, 3.0, |_| 0.3);
        let found = detect(&gpu, &mut detector, &spheres);
        let is_list = algorithm == Algorithm::CellList;
        assert_eq!(found.outcome.pairs_in_cell_order, u32::from(is_list), "{algorithm}");
        assert_eq!(detector.reserve(300).expect("reserved").sorted.is_some(), is_list, "{algorithm}");
        let input_buffer = upload(&gpu, &spheres);
        let found = detect_with(&gpu, &mut detector, &GpuSpheres::new(&input_buffer, 300).in_window(0..150));
        assert!(found.outcome.pairs_in_cell_order == 0 && found.pairs.iter().all(|pair| pair.i < 150));
    }
}
