use crate::{Error, InputError, MAX_SPHERES, try_reserve};

const EXCLUDED_PAIRS: &str = "excluded pairs";

/// Pairs that a search never reports, such as bonds.
///
/// Pairs may be in either order and repeated. Each touching pair costs a binary search;
/// [groups](crate::Spheres::with_groups) cost less for whole molecules.
///
/// ```
/// # use lazygrid_kernels::Exclusions;
/// let bonds = Exclusions::new(4, [(0, 1), (2, 1)])?;
/// assert!(bonds.contains(1, 2) && bonds.contains(2, 1) && !bonds.contains(0, 2));
/// assert_eq!(bonds, Exclusions::from_csr(&[0, 1, 2, 2, 2], &[1, 2])?);
/// # Ok::<(), lazygrid_kernels::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Exclusions {
    offsets: Vec<usize>,
    /// The larger index of each pair, or the index in the second set; ascending within a row.
    others: Vec<u32>,
    second: Option<usize>,
}

impl Exclusions {
    /// Creates exclusions among `spheres` spheres, and ignores pairs of a sphere with itself.
    ///
    /// # Errors
    /// [`InputError::ExcludedIndex`] for the first pair with an index out of range, [`InputError::TooManySpheres`] and
    /// [`Error::OutOfMemory`].
    pub fn new(spheres: usize, pairs: impl IntoIterator<Item = (u32, u32)>) -> Result<Self, Error> {
        let mut pairs = checked(spheres, spheres, pairs)?;
        pairs.retain(|(i, j)| i != j);
        pairs.iter_mut().for_each(|(i, j)| (*i, *j) = ((*i).min(*j), (*i).max(*j)));
        Self::from_pairs(spheres, None, pairs)
    }

    /// Creates exclusions across two sets, by index in each set.
    ///
    /// # Errors
    /// See [`new`](Self::new).
    pub fn across(
        first: usize,
        second: usize,
        pairs: impl IntoIterator<Item = (u32, u32)>,
    ) -> Result<Self, Error> {
        Self::from_pairs(first, Some(second), checked(first, second, pairs)?)
    }

    /// Creates exclusions from compressed sparse rows: sphere `i` with each of `indices[offsets[i]..offsets[i + 1]]`. A
    /// pair may be in either of its two rows, or in both.
    ///
    /// # Errors
    /// [`InputError::ExcludedOffsets`] if offsets do not begin with 0, decrease, or do not end with the number of
    /// indices; otherwise as [`new`](Self::new).
    pub fn from_csr(offsets: &[usize], indices: &[u32]) -> Result<Self, Error> {
        let wrong = |at: usize, offset: usize| {
            let (offsets, indices) = (offsets.len(), indices.len());
            Error::from(InputError::ExcludedOffsets { at, offset, offsets, indices })
        };
        let (Some(&start), Some(&end)) = (offsets.first(), offsets.last()) else { return Err(wrong(0, 0)) };
        if start != 0 {
            return Err(wrong(0, start));
        }
        if let Some(at) = (1..offsets.len()).find(|&at| offsets[at] < offsets[at - 1]) {
            return Err(wrong(at, offsets[at]));
        }
        if end != indices.len() {
            return Err(wrong(offsets.len() - 1, end));
        }
        let row = |i: usize| indices[offsets[i]..offsets[i + 1]].iter().map(move |&j| (i as u32, j));
        Self::new(offsets.len() - 1, (0..offsets.len() - 1).flat_map(row))
    }

    fn from_pairs(first: usize, second: Option<usize>, mut pairs: Vec<(u32, u32)>) -> Result<Self, Error> {
        pairs.sort_unstable();
        pairs.dedup();
        let (mut offsets, mut others) = (Vec::new(), Vec::new());
        try_reserve(&mut offsets, first + 1, EXCLUDED_PAIRS)?;
        try_reserve(&mut others, pairs.len(), EXCLUDED_PAIRS)?;
        others.extend(pairs.iter().map(|(_, j)| *j));
        offsets.resize(first + 1, 0);
        for (i, _) in &pairs {
            offsets[*i as usize + 1] += 1;
        }
        for at in 0..first {
            offsets[at + 1] += offsets[at];
        }
        Ok(Self { offsets, others, second })
    }

