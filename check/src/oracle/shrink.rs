use glam::Vec3;

use crate::TestInput;

/// Removes exclusions and ever smaller groups of spheres, then rounds numbers. Returns the smallest input
/// for which `failing` describes a fault, within `tries` calls.
pub fn shrink(
    scenario: TestInput,
    what: String,
    tries: usize,
    mut failing: impl FnMut(&TestInput) -> Option<String>,
) -> (TestInput, String) {
    let mut left = tries;
    let mut best = (scenario, what);
    let mut attempt = |best: &mut (TestInput, String), smaller: TestInput| {
        if left == 0 {
            return false;
        }
        left -= 1;
        failing(&smaller).is_some_and(|what| {
            *best = (smaller, what);
            true
        })
    };
    for only_list in [true, false] {
        let mut smaller = best.0.clone();
        let goes =
            if only_list { smaller.groups.take().is_some() } else { smaller.excluded.take().is_some() };
        let _ = goes && attempt(&mut best, smaller);
    }
    let mut group = best.0.spheres.len().div_ceil(2);
    while group > 0 {
        let (before, mut from) = (best.0.spheres.len(), 0);
        while from < best.0.spheres.len() {
            let smaller = best.0.only(|k| !(from..from + group).contains(&k));
            // After a removal, the next group starts at the same index.
            if !attempt(&mut best, smaller) {
                from += group;
            }
        }
        let continues = group > 1 || best.0.spheres.len() < before;
        group = if !continues { 0 } else { (group / 2).max(1) };
    }
    for k in 0..best.0.spheres.len() {
        for rounder in [|_: f32| 0.0, f32::round, |x: f32| (x * 16.0).round() / 16.0] {
            let mut smaller = best.0.clone();
            let sphere = &mut smaller.spheres[k];
            sphere.center = Vec3::from(sphere.center.to_array().map(rounder));
            sphere.radius = rounder(sphere.radius);
            // An overflow would fail for another reason.
            let is_valid = sphere.center.is_finite() && sphere.radius.is_finite();
            if is_valid && smaller != best.0 && attempt(&mut best, smaller) {
                break;
            }
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenes::cloud;
    use crate::{SpeciesSetup, Tolerance, difference};
    use lazygrid::{Interaction, Pair};

    fn broken(scenario: &TestInput) -> Vec<Pair> {
        let mut pairs = scenario.oracle();
        pairs.retain(|pair| {
            (scenario.spheres[pair.i as usize].radius > 0.3)
                == (scenario.spheres[pair.j as usize].radius > 0.3)
        });
        pairs
    }

    fn complaint(scenario: &TestInput) -> Option<String> {
        difference(scenario, &broken(scenario), &scenario.oracle(), Tolerance::Exact).err()
    }

    #[test]
    fn missing_pairs_shrink_to_two_spheres() {
        let spheres = cloud(3, 500, 5.0, |random| 0.5 * random.unit());
        let ids = (0..spheres.len() as u32).map(|k| k % 2).collect();
        let rows = vec![vec![Interaction::Touch], vec![Interaction::Touch; 2]];
        let species = SpeciesSetup { species: ids, rows };
        for mixture in [None, Some(species)] {
            let scenario = TestInput { mixture, ..TestInput::from(spheres.clone()) };
            let what = complaint(&scenario).expect("it is broken");
            let (small, what) = shrink(scenario, what, 5000, complaint);
            assert_eq!(small.spheres.len(), 2, "{small:?}");
            assert!(small.mixture.is_none_or(|mixture| mixture.species.len() == 2));
            assert!(what.contains("1 missing"), "{what}");
        }
    }

    #[test]
    fn exclusions_shrink_with_the_spheres() {
        let words =
            std::array::from_fn(|k| if k == 1 { 2 } else { 0x9e37_79b9_u32.wrapping_mul(k as u32 + 1) });
        let spheres = cloud(3, 500, 5.0, |random| 0.5 * random.unit());
        let scenario = TestInput::from(spheres).with_exclusions(&words);
        for ignores_groups in [true, false] {
            let complaint = |scenario: &TestInput| {
                let mut seen = scenario.clone();
                if ignores_groups {
                    seen.groups = None
                } else {
                    seen.excluded = None
                }
                difference(scenario, &seen.oracle(), &scenario.oracle(), Tolerance::Exact).err()
            };
            let what = complaint(&scenario).expect("it is broken");
            let (small, what) = shrink(scenario.clone(), what, 5000, complaint);
            assert_eq!(small.spheres.len(), 2, "{small:?}");
            assert_eq!((small.groups.is_some(), small.excluded.is_some()), (ignores_groups, !ignores_groups));
            assert!(what.contains("1 extra"), "{what}");
        }
    }

    #[test]
    fn valid_input_stays_valid() {
        let scenario = TestInput::from(vec![lazygrid::Sphere::new([0.3, f32::MAX, -1e38], 1.3e38); 3]);
        let (small, _) = shrink(scenario.clone(), String::new(), 100, |smaller| {
            let nonzero = |s: &lazygrid::Sphere| s.radius > 0.0 && s.center.x > 0.2;
            assert!(smaller.spheres.iter().all(|s| s.center.is_finite() && s.radius.is_finite()));
            smaller.spheres.first().is_some_and(nonzero).then(String::new)
        });
        assert_eq!(small.spheres.len(), 1);
        assert_eq!(small.spheres[0], scenario.spheres[0]);
    }

    #[test]
    fn shrinking_respects_the_limit_of_tries() {
        let scenario = TestInput::from(cloud(3, 500, 5.0, |random| 0.5 * random.unit()));
        let mut calls = 0;
        let (small, what) = shrink(scenario.clone(), "first".to_owned(), 7, |_| {
            calls += 1;
            None
        });
        assert_eq!((calls, small, what.as_str()), (7, scenario, "first"));
    }
}
