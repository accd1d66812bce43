use lazygrid::{Algorithm, Backend, Config};

use super::*;
use crate::measure::{ContenderFactory, Plan, compare};
use lazygrid_io::scenes::Scene;

#[test]
fn peers_agree_with_naive() {
    for scene in Scene::ALL {
        let n = if scene == Scene::Point { 200 } else { 1500 };
        let plan = Plan { scene, n, seed: 3, rounds: 2, steps: 4, step_length: Scene::STEP, fresh: false };
        let reference = Config::default().backend(Backend::Cpu).algorithm(Algorithm::Naive);
        let mut contenders = vec![ContenderFactory::list("naive", reference)];
        contenders.extend([cell_list::incremental(), octree::incremental(), sweep_and_prune::incremental()]);
        contenders.extend(cell_list::tunings(scene));
        contenders.extend(parry::incremental());
        contenders.extend(verlet::skins(scene));
        #[cfg(feature = "bullet")]
        contenders.extend(bullet::tunings(scene));
        let timings = compare(&plan, &contenders).unwrap_or_else(|e| panic!("{scene}: {e}"));
        assert!(timings[0].pairs > 0, "{scene}");
    }
}

#[test]
fn cell_list_handles_unusual_shapes() {
    let points = |n: usize| (0..n).map(|k| Sphere::new([(k / 2) as f32, 0.0, 0.0], 0.0)).collect();
    let row = |gap: f32| (0..100).map(|k| Sphere::new([k as f32 * gap, 7.0, -7.0], 0.5)).collect();
    let reference = Config::default().backend(Backend::Cpu).algorithm(Algorithm::Naive);
    for spheres in [points(1), points(2), points(9), points(100), row(1.0), row(1.001), row(0.1)] {
        let spheres: Vec<Sphere> = spheres;
        let digest = |contender: &ContenderFactory| {
            let mut search = (contender.make)().expect("made");
            crate::measure::Digest::from_found(&search.run(&spheres).expect("found"))
        };
        let expected = digest(&ContenderFactory::list("naive", reference.clone()));
        for contender in cell_list::tunings(Scene::FiveSizes) {
            assert_eq!(digest(&contender), expected, "{}: {} spheres", contender.name, spheres.len());
        }
    }
}

#[test]
fn peers_follow_a_cloud_that_spreads_and_shrinks() {
    let mut spheres = Scene::FiveSizes.spheres(4000, 5);
    let reference = Config::default().backend(Backend::Cpu).algorithm(Algorithm::Naive);
    let searches = [
        ContenderFactory::list("naive", reference),
        octree::incremental(),
        cell_list::incremental(),
        sweep_and_prune::incremental(),
    ];
    let mut searches: Vec<_> = searches.iter().map(|c| (c.make)().unwrap()).collect();
    for factor in [1.0, 1.2, 1.5, 0.5, 0.5, 0.3, 1.0, 2.0, 1.4] {
        spheres.iter_mut().for_each(|sphere| sphere.center *= factor);
        let digests: Vec<_> = searches
            .iter_mut()
            .map(|s| crate::measure::Digest::from_found(&s.run(&spheres).unwrap()))
            .collect();
        assert!(digests.iter().all(|d| d == &digests[0]), "factor {factor}: {digests:?}");
    }
}

#[test]
fn boxes_at_cell_borders_lose_no_pair() {
    let mut spheres = Scene::Equal.spheres(4000, 6);
    spheres.iter_mut().for_each(|sphere| sphere.center += 30_000.0);
    let reference = Config::default().backend(Backend::Cpu).algorithm(Algorithm::Naive);
    let searches = [
        ContenderFactory::list("naive", reference),
        octree::incremental(),
        cell_list::incremental(),
        sweep_and_prune::incremental(),
    ];
    let mut searches: Vec<_> = searches.iter().map(|c| (c.make)().unwrap()).collect();
    for step in 0..40 {
        let digests: Vec<_> = searches
            .iter_mut()
            .map(|s| crate::measure::Digest::from_found(&s.run(&spheres).unwrap()))
            .collect();
        assert!(digests.iter().all(|d| d == &digests[0]), "step {step}: {digests:?}");
        Scene::advance(&mut spheres, 6, step);
    }
}