    /// Returns the number of spheres of each set.
    pub fn spheres(&self) -> (usize, Option<usize>) {
        (self.offsets.len() - 1, self.second)
    }

    /// Returns the number of pairs.
    pub fn len(&self) -> usize {
        self.others.len()
    }

    /// Returns `true` if no pair is excluded.
    pub fn is_empty(&self) -> bool {
        self.others.is_empty()
    }

    /// Returns `true` if this pair is excluded. For one set, the order does not matter; for two, `i` is in the first.
    ///
    /// # Panics
    /// If the row is out of range.
    #[inline]
    pub fn contains(&self, i: u32, j: u32) -> bool {
        let (row, other) = if self.second.is_none() { (i.min(j), i.max(j)) } else { (i, j) };
        let row = self.offsets[row as usize]..self.offsets[row as usize + 1];
        self.others[row].binary_search(&other).is_ok()
    }
}

fn checked(
    first: usize,
    second: usize,
    pairs: impl IntoIterator<Item = (u32, u32)>,
) -> Result<Vec<(u32, u32)>, Error> {
    if let Some(count) =
        [first, second].into_iter().map(|count| count as u64).find(|&count| count > MAX_SPHERES)
    {
        return Err(InputError::TooManySpheres { count }.into());
    }
    let pairs = pairs.into_iter();
    let mut all = Vec::new();
    try_reserve(&mut all, pairs.size_hint().0, EXCLUDED_PAIRS)?;
    for (i, j) in pairs {
        if i as usize >= first || j as usize >= second {
            return Err(InputError::ExcludedIndex { i, j, first, second }.into());
        }
        if all.len() == all.capacity() {
            try_reserve(&mut all, 1, EXCLUDED_PAIRS)?;
        }
        all.push((i, j));
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_in_any_order_and_repeated_are_found() {
        let bonds = Exclusions::new(5, [(4, 0), (0, 1), (1, 0), (3, 3), (2, 4), (0, 4)]).unwrap();
        let named: Vec<_> =
            (0..5).flat_map(|i| (0..5).map(move |j| (i, j))).filter(|&(i, j)| bonds.contains(i, j)).collect();
        assert_eq!(named, [(0, 1), (0, 4), (1, 0), (2, 4), (4, 0), (4, 2)]);
        assert_eq!((bonds.len(), bonds.spheres()), (3, (5, None)));
        assert!(Exclusions::new(0, []).unwrap().is_empty());
        let across = Exclusions::across(2, 9, [(0, 8), (1, 0)]).unwrap();
        assert!(across.contains(0, 8) && across.contains(1, 0) && !across.contains(0, 1));
    }

    #[test]
    fn index_out_of_range_is_refused() {
        let error = Exclusions::new(3, [(0, 1), (2, 3)]).unwrap_err();
        assert!(
            matches!(error, Error::Input(InputError::ExcludedIndex { i: 2, j: 3, first: 3, second: 3 })),
            "{error}"
        );
        assert!(Exclusions::across(3, 1, [(2, 1)]).is_err());
        for (offsets, at) in [(&[][..], 0), (&[1, 2], 0), (&[0, 2, 1, 2], 2), (&[0, 1], 1), (&[0, 3], 1)] {
            let error = Exclusions::from_csr(offsets, &[0, 0]).unwrap_err();
            let is_told =
                matches!(error, Error::Input(InputError::ExcludedOffsets { at: wrong, .. }) if wrong == at);
            assert!(is_told, "{error}");
        }
        let error = Exclusions::new(usize::MAX, []).unwrap_err();
        assert!(matches!(error, Error::Input(InputError::TooManySpheres { .. })), "{error}");
    }
}
