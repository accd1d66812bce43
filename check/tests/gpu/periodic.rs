use crate::common::periodic::{Scene, cloud, detect, lengths, subjects};
use crate::common::{Random, device, four_species};
use lazygrid::Sphere;
use lazygrid::gpu::GpuDevice;

fn check(gpu: &GpuDevice, scene: &Scene) {
    let mut failures = Vec::new();
    for (algorithm, tau, settings) in subjects() {
        let context = format!("{algorithm} τ {tau}");
        let (outcome, pairs) = detect(gpu, scene, settings);
        assert_eq!((outcome.overflow, outcome.quarantined), (0, 0), "{}, {context}", scene.name);
        failures.extend(scene.verify(&context, &pairs).err());
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

fn octaves(random: &mut Random) -> f32 {
    0.5 * (-((random.word() % 11) as f32) - random.unit()).exp2()
}

fn at_seams(seed: u64, n: usize, side: f32, radius: impl Fn(&mut Random) -> f32) -> Vec<Sphere> {
    let mut random = Random(seed);
    let mut coordinate = || match random.word() % 2 {
        0 => 0.5 * side + 1.4 * (random.unit() - 0.5),
        _ => side * random.unit(),
    };
    let centers: Vec<[f32; 3]> = (0..n).map(|_| [coordinate(), coordinate(), coordinate()]).collect();
    centers.into_iter().map(|center| Sphere::new(center, radius(&mut random))).collect()
}

/// The coarsest cells are one unit wide, with the default cell ratio.
#[test]
fn boxes_of_few_cells() {
    let Some(gpu) = device() else { return };
    let boxes =
        [0.3, 0.9, 1.0, 1.7, 2.0, 3.1, 4.0, 4.1, 5.5, 7.9, 8.0, 8.2, 9.5, 12.3, 20.9, 25.4, 26.7, 29.0];
    for (k, side) in boxes.into_iter().enumerate() {
        for axes in [1 + k % 7, 7] {
            let spheres = at_seams(k as u64, 300, side, |random| 0.25 * (0.6 + 0.4 * random.unit()));
            check(&gpu, &Scene::new(format!("{side} cells on {axes}"), lengths(axes, [side; 3]), spheres));
        }
    }
}

/// A ring with one or two cells more than a multiple of eight would share keys at its ends.
#[test]
fn keys_shared_by_cells_of_a_ring_lose_no_pair() {
    let Some(gpu) = device() else { return };
    for (k, box_lengths) in
        [[65.5, 66.2, 129.3], [33.1, 257.8, 130.9], [513.4, 90.3, 70.7]].into_iter().enumerate()
    {
        for axes in [3, 7] {
            let mut spheres = at_seams(k as u64, 400, 4.0, |_| 0.25);
            for sphere in &mut spheres {
                let [x, y, z] = sphere.center.to_array();
                let [a, b, c] = box_lengths.map(|length| 0.5 * length - 2.0);
                sphere.center = [x + a, y + b, z + c].into();
            }
            check(
                &gpu,
                &Scene::new(format!("{box_lengths:?} on {axes}"), lengths(axes, box_lengths), spheres),
            );
        }
    }
}

#[test]
fn nested_grids_are_periodic_at_all_depths() {
    let Some(gpu) = device() else { return };
    let boxes = [[8.0, 8.0, 8.0], [1.0, 3.0, 9.0], [0.1, 20.0, 2.5], [0.02, 0.02, 30.0], [4.7, 5.9, 8.3]];
    for (k, box_lengths) in boxes.into_iter().enumerate() {
        for axes in [2 + k, 7] {
            let mut spheres = cloud(100 + k as u64, 200, 8.0, octaves);
            let mut random = Random(k as u64);
            spheres.extend((0..150).map(|_| {
                let center = [0, 1, 2].map(|axis| box_lengths[axis] * 0.5 + 0.05 * (random.unit() - 0.5));
                Sphere::new(center, 0.01 * octaves(&mut random))
            }));
            check(
                &gpu,
                &Scene::new(format!("{box_lengths:?} on {axes}"), lengths(axes, box_lengths), spheres),
            );
        }
    }
}

#[test]
fn spheres_on_the_periodic_boundary() {
    let Some(gpu) = device() else { return };
    for (seed, length) in [1.0_f32, 0.1, 10.0, 3.3].into_iter().enumerate() {
        let mut random = Random(seed as u64);
        let mut coordinate = || {
            let periods = [0.0, 0.5, -0.5, 1.0, -1.0, 2.5, 1e6, -1e6 - 0.5][random.word() as usize % 8];
            let x = length * periods;
            [x, x, x.next_up(), x.next_down()][random.word() as usize % 4]
        };
        let spheres = (0..250)
            .map(|k| {
                Sphere::new(
                    [coordinate(), coordinate(), coordinate()],
                    length * [0.0, 1e-7, 2e-7, 0.01, 0.2][k % 5],
                )
            })
            .collect();
        check(&gpu, &Scene::new(format!("corners of {length}"), lengths(7 - seed % 2, [length; 3]), spheres));
    }
}

#[test]
fn coordinates_far_outside_the_box() {
    let Some(gpu) = device() else { return };
    for (seed, away) in [3.0_f32, 1e6, 1e30].into_iter().enumerate() {
        let mut random = Random(seed as u64);
        let spheres = cloud(seed as u64, 300, 6.0, |random| 0.3 * random.unit()).into_iter();
        let spheres = spheres
            .map(|s| match random.word() % 3 {
                0 => Sphere::new(s.center * away, s.radius),
                1 => Sphere::new(s.center - away, s.radius),
                _ => s,
            })
            .collect();
        check(&gpu, &Scene::new(format!("{away} away"), lengths(7, [6.0, 3.0, 0.7]), spheres));
    }
}

#[test]
fn giants_and_lattices() {
    let Some(gpu) = device() else { return };
    let mut giants = cloud(30, 300, 10.0, |_| 0.05);
    giants.extend([4.0, 12.0].map(|radius| Sphere::new([9.5; 3], radius)));
    check(&gpu, &Scene::new("giants", lengths(7, [10.0, 6.0, 2.0]), giants));
    // A full periodic lattice in contact has three contacts per site.
    for (count, spacing) in [(3_usize, 0.5_f32), (4, 1.0), (7, 0.25)] {
        let site = |k: usize| [k % count, k / count % count, k / count / count].map(|c| c as f32 * spacing);
        let sites: Vec<_> = (0..count.pow(3)).map(|k| Sphere::new(site(k), 0.5 * spacing)).collect();
        let scene = Scene::new(format!("lattice of {count}"), lengths(7, [count as f32 * spacing; 3]), sites);
        for (_, _, settings) in subjects() {
            let (_, pairs) = detect(&gpu, &scene, settings);
            assert_eq!(pairs.len(), 3 * count.pow(3), "{}", scene.name);
        }
        check(&gpu, &scene);
    }
}

#[test]
fn lengths_of_every_magnitude() {
    let Some(gpu) = device() else { return };
    for scale in [1e-44_f32, 1e-38, 1e-27, 1e-15, 1e15, 1e25, 3e37] {
        let spheres = cloud(40, 200, 1.0, |random| 0.1 * random.unit()).into_iter();
        let spheres =
            spheres.map(|s| Sphere::new(s.center * 10.0 * scale, s.radius * 10.0 * scale)).collect();
        let box_lengths = [10.0 * scale, 9.0 * scale, 1.0 * scale];
        check(&gpu, &Scene::new(format!("lengths of {scale:e}"), lengths(7, box_lengths), spheres));
    }
    let apart = cloud(41, 200, 1.0, |random| 0.2 * random.unit());
    check(&gpu, &Scene::new("a tiny box", lengths(1, [1e-40; 3]), apart.clone()));
    check(&gpu, &Scene::new("a vast box", lengths(5, [f32::MAX, 1.0, 1e9]), apart));
}

#[test]
fn species_in_a_periodic_box() {
    let Some(gpu) = device() else { return };
    let spheres = cloud(50, 500, 8.0, octaves);
    let mut random = Random(51);
    let species: Vec<u32> = (0..spheres.len()).map(|_| random.word() % 4).collect();
    let mut scene = Scene::new("species", lengths(5, [4.0; 3]), spheres);
    scene.input.mixture = Some(four_species(species));
    check(&gpu, &scene);
}

#[test]
fn crowds_on_the_periodic_boundary_of_a_large_box() {
    let Some(gpu) = device() else { return };
    let mut spheres = cloud(60, 4000, 1.0, |random| 0.004 * (0.1 + random.unit()));
    spheres.iter_mut().for_each(|s| s.center *= 30.0);
    spheres.extend(cloud(61, 1500, 0.06, |_| 0.004));
    spheres.iter_mut().skip(4000).for_each(|s| s.center += 14.97);
    let scene = Scene::new("crowds", lengths(7, [30.0, 10.0, 29.96]), spheres);
    let mut lists = subjects().map(|(algorithm, _, settings)| (algorithm, detect(&gpu, &scene, settings).1));
    let (_, naive) = lists.next().expect("naive comes first");
    assert!(naive.len() > 1000, "{}", naive.len());
    for (algorithm, list) in lists {
        assert!(list == naive, "{algorithm}: {} pairs instead of {}", list.len(), naive.len());
    }
}

#[test]
fn bad_spheres_are_quarantined() {
    let Some(gpu) = device() else { return };
    let mut spheres = cloud(70, 100, 3.0, |_| 0.2);
    spheres.extend([f32::NAN, f32::INFINITY, f32::NEG_INFINITY].map(|x| Sphere::new([1.0, x, 1.0], 1.0)));
    let scene = Scene::new("bad", lengths(7, [2.0; 3]), spheres);
    for (_, _, settings) in subjects() {
        let (outcome, pairs) = detect(&gpu, &scene, settings);
        assert_eq!(outcome.quarantined, 3);
        assert!(pairs.iter().all(|pair| pair.j < 100) && !pairs.is_empty());
    }
}
