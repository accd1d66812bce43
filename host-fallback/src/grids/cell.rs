//! Comparisons inside a cell. Corner masks select the compared spheres, so that one cell compares every pair.

use std::ops::Range;

use super::entries::MASK_BITS;
use super::workspace::Workspaces;
use crate::Error;
use crate::compare::{Columns, Output, PairTest, SimdTask, SimdWidth, Sink, scan};
use crate::input::{Division, Grouping, SearchInput, search_pieces};
use crate::memory::{try_collect, try_extend, try_push, with_growth};
use crate::radix::{KeyedSphere, RadixKey};

const MASKS: usize = 1 << MASK_BITS;
/// Start and end of a range of corner masks.
type MaskRange = (usize, usize);
/// For each corner mask, the masks at or above it whose pairs with it belong to the cell.
const LATER_PARTNERS: [&[MaskRange]; MASKS] =
    [&[(7, 8)], &[(6, 8)], &[(5, 6), (7, 8)], &[(4, 8)], &[(7, 8)], &[(6, 8)], &[(7, 8)], &[(7, 8)]];
/// For each corner mask, all masks whose pairs with it belong to the cell.
const ALL_PARTNERS: [&[MaskRange]; MASKS] = [
    &[(7, 8)],
    &[(6, 8)],
    &[(5, 6), (7, 8)],
    &[(4, 8)],
    &[(3, 4), (7, 8)],
    &[(2, 4), (6, 8)],
    &[(1, 2), (3, 4), (5, 6), (7, 8)],
    &[(0, 8)],
];
/// Spheres per tile, so that its columns stay near the first-level cache.
const TILE: usize = 1024;
/// Spheres with which a thread compares a tile.
const ROW: usize = 1 << 13;
/// Comparisons, about 0.1 ms, at or above which threads share an overfull cell.
const MIN_PARALLEL_COMPARISONS: usize = 1 << 20;

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

/// Start of the members of each corner mask, and the end.
type Starts = [u32; MASKS + 1];

/// Counts the members of a run, which are sorted by corner mask. The first is at `from`.
fn starts<'m>(run: impl Iterator<Item = &'m (impl CellMember + 'm)>, from: usize) -> Starts {
    let mut starts = [from as u32; MASKS + 1];
    for entry in run {
        starts[entry.corner_mask() + 1] += 1;
    }
    for corner_mask in 1..=MASKS {
        starts[corner_mask] += starts[corner_mask - 1] - from as u32;
    }
    starts
}

/// Returns `true` if the cell may own a pair of its members.
pub(crate) fn owns_pairs(run: &[impl CellMember]) -> bool {
    run.len() > 1 && run.iter().fold(0, |all, entry| all | entry.corner_mask()) == MASKS - 1
}

fn range(starts: &Starts, (first, end): MaskRange) -> Range<usize> {
    starts[first] as usize..starts[end] as usize
}

/// Small cells, gathered and compared together.
#[derive(Debug, Default)]
pub(crate) struct Batch {
    ids: Vec<u32>,
    cells: Vec<Starts>,
    /// Pairs of different groups in a cell.
    meetings: Vec<[Starts; 2]>,
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
            let members = || run.iter().filter(|entry| grouping.of(entry.id() as usize) == group);
            try_push(&mut self.groups, starts(members(), self.ids.len()), "groups of a cell")?;
            members().try_for_each(|member| try_push(&mut self.ids, member.id(), "a batch of cells"))?;
        }
        for (a, b) in grouping.meetings() {
            let both = [self.groups[a], self.groups[b]];
            if both.iter().any(|starts| starts[0] == starts[MASKS]) {
                continue;
            }
            if a == b {
                try_push(&mut self.cells, both[0], "a batch of cells")?;
            } else {
                try_push(&mut self.meetings, both, "a batch of cells")?;
            }
        }
        Ok(())
    }

    /// Returns the most bytes for `entries`: ids, columns, and the starts of cells of two members, doubled by growth.
    pub(crate) fn memory_for(entries: u64) -> u64 {
        with_growth((4 + Columns::BYTES_PER_SPHERE) * entries) + size_of::<Starts>() as u64 * entries + 4096
    }

    pub(crate) fn len(&self) -> usize {
        self.ids.len()
    }

    /// Compares inside all cells, and empties the batch.
    pub(crate) fn search<S: Sink>(&mut self, input: &SearchInput<'_>, sink: &mut S) -> Result<(), Error> {
        let Self { ids, cells, meetings, columns, .. } = self;
        columns.gather(&input.test, ids.iter().copied())?;
        input.run(Cells { columns, test: &input.test, cells, meetings, sink });
        ids.clear();
        cells.clear();
        meetings.clear();
        Ok(())
    }
}

