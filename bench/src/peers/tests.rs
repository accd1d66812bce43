use lazygrid::{Algorithm, Backend, Config};

use super::*;
use crate::measure::{ContenderFactory, Digest, PairFinder, Plan, compare};
use lazygrid_io::scenes::Scene;

fn naive() -> ContenderFactory {
    ContenderFactory::list("naive", Config::default().backend(Backend::Cpu).algorithm(Algorithm::Naive))
}

fn digest(search: &mut dyn PairFinder, spheres: &[Sphere]) -> Digest {
    Digest::from_found(&search.run(spheres).expect("found"))
}

/// Compares peers that keep their structure with the naive search while `change` moves the spheres.
fn verify_steps(mut spheres: Vec<Sphere>, steps: u32, mut change: impl FnMut(u32, &mut [Sphere])) {
    let peers = [naive(), octree::incremental(), cell_list::incremental(), sweep_and_prune::incremental()];
    let mut searches: Vec<_> = peers.iter().map(|peer| (peer.make)().expect("made")).collect();
    for step in 0..steps {
        change(step, &mut spheres);
        let digests: Vec<_> = searches.iter_mut().map(|search| digest(&mut **search, &spheres)).collect();
        assert!(digests.iter().all(|digest| digest == &digests[0]), "step {step}: {digests:?}");
    }
}

#[test]
fn peers_agree_with_naive() {
    for scene in Scene::ALL {
        let n = if scene == Scene::Point { 200 } else { 1500 };
        let plan = Plan { scene, n, seed: 3, rounds: 2, steps: 4, step_length: Scene::STEP, fresh: false };
        let mut contenders = vec![naive()];
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
    for spheres in [points(1), points(2), points(9), points(100), row(1.0), row(1.001), row(0.1)] {
        let spheres: Vec<Sphere> = spheres;
        let digest_of =
            |contender: &ContenderFactory| digest(&mut *(contender.make)().expect("made"), &spheres);
        let expected = digest_of(&naive());
        for contender in cell_list::tunings(Scene::FiveSizes) {
            assert_eq!(digest_of(&contender), expected, "{}: {} spheres", contender.name, spheres.len());
        }
    }
}

#[test]
fn peers_follow_a_cloud_that_spreads_and_shrinks() {
    let factors = [1.0, 1.2, 1.5, 0.5, 0.5, 0.3, 1.0, 2.0, 1.4];
    verify_steps(Scene::FiveSizes.spheres(4000, 5), factors.len() as u32, |step, spheres| {
        spheres.iter_mut().for_each(|sphere| sphere.center *= factors[step as usize]);
    });
}

#[test]
fn boxes_at_cell_borders_lose_no_pair() {
    let mut spheres = Scene::Equal.spheres(4000, 6);
    spheres.iter_mut().for_each(|sphere| sphere.center += 30_000.0);
    verify_steps(spheres, 40, |step, spheres| {
        if let Some(last) = step.checked_sub(1) {
            Scene::advance(spheres, 6, last);
        }
    });
}
