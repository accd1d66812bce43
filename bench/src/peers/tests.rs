use lazygrid::{Algorithm, Backend, Config};

use super::*;
use crate::measure::{Contender, Plan, compare};
use crate::scenes::Scene;

/// Every peer gives the naive detector's pairs, from step to step.
#[test]
fn peers_agree_with_the_judge() {
    for scene in Scene::ALL {
        let n = if scene == Scene::Point { 300 } else { 3000 };
        let plan = Plan { scene, n, seed: 3, rounds: 3, steps: 5, fresh: false };
        let judge = Config::default().backend(Backend::Cpu).algorithm(Algorithm::Naive);
        let mut contenders = vec![Contender::list("naive", judge)];
        contenders.extend([cell_list::running(), octree::running(), sweep::running()]);
        contenders.extend(parry::running());
        #[cfg(feature = "bullet")]
        contenders.extend(bullet::tunings());
        let timings = compare(&plan, &contenders).unwrap_or_else(|e| panic!("{scene}: {e}"));
        assert!(timings[0].pairs > 0, "{scene}");
    }
}

/// Spheres that fly apart by more than their cells: the octree grows, splits and merges, and loses none.
#[test]
fn a_cloud_that_spreads_and_gathers() {
    let mut spheres = Scene::FiveSizes.spheres(4000, 5);
    let judge = Config::default().backend(Backend::Cpu).algorithm(Algorithm::Naive);
    let searches =
        [Contender::list("naive", judge), octree::running(), cell_list::running(), sweep::running()];
    let mut searches: Vec<_> = searches.iter().map(|c| (c.make)().unwrap()).collect();
    for factor in [1.0, 1.2, 1.5, 0.5, 0.5, 0.3, 1.0, 2.0, 1.4] {
        spheres.iter_mut().for_each(|sphere| sphere.center *= factor);
        let digests: Vec<_> =
            searches.iter_mut().map(|s| crate::measure::Digest::of(&s.run(&spheres).unwrap())).collect();
        assert!(digests.iter().all(|d| d == &digests[0]), "factor {factor}: {digests:?}");
    }
}