struct Cells<'c, S> {
    columns: &'c Columns,
    test: &'c PairTest<'c>,
    cells: &'c [Starts],
    meetings: &'c [[Starts; 2]],
    sink: &'c mut S,
}

impl<S: Sink> Cells<'_, S> {
    #[inline(always)]
    fn compare<V: SimdWidth>(
        &mut self,
        vector: V,
        [of, with]: [&Starts; 2],
        partners: &[&[MaskRange]; MASKS],
    ) {
        for (corner_mask, partners) in partners.iter().enumerate() {
            for at in range(of, (corner_mask, corner_mask + 1)) {
                for &masks in *partners {
                    let run = range(with, masks);
                    let run = run.start.max(at + 1)..run.end;
                    if !run.is_empty() {
                        scan(vector, (self.columns, self.test), at, run, self.sink);
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
        for of in self.cells {
            self.compare(vector, [of, of], &LATER_PARTNERS);
        }
        for [of, with] in self.meetings {
            self.compare(vector, [of, with], &ALL_PARTNERS);
        }
    }
}

/// Buffers for overfull cells.
#[derive(Debug, Default)]
pub(crate) struct OverfullCells {
    cells: Workspaces<OverfullCell>,
    columns: Workspaces<Columns>,
}

/// An overfull cell, divided into rows of tiles. Spheres are gathered per row, so memory does not grow with the cell.
#[derive(Debug, Default)]
struct OverfullCell {
    rows: Vec<TileRow>,
    /// Positions in the cell, group by group.
    order: Vec<u32>,
}

#[derive(Clone, Debug)]
struct TileRow {
    of: Range<usize>,
    with: Range<usize>,
}

impl OverfullCells {
    pub(crate) fn memory_for(spheres: u64, threads: u64) -> u64 {
        threads * with_growth(Columns::BYTES_PER_SPHERE * spheres.min((TILE + ROW) as u64))
    }

    /// Compares inside one cell, whose entries are sorted by corner mask.
    pub(crate) fn within<'o, O: Output>(
        &self,
        input: &SearchInput<'_>,
        run: &[impl CellMember],
        output: &'o O,
        sink: O::Sink<'o>,
    ) -> Result<O::Sink<'o>, Error> {
        if !owns_pairs(run) {
            return Ok(sink);
        }
        self.among(input, (run, &run[..0]), (output, sink))
    }

    /// Compares `large` with each other and with `small`, all in one cell and sorted by corner mask.
    pub(crate) fn among<'o, O: Output>(
        &self,
        input: &SearchInput<'_>,
        (large, small): (&[impl CellMember], &[impl CellMember]),
        (output, sink): (&'o O, O::Sink<'o>),
    ) -> Result<O::Sink<'o>, Error> {
        self.cells.lend(|cell| {
            cell.arrange_all(input, large, small)?;
            let id = |k: usize| {
                let k = cell.order.get(k).map_or(k, |&member| member as usize);
                if k < large.len() { large[k].id() } else { small[k - large.len()].id() }
            };
            cell.search(input, (&self.columns, id), (output, sink))
        })
    }
}

impl OverfullCell {
    fn arrange_all(
        &mut self,
        input: &SearchInput<'_>,
        large: &[impl CellMember],
        small: &[impl CellMember],
    ) -> Result<(), Error> {
        let grouping = input.grouping(Division::ByPartners);
        self.rows.clear();
        self.order.clear();
        let first = self.arrange(large, 0, &grouping)?;
        let second = self.arrange(small, large.len(), &grouping)?;
        for (a, b) in grouping.meetings() {
            self.plan(&first[a], &first[b], if a == b { &LATER_PARTNERS } else { &ALL_PARTNERS })?;
            self.plan(&first[a], &second[b], &ALL_PARTNERS)?;
            if a != b {
                self.plan(&first[b], &second[a], &ALL_PARTNERS)?;
            }
        }
        Ok(())
    }

