use lazygrid_kernels::{Pair, Query};

use crate::Error;
use crate::memory::try_resize;

/// Neighbor lists in compressed sparse rows: the neighbors of sphere `k` are `indices()[offsets()[k]..offsets()[k +
/// 1]]`, ascending. Every pair is in the lists of both spheres; for two sets only spheres of the first have a list,
/// with indices in the second.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Neighbors<'a> {
    offsets: &'a [u64],
    indices: &'a [u32],
}

impl<'a> Neighbors<'a> {
    /// Start of each sphere's list; the last is the length of [`indices`](Self::indices).
    pub fn offsets(&self) -> &'a [u64] {
        self.offsets
    }

    /// Neighbors, list after list.
    pub fn indices(&self) -> &'a [u32] {
        self.indices
    }

    /// Lists in order of their spheres.
    pub fn iter(&self) -> NeighborsIter<'a> {
        NeighborsIter { ends: self.offsets.windows(2), indices: self.indices }
    }

    /// Neighbors of sphere `k`.
    ///
    /// # Panics
    /// Panics if there is no sphere `k`.
    pub fn neighbors_of(&self, k: usize) -> &'a [u32] {
        &self.indices[self.offsets[k] as usize..self.offsets[k + 1] as usize]
    }

    /// Number of lists.
    pub fn len(&self) -> usize {
        self.offsets.len() - 1
    }

    /// Returns `true` if there are no lists.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

impl<'a> IntoIterator for Neighbors<'a> {
    type Item = &'a [u32];
    type IntoIter = NeighborsIter<'a>;

    fn into_iter(self) -> NeighborsIter<'a> {
        self.iter()
    }
}

impl<'a> IntoIterator for &Neighbors<'a> {
    type Item = &'a [u32];
    type IntoIter = NeighborsIter<'a>;

    fn into_iter(self) -> NeighborsIter<'a> {
        self.iter()
    }
}

/// An iterator over the lists of [`Neighbors`], in order of their spheres.
#[derive(Clone, Debug)]
pub struct NeighborsIter<'a> {
    ends: std::slice::Windows<'a, u64>,
    indices: &'a [u32],
}

impl<'a> NeighborsIter<'a> {
    fn list(&self, ends: &[u64]) -> &'a [u32] {
        &self.indices[ends[0] as usize..ends[1] as usize]
    }
}

impl<'a> Iterator for NeighborsIter<'a> {
    type Item = &'a [u32];

    fn next(&mut self) -> Option<&'a [u32]> {
        self.ends.next().map(|ends| self.list(ends))
    }

    fn nth(&mut self, n: usize) -> Option<&'a [u32]> {
        self.ends.nth(n).map(|ends| self.list(ends))
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        self.ends.size_hint()
    }
}

impl DoubleEndedIterator for NeighborsIter<'_> {
    fn next_back(&mut self) -> Option<Self::Item> {
        self.ends.next_back().map(|ends| self.list(ends))
    }
}

impl ExactSizeIterator for NeighborsIter<'_> {}

impl std::iter::FusedIterator for NeighborsIter<'_> {}

/// Turns pairs into neighbor lists, in reused buffers.
#[derive(Debug, Default)]
pub struct NeighborsBuilder {
    offsets: Vec<u64>,
    next: Vec<u64>,
    indices: Vec<u32>,
}

impl NeighborsBuilder {
    /// Builds the lists of a query from its pairs in canonical order.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    pub fn fill_query(&mut self, pairs: &[Pair], query: &Query<'_>) -> Result<Neighbors<'_>, Error> {
        self.rows(pairs, query.first().len(), query.split().is_none())
    }

    /// Builds `rows` lists from pairs in canonical order. If mirrored, the second sphere of a pair also lists the
    /// first.
    pub(crate) fn rows(
        &mut self,
        pairs: &[Pair],
        rows: usize,
        is_mirrored: bool,
    ) -> Result<Neighbors<'_>, Error> {
        if is_mirrored { self.fill(pairs, rows) } else { self.fill_between(pairs, rows) }
    }

    /// A list begins with the pairs in which its sphere is second, so it is ascending.
    fn fill(&mut self, pairs: &[Pair], spheres: usize) -> Result<Neighbors<'_>, Error> {
        let Self { offsets, next, indices } = self;
        try_resize(offsets, spheres + 1, "neighbor lists")?;
        try_resize(next, spheres, "neighbor lists")?;
        try_resize(indices, 2 * pairs.len(), "neighbor lists")?;
        offsets.fill(0);
        for pair in pairs {
            offsets[pair.i as usize + 1] += 1;
            offsets[pair.j as usize + 1] += 1;
        }
        for k in 1..=spheres {
            offsets[k] += offsets[k - 1];
        }
        next.copy_from_slice(&offsets[..spheres]);
        for backward in [true, false] {
            for pair in pairs {
                let (row, other) = if backward { (pair.j, pair.i) } else { (pair.i, pair.j) };
                let slot = &mut next[row as usize];
                indices[*slot as usize] = other;
                *slot += 1;
            }
        }
        Ok(Neighbors { offsets, indices })
    }

    fn fill_between(&mut self, pairs: &[Pair], rows: usize) -> Result<Neighbors<'_>, Error> {
        let Self { offsets, indices, .. } = self;
        try_resize(offsets, rows + 1, "neighbor lists")?;
        try_resize(indices, pairs.len(), "neighbor lists")?;
        offsets.fill(0);
        for (index, pair) in indices.iter_mut().zip(pairs) {
            offsets[pair.i as usize + 1] += 1;
            *index = pair.j;
        }
        for k in 1..=rows {
            offsets[k] += offsets[k - 1];
        }
        Ok(Neighbors { offsets, indices })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pair_is_in_both_lists_ascending() {
        let pairs = [(0, 2), (0, 4), (1, 2), (2, 3), (2, 4)].map(|(i, j)| Pair { i, j });
        let mut lists = NeighborsBuilder::default();
        let neighbors = lists.fill(&pairs, 6).expect("there is memory");
        let expected: [&[u32]; 6] = [&[2, 4], &[2], &[0, 1, 3, 4], &[2], &[0, 2], &[]];
        assert_eq!(neighbors.len(), 6);
        for (k, list) in expected.iter().enumerate() {
            assert_eq!(neighbors.neighbors_of(k), *list, "sphere {k}");
        }
        let iter = neighbors.iter();
        assert_eq!((iter.len(), iter.clone().nth(2)), (6, Some(expected[2])));
        assert!(iter.rev().eq(expected.into_iter().rev()));
    }

    #[test]
    fn no_spheres_and_no_pairs() {
        let mut lists = NeighborsBuilder::default();
        let mut none = |spheres| lists.fill(&[], spheres).expect("there is memory").len();
        assert_eq!((none(0), none(2)), (0, 2));
        assert_eq!(lists.fill(&[], 2).expect("there is memory").neighbors_of(1), &[] as &[u32]);
    }
}
