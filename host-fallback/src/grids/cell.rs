//! Comparisons inside a cell. Corner masks select the compared spheres, so that one cell compares every pair.

use std::ops::Range;

use super::entries::MASK_BITS;
use crate::Error;
use crate::compare::{Columns, PairTest, ScanInput, SimdTask, SimdWidth, Sink, scan};
use crate::input::{Grouping, SearchInput};
use crate::memory::{try_extend, try_push, with_growth};
use crate::radix::{KeyedSphere, RadixKey};

pub(super) const MASKS: usize = 1 << MASK_BITS;
pub(super) type MaskRange = (usize, usize);
/// For each corner mask, the masks at or above it whose pairs with it belong to the cell.
pub(super) const LATER_PARTNERS: [&[MaskRange]; MASKS] =
    [&[(7, 8)], &[(6, 8)], &[(5, 6), (7, 8)], &[(4, 8)], &[(7, 8)], &[(6, 8)], &[(7, 8)], &[(7, 8)]];
/// For each corner mask, all masks whose pairs with it belong to the cell.
pub(super) const ALL_PARTNERS: [&[MaskRange]; MASKS] = [
    &[(7, 8)],
    &[(6, 8)],
    &[(5, 6), (7, 8)],
    &[(4, 8)],
    &[(3, 4), (7, 8)],
    &[(2, 4), (6, 8)],
    &[(1, 2), (3, 4), (5, 6), (7, 8)],
    &[(0, 8)],
];
pub(crate) trait CellMember: Sync {
    fn id(&self) -> u32;
    /// A bit per axis, set if the cell is the sphere's lowest on that axis.
    fn corner_mask(&self) -> usize;
}

impl<K: RadixKey> CellMember for KeyedSphere<K> {
    #[inline(always)]
    fn id(&self) -> u32 {
        self.id
    }

    #[inline(always)]
    fn corner_mask(&self) -> usize {
        self.key.low() as usize & (MASKS - 1)
    }
}

/// Start of each corner mask's members, and the end.
pub(super) type Starts = [u32; MASKS + 1];

/// The run is sorted by corner mask; its first member is at `from`.
pub(super) fn starts<'m>(run: impl Iterator<Item = &'m (impl CellMember + 'm)>, from: usize) -> Starts {
    let mut starts = [from as u32; MASKS + 1];
    for entry in run {
        starts[entry.corner_mask() + 1] += 1;
    }
    for corner_mask in 1..=MASKS {
        starts[corner_mask] += starts[corner_mask - 1] - from as u32;
    }
    starts
}

pub(crate) fn owns_pairs(run: &[impl CellMember]) -> bool {
    run.len() > 1 && run.iter().fold(0, |all, entry| all | entry.corner_mask()) == MASKS - 1
}

pub(super) fn range(starts: &Starts, (first, end): MaskRange) -> Range<usize> {
    starts[first] as usize..starts[end] as usize
}

#[derive(Debug, Default)]
pub(crate) struct Batch {
    ids: Vec<u32>,
    cells: Vec<Starts>,
    group_pairs: Vec<[Starts; 2]>,
    groups: Vec<Starts>,
    columns: Columns,
}

impl Batch {
    #[inline]
    pub(crate) fn push(&mut self, run: &[impl CellMember], grouping: &Grouping<'_>) -> Result<(), Error> {
        if !owns_pairs(run) {
            return Ok(());
        }
        if grouping.count() == 1 {
            try_push(&mut self.cells, starts(run.iter(), self.ids.len()), "a batch of cells")?;
            return try_extend(&mut self.ids, run.iter().map(CellMember::id), "a batch of cells");
        }
        self.groups.clear();
        for group in 0..grouping.count() {
            let members = || run.iter().filter(|entry| grouping.group_of(entry.id() as usize) == group);
            try_push(&mut self.groups, starts(members(), self.ids.len()), "groups of a cell")?;
            members().try_for_each(|member| try_push(&mut self.ids, member.id(), "a batch of cells"))?;
        }
        for (a, b) in grouping.paired_groups() {
            let both = [self.groups[a], self.groups[b]];
            if both.iter().any(|starts| starts[0] == starts[MASKS]) {
                continue;
            }
            if a == b {
                try_push(&mut self.cells, both[0], "a batch of cells")?;
            } else {
                try_push(&mut self.group_pairs, both, "a batch of cells")?;
            }
        }
        Ok(())
    }

    /// Counts ids, columns, and starts of cells of two members, doubled by growth.
    pub(crate) fn memory_for(entries: u64) -> u64 {
        with_growth((4 + Columns::BYTES_PER_SPHERE) * entries) + size_of::<Starts>() as u64 * entries + 4096
    }

    pub(crate) fn len(&self) -> usize {
        self.ids.len()
    }

    pub(crate) fn search<S: Sink>(&mut self, input: &SearchInput<'_>, sink: &mut S) -> Result<(), Error> {
        let Self { ids, cells, group_pairs, columns, .. } = self;
        columns.gather(&input.test, ids.iter().copied())?;
        input.run(Cells { columns, test: &input.test, cells, group_pairs, sink });
        ids.clear();
        cells.clear();
        group_pairs.clear();
        Ok(())
    }
}

struct Cells<'c, S> {
    columns: &'c Columns,
    test: &'c PairTest<'c>,
    cells: &'c [Starts],
    group_pairs: &'c [[Starts; 2]],
    sink: &'c mut S,
}

impl<S: Sink> Cells<'_, S> {
    #[inline(always)]
    fn compare<V: SimdWidth>(
        &mut self,
        vector: V,
        [first, second]: [&Starts; 2],
        partners: &[&[MaskRange]; MASKS],
    ) {
        let input = ScanInput { columns: self.columns, test: self.test };
        for (corner_mask, partners) in partners.iter().enumerate() {
            for at in range(first, (corner_mask, corner_mask + 1)) {
                for &masks in *partners {
                    let run = range(second, masks);
                    let run = run.start.max(at + 1)..run.end;
                    if !run.is_empty() {
                        scan(vector, input, at, run, self.sink);
                    }
                }
            }
        }
    }
}

impl<S: Sink> SimdTask for Cells<'_, S> {
    type Result = ();

    #[inline(always)]
    fn run<V: SimdWidth>(mut self, vector: V) {
        for cell in self.cells {
            self.compare(vector, [cell, cell], &LATER_PARTNERS);
        }
        for [first, second] in self.group_pairs {
            self.compare(vector, [first, second], &ALL_PARTNERS);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn partners_are_the_corner_masks_that_have_all_bits_together() {
        for corner_mask in 0..MASKS {
            let among =
                |ranges: &[MaskRange], other| ranges.iter().any(|&(from, to)| from <= other && other < to);
            for other in 0..MASKS {
                let own = corner_mask | other == MASKS - 1;
                assert_eq!(among(ALL_PARTNERS[corner_mask], other), own, "any of {corner_mask} and {other}");
                assert_eq!(
                    among(LATER_PARTNERS[corner_mask], other),
                    own && other >= corner_mask,
                    "later of {corner_mask} and {other}"
                );
            }
        }
    }
}
