use lazygrid::Pair;

use crate::TestInput;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tolerance {
    /// For the CPU.
    Exact,
    /// For the GPU: pairs within 4 ulp of tangency, relative to the squared cutoff, may be missing or extra.
    /// In a periodic space the limit is 5 ulp, as a distance across the boundary is a sum of two. Points and
    /// triclinic cells are exact.
    Tangent,
}

impl Tolerance {
    /// Returns `true` if the pair may be missing or extra.
    pub fn allows(self, scenario: &TestInput, pair: Pair) -> bool {
        if scenario.space.triclinic_cell().is_some() {
            // The host applies the exact test to all pairs of a triclinic cell.
            return false;
        }
        let ulps = if scenario.space.is_periodic() { 5.0 } else { 4.0 } * f64::from(f32::EPSILON);
        let (i, j) = (pair.i as usize, pair.j as usize);
        match (self, scenario.cutoff(i, j)) {
            (Self::Exact, _) | (_, None) => false,
            (Self::Tangent, Some(cutoff)) => {
                let limit = cutoff * cutoff;
                limit > 0.0
                    && limit.is_finite()
                    && (scenario.distance_squared(i, j) - limit).abs() <= ulps * limit
            }
        }
    }
}

/// Accepts `found` in any order, and `expected` in canonical order.
///
/// # Errors
/// Counts missing, extra, duplicate and malformed pairs, and describes the first of each.
pub fn difference(
    scenario: &TestInput,
    found: &[Pair],
    expected: &[Pair],
    tolerance: Tolerance,
) -> Result<(), String> {
    let spheres = scenario.spheres.len() as u32;
    let malformed = found.iter().filter(|p| p.i >= p.j || p.j >= spheres).copied().collect::<Vec<_>>();
    if let Some(first) = malformed.first() {
        return Err(format!("{} malformed pairs of {spheres} spheres, first {first:?}", malformed.len()));
    }
    let mut sorted = found.to_vec();
    sorted.sort_unstable();
    if sorted == expected {
        return Ok(());
    }
    let twice: Vec<Pair> = sorted.windows(2).filter(|w| w[0] == w[1]).map(|w| w[0]).collect();
    sorted.dedup();
    let not_in = |sorted: &[Pair], pairs: &[Pair]| -> Vec<Pair> {
        let absent = pairs.iter().filter(|p| sorted.binary_search(p).is_err());
        absent.filter(|&&p| !tolerance.allows(scenario, p)).copied().collect()
    };
    let (missing, extra) = (not_in(&sorted, expected), not_in(expected, &sorted));
    if missing.is_empty() && extra.is_empty() && twice.is_empty() {
        return Ok(());
    }
    let mut text = format!("{} pairs found, {} expected", found.len(), expected.len());
    for (kind, pairs) in [("missing", missing), ("extra", extra), ("duplicate", twice)] {
        if let Some(&first) = pairs.first() {
            text += &format!("; {} {kind}, first {}", pairs.len(), describe(scenario, first));
        }
    }
    Err(text)
}

fn describe(scenario: &TestInput, pair: Pair) -> String {
    let (i, j) = (pair.i as usize, pair.j as usize);
    let sphere = |k: usize| {
        let s = scenario.spheres[k];
        format!("{k}: [{:?}, {:?}, {:?}, {:?}]", s.center.x, s.center.y, s.center.z, s.radius)
    };
    let distance = scenario.distance_squared(i, j).sqrt();
    let gap = scenario.cutoff(i, j).map_or("never a pair".to_owned(), |r| format!("gap {:e}", distance - r));
    format!("{} and {}, {gap}", sphere(i), sphere(j))
}

/// Returns a checksum that ignores the order of pairs, but not duplicates.
pub fn checksum(pairs: &[Pair]) -> u64 {
    // The finalizer of SplitMix64.
    let mix = |pair: &Pair| {
        let mut x = u64::from(pair.i) << 32 | u64::from(pair.j);
        x = (x ^ x >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        x = (x ^ x >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        x ^ x >> 31
    };
    pairs.iter().map(mix).fold(0, u64::wrapping_add)
}

#[cfg(test)]
mod tests {
    use lazygrid::Sphere;

    use super::*;

    fn pairs(indices: &[(u32, u32)]) -> Vec<Pair> {
        indices.iter().map(|&(i, j)| Pair { i, j }).collect()
    }

    fn verdict(coordinates: &[f32], found: &[(u32, u32)], tolerance: Tolerance) -> Result<(), String> {
        let row: Vec<_> = coordinates.iter().map(|&x| Sphere::new([x, 0.0, 0.0], 1.0)).collect();
        let scenario = TestInput::from(row);
        difference(&scenario, &pairs(found), &scenario.oracle(), tolerance)
    }

    #[test]
    fn all_kinds_of_errors_are_detected() {
        let exact = |found: &[(u32, u32)]| verdict(&[0.0, 2.0, 4.0, 6.0], found, Tolerance::Exact);
        let fails = |found, word| exact(found).is_err_and(|text| text.contains(word));
        assert_eq!(exact(&[(2, 3), (0, 1), (1, 2)]), Ok(()));
        assert!(fails(&[(0, 1), (2, 3)], "1 missing, first 1: [2.0, 0.0, 0.0, 1.0] and 2:"));
        assert!(fails(&[(0, 1), (1, 2), (1, 3), (2, 3)], "1 extra, first 1:"));
        assert!(fails(&[(0, 1), (1, 2), (2, 3), (1, 2)], "1 duplicate, first 1:"));
        assert!(fails(&[(0, 1), (2, 1), (2, 3)], "1 malformed"));
        assert!(fails(&[(0, 1), (1, 2), (2, 3), (3, 4)], "1 malformed"));
        assert!(fails(&[(0, 1), (1, 1), (2, 3)], "1 malformed"));
    }

    #[test]
    fn only_tangent_pairs_may_differ_on_the_gpu() {
        use Tolerance::{Exact, Tangent};
        let [none, one] = [&[][..], &[(0, 1)]];
        assert_eq!(verdict(&[0.0, 2.0], none, Tangent), Ok(()));
        assert!(verdict(&[0.0, 2.0], none, Exact).is_err());
        let ulp = 2.0 * f32::EPSILON;
        assert_eq!(verdict(&[0.0, 2.0 + ulp], one, Tangent), Ok(()));
        assert!(verdict(&[0.0, 2.0 + ulp], one, Exact).is_err());
        assert!(verdict(&[0.0, 2.0 + 3.0 * ulp], one, Tangent).is_err());
        assert!(verdict(&[0.0, 2.0 - 3.0 * ulp], none, Tangent).is_err());
        assert!(verdict(&[0.0, 2.0], &[(0, 1), (0, 1)], Tangent).is_err());
    }

    #[test]
    fn checksum_ignores_order_but_not_pairs() {
        let [a, b] = [[(0, 1), (2, 3)], [(2, 3), (0, 1)]].map(|p| checksum(&pairs(&p)));
        assert_eq!(a, b);
        assert_ne!(a, checksum(&pairs(&[(0, 1), (2, 3), (2, 3)])));
        assert_ne!(a, checksum(&pairs(&[(0, 3), (2, 1)])));
    }
}
