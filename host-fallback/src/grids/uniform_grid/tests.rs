use lazygrid_kernels::Sphere;

use super::*;
use crate::compare::PairTest;
use crate::test_support::Random;

fn cells<const PERIODIC: bool>(spheres: &[Sphere], ratio: f32, lengths: [Option<f32>; 3]) -> [usize; 2] {
    let stats =
        InputStats::from_test(&PairTest::new(spheres.into(), None), Executor::Pool).expect("all are valid");
    let grid = UniformGrid::new(&stats, ratio, lengths);
    let count = |grid: &UniformGrid| -> usize {
        spheres.iter().map(|s| grid.cover::<PERIODIC>(s.center, s.radius).cells()).sum()
    };
    let sphere = |k: usize| (spheres[k].center, spheres[k].radius);
    let shifted = grid.clone().shifted::<PERIODIC>(ratio, sphere, spheres.len(), Executor::Pool);
    [count(&grid), count(&shifted)]
}

#[test]
fn shifted_grid_has_at_most_the_announced_entries() {
    let mut random = Random(3);
    let lattice = |cell_size: f32| -> Vec<Sphere> {
        let at = |k: usize| [k % 16, k / 16 % 16, k / 256].map(|c| cell_size * (c as f32 - 8.0));
        (0..4096).map(|k| Sphere::new(at(k), 1.0)).collect()
    };
    let gas: Vec<_> = (0..4096).map(|_| Sphere::new(random.point(20.0), 1.0)).collect();
    for ratio in [2.0, 3.0, 4.0, 7.5, 16.0] {
        let most = |n: usize| (1.05 * UniformGrid::most_cells(ratio) * n as f64) as usize;
        let cell_size = 2.0 * ratio;
        for spheres in [vec![Sphere::new([0.0; 3], 1.0); 1000], lattice(cell_size)] {
            let [before, after] = cells::<false>(&spheres, ratio, [None; 3]);
            assert!(before > 7 * spheres.len() && after == spheres.len(), "{ratio}: {before}, {after}");
            let [before, after] = cells::<true>(&spheres, ratio, [Some(40.0 * cell_size); 3]);
            assert!(before >= after && after <= most(spheres.len()), "{ratio}: {before}, {after}");
        }
        for spheres in [&gas, &lattice(2.0), &lattice(0.3)] {
            let [before, after] = cells::<false>(spheres, ratio, [None; 3]);
            assert!(after <= before && after <= most(spheres.len()), "{ratio}: {before}, {after}");
            let [before, after] =
                cells::<true>(spheres, ratio, [Some(33.0 * cell_size), None, Some(20.0 * cell_size)]);
            assert!(after <= before && after <= most(spheres.len()), "{ratio}: {before}, {after}");
        }
    }
}
