use std::collections::BTreeSet;

use lazygrid::{Error, Exclusions, Spheres};

use crate::TestInput;

pub const EXCLUSION_WORDS: usize = 64;

/// Exclusions for the library, and a plain set for the oracle.
#[derive(Clone, Debug, PartialEq)]
pub struct ExclusionCase {
    list: Exclusions,
    /// Smaller index first.
    pairs: BTreeSet<(u32, u32)>,
}

impl ExclusionCase {
    pub fn new(spheres: usize, pairs: impl IntoIterator<Item = (u32, u32)>) -> Result<Self, Error> {
        let pairs: Vec<(u32, u32)> = pairs.into_iter().collect();
        let list = Exclusions::new(spheres, pairs.iter().copied())?;
        Ok(Self { list, pairs: pairs.into_iter().map(|(i, j)| (i.min(j), i.max(j))).collect() })
    }

    pub fn list(&self) -> &Exclusions {
        &self.list
    }

    pub fn pairs(&self) -> impl Iterator<Item = (u32, u32)> {
        self.pairs.iter().copied()
    }

    pub(crate) fn has(&self, i: u32, j: u32) -> bool {
        self.pairs.contains(&(i.min(j), i.max(j)))
    }

    /// `retained` must ascend.
    pub(crate) fn only(&self, retained: &[usize]) -> Self {
        let index = |k: u32| retained.binary_search(&(k as usize)).ok().map(|index| index as u32);
        let pairs = self.pairs().filter_map(|(i, j)| index(i).zip(index(j)));
        Self::new(retained.len(), pairs).expect("indices among those retained")
    }
}

impl TestInput {
    /// Adds groups, a list of pairs in either order with repetitions, or both.
    pub fn with_exclusions(self, words: &[u32; EXCLUSION_WORDS]) -> Self {
        let spheres = self.spheres.len();
        let word = |k: usize| words[k % words.len()].rotate_left((k / words.len()) as u32 * 7);
        let most = [2, 5, 1 + spheres as u32 / 2][words[0] as usize % 3];
        let group = |k| match word(k) % 8 {
            0 => Spheres::NO_GROUP,
            1 => u32::MAX - 1,
            _ => word(k) / 8 % most,
        };
        let n = spheres.max(1) as u32;
        let pair = |k: usize| (word(2 * k) % n, word(2 * k + 1) % n);
        let kind = words[1] % 3;
        Self {
            groups: (kind != 1).then(|| (0..spheres).map(group).collect()),
            excluded: match kind {
                0 => None,
                _ => ExclusionCase::new(spheres, (0..4 * spheres).map(pair)).ok(),
            },
            ..self
        }
    }
}

#[cfg(test)]
mod tests {
    use lazygrid::{Pair, Sphere};

    use super::*;

    #[test]
    fn exclusions_of_kept_spheres_remain() {
        let scenario = TestInput {
            groups: Some(vec![7, 7, Spheres::NO_GROUP, Spheres::NO_GROUP, 3]),
            excluded: ExclusionCase::new(5, [(4, 1), (2, 2), (1, 4), (0, 3)]).ok(),
            ..vec![Sphere::new([0.0; 3], 1.0); 5].into()
        };
        let pairs = |indices: &[(u32, u32)]| indices.iter().map(|&(i, j)| Pair { i, j }).collect::<Vec<_>>();
        let all = [(0, 2), (0, 4), (1, 2), (1, 3), (2, 3), (2, 4), (3, 4)];
        assert_eq!(scenario.oracle(), pairs(&all));
        let retained = scenario.only(|k| k != 0 && k != 2);
        assert_eq!(retained.oracle(), pairs(&[(0, 1), (1, 2)]));
        assert_eq!(retained.view().groups(), Some(&[7, Spheres::NO_GROUP, 3][..]));
        assert_eq!(retained.excluded.unwrap().pairs().collect::<Vec<_>>(), [(0, 2)]);
        let one = scenario.only(|k| k == 4);
        assert_eq!((one.oracle(), one.query().exclusions().map(Exclusions::len)), (vec![], Some(0)));
    }

    #[test]
    fn all_kinds_of_exclusions_are_drawn() {
        let mut words = [0x1234_5678; EXCLUSION_WORDS];
        let drawn = |words: &[u32; EXCLUSION_WORDS], spheres| {
            let scenario = TestInput::from(vec![Sphere::new([0.0; 3], 1.0); spheres]).with_exclusions(words);
            (scenario.groups.is_some(), scenario.excluded.is_some())
        };
        for (kind, expected) in [(0, (true, false)), (1, (false, true)), (2, (true, true))] {
            words[1] = kind;
            assert_eq!((drawn(&words, 9), drawn(&words, 0)), (expected, expected));
        }
    }
}