    /// Appends the members of a cell to the order, group by group, unless there is one group. Returns each group's
    /// positions. `from` is the first member's index.
    fn arrange(
        &mut self,
        members: &[impl CellMember],
        from: usize,
        grouping: &Grouping<'_>,
    ) -> Result<Vec<Starts>, Error> {
        let mut groups = try_collect(std::iter::empty(), "groups of a cell")?;
        if grouping.count() == 1 {
            try_push(&mut groups, starts(members.iter(), from), "groups of a cell")?;
            return Ok(groups);
        }
        for group in 0..grouping.count() {
            let is_own = |id: u32| grouping.of(id as usize) == group;
            let own = || members.iter().zip(from as u32..).filter(|(member, _)| is_own(member.id()));
            let first = self.order.len();
            try_push(&mut groups, starts(own().map(|(member, _)| member), first), "groups of a cell")?;
            own().try_for_each(|(_, k)| try_push(&mut self.order, k, "spheres of an overfull cell"))?;
        }
        Ok(groups)
    }

    fn plan(&mut self, of: &Starts, with: &Starts, partners: &[&[MaskRange]; MASKS]) -> Result<(), Error> {
        for (corner_mask, partners) in partners.iter().enumerate() {
            for &partners in *partners {
                let (of, with) = (range(of, (corner_mask, corner_mask + 1)), range(with, partners));
                for tile in pieces(of, TILE) {
                    let with = with.start.max(tile.start)..with.end;
                    for with in pieces(with, ROW) {
                        let row = TileRow { of: tile.clone(), with };
                        try_push(&mut self.rows, row, "tiles of an overfull cell")?;
                    }
                }
            }
        }
        Ok(())
    }

    fn search<'o, O: Output>(
        &self,
        input: &SearchInput<'_>,
        (columns, id): (&Workspaces<Columns>, impl Fn(usize) -> u32 + Sync),
        (output, sink): (&'o O, O::Sink<'o>),
    ) -> Result<O::Sink<'o>, Error> {
        let compare = |mut sink: O::Sink<'o>, row: usize| {
            let row = &self.rows[row];
            columns.lend(|columns| {
                let local = row.gather(columns, &input.test, &id)?;
                input.run(TileTask { columns, test: &input.test, row: &local, sink: &mut sink });
                sink.checked()
            })
        };
        let comparisons: usize = self.rows.iter().map(|row| row.of.len() * row.with.len()).sum();
        if comparisons < MIN_PARALLEL_COMPARISONS {
            return (0..self.rows.len()).try_fold(sink, compare);
        }
        sink.merge(search_pieces(output, input, self.rows.len(), 1, compare)?)
    }
}

impl TileRow {
    /// Gathers the spheres of a row. Returns the row with positions in the columns.
    fn gather(
        &self,
        columns: &mut Columns,
        test: &PairTest<'_>,
        id: impl Fn(usize) -> u32,
    ) -> Result<Self, Error> {
        let Self { of, with } = self;
        let rest = with.start.max(of.end)..with.end.max(of.end);
        let (own, fetched) = (of.len(), of.len() + rest.len());
        let place = |k: usize| if k < own { of.start + k } else { rest.start + k - own };
        columns.gather(test, (0..fetched).map(|k| id(place(k))))?;
        let local = |at: usize| if at < of.end { at - of.start } else { at - rest.start + own };
        Ok(Self { of: 0..own, with: local(with.start)..local(with.end) })
    }
}

fn pieces(range: Range<usize>, size: usize) -> impl Iterator<Item = Range<usize>> {
    let end = range.end;
    range.step_by(size).map(move |from| from..end.min(from + size))
}

struct TileTask<'t, S> {
    columns: &'t Columns,
    test: &'t PairTest<'t>,
    row: &'t TileRow,
    sink: &'t mut S,
}

impl<S: Sink> SimdTask for TileTask<'_, S> {
    type Result = ();

    #[inline(always)]
    fn run<V: SimdWidth>(self, vector: V) {
        let Self { columns, test, row, sink } = self;
        for tile in pieces(row.with.clone(), TILE) {
            for at in row.of.clone() {
                // Spheres of one corner mask are compared only with later spheres.
                let run = tile.start.max(at + 1)..tile.end;
                if !run.is_empty() {
                    scan(vector, (columns, test), at, run, sink);
                }
            }
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
