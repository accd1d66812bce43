use lazygrid_kernels::Interaction;

use super::*;
use crate::gpu::test_support::Random;

fn cloud(random: &mut Random, count: usize, far: f32) -> Vec<Sphere> {
    (0..count)
        .map(|k| {
            let center = [(); 3].map(|()| far * (2.0 * random.unit() - 1.0));
            Sphere::new(center, [0.3, 0.05, 0.0, 1.0][k % 4])
        })
        .collect()
}

fn overlaps(input: &SlabInput<'_>, a: usize, b: usize) -> bool {
    let radius = |k: usize| {
        let effective = input.spheres.species().map(|species| input.effective_radii[species[k] as usize]);
        let radius = input.spheres.get(k).radius;
        f64::from(effective.map_or(radius, |effective| effective.for_radius(radius)))
    };
    let [at, other] = [a, b].map(|k| input.spheres.get(k).center);
    !input.is_idle(a)
        && !input.is_idle(b)
        && input.space.distance_squared(at, other) <= (radius(a) + radius(b)).powi(2)
}

/// Checks that slabs find every pair once; returns their number.
fn agrees(input: &SlabInput<'_>, most: usize) -> usize {
    let all = 0..input.spheres.len();
    let pairs = all.clone().flat_map(|i| (i + 1..all.end).map(move |j| (i, j)));
    let split = input.split as usize;
    let pairs = pairs.filter(|&(i, j)| split == 0 || (i < split && j >= split));
    let pairs = pairs.filter(|&(i, j)| overlaps(input, i, j));
    let expected: Vec<Pair> = pairs.map(|(i, j)| Pair { i: i as u32, j: j as u32 }).collect();
    let slabs = Slabs::new(input, most).expect("few overlap");
    let mut slab = Slab::default();
    let count = all.end as u32;
    for cuts in [vec![0, u32::MAX], vec![0, 1, count / 3, count / 2, count]] {
        let mut found = Vec::new();
        for range in cuts.windows(2).map(|ends| ends[0]..ends[1]) {
            for number in 0..slabs.len() {
                slabs.gather(number, input, &range, &mut slab).expect("there is memory");
                let count = slab.indices.len();
                assert!(count <= most, "{count} spheres in a slab of {most}");
                let index_of = |k: u32| slab.indices[k as usize] as usize;
                let window = slab.window();
                let from = slab.split();
                let in_slab =
                    window.flat_map(|i| (from.max(i + 1)..count as u32).map(move |j| Pair { i, j }));
                let mut own: Vec<Pair> =
                    in_slab.filter(|pair| overlaps(input, index_of(pair.i), index_of(pair.j))).collect();
                slab.restore_indices(&mut own);
                assert!(own.iter().all(|pair| range.contains(&pair.i)), "{range:?}");
                found.extend(own);
            }
        }
        found.sort_unstable();
        let wrong = found.iter().zip(&expected).find(|(found, expected)| found != expected);
        assert!(found == expected, "{} pairs, not {}, by {cuts:?}: {wrong:?}", found.len(), expected.len());
    }
    slabs.len()
}

#[test]
fn every_pair_is_found_in_one_slab() {
    let mut random = Random(3);
    let boxed = Space::periodic([Some(12.0), Some(11.0), None]).expect("a box");
    let narrow = Space::periodic([Some(3.0), Some(3.0), Some(12.0)]).expect("a box");
    for (space, far) in [(Space::UNBOUNDED, 6.0), (boxed, 6.0), (narrow, 30.0), (Space::UNBOUNDED, 1e6)] {
        for most in [80, 150, 333] {
            let spheres = cloud(&mut random, 400, far);
            for split in [0, 1, 130, 399, 400] {
                let input = SlabInput::new(Spheres::from(&spheres), None, space).across(split);
                let slabs = agrees(&input, most);
                assert!(slabs > 1, "{space:?}, {most}, {split}");
            }
        }
    }
}

#[test]
fn giants_and_distances_span_several_slabs() {
    let mut random = Random(5);
    let mut spheres = cloud(&mut random, 300, 8.0);
    spheres[7].radius = 9.0;
    spheres[150].radius = 1e30;
    agrees(&SlabInput::new(Spheres::from(&spheres), None, Space::UNBOUNDED), 120);
    let mut table = Interactions::new(2, Interaction::Within(0.2)).expect("a table");
    table.set(0, 1, Interaction::Within(3.0)).expect("a distance");
    let species: Vec<u32> = (0..300).map(|k| u32::from(k % 10 == 0)).collect();
    let spheres = cloud(&mut random, 300, 8.0);
    let all = Spheres::from(&spheres).with_species(&species).expect("as many");
    agrees(&SlabInput::new(all, Some(&table), Space::UNBOUNDED), 250);
}

#[test]
fn spheres_that_never_pair_are_in_no_slab() {
    let mut table = Interactions::new(2, Interaction::Touch).expect("a table");
    (0..2).for_each(|other| table.set(1, other, Interaction::Never).expect("a species"));
    let mut spheres = cloud(&mut Random(9), 300, 8.0);
    spheres.extend([Sphere::new([1.0; 3], 1.0); 300]);
    let species: Vec<u32> = (0..600).map(|k| u32::from(k >= 300)).collect();
    let all = Spheres::from(&spheres).with_species(&species).expect("as many");
    agrees(&SlabInput::new(all, Some(&table), Space::UNBOUNDED), 150);
}

#[test]
fn spheres_that_all_overlap_cannot_be_cut() {
    let spheres = vec![Sphere::new([1.0; 3], 1.0); 100];
    assert!(Slabs::new(&SlabInput::new(Spheres::from(&spheres), None, Space::UNBOUNDED), 60).is_none());
    let mut random = Random(8);
    let boxed = Space::periodic([Some(3.0); 3]).expect("a box");
    let spheres = cloud(&mut random, 100, 1.5);
    assert!(Slabs::new(&SlabInput::new(Spheres::from(&spheres), None, boxed), 60).is_none(), "too narrow");
}
