//! Comparisons inside overfull cells, in tiles.

use std::ops::Range;

use super::cell::{
    ALL_PARTNERS, CellMember, LATER_PARTNERS, MASKS, MaskRange, Starts, owns_pairs, range, starts,
};
use super::workspace::Workspaces;
use crate::Error;
use crate::compare::{Columns, Output, PairTest, ScanInput, SimdTask, SimdWidth, Sink, scan};
use crate::input::{Division, Grouping, SearchInput, search_chunks};
use crate::memory::{try_collect, try_push, with_growth};

/// Spheres per tile, so that its columns stay near the first-level cache.
const TILE: usize = 1024;
/// Spheres with which a thread compares a tile.
const ROW: usize = 1 << 13;
/// Comparisons, about 0.1 ms, at or above which threads share an overfull cell.
const MIN_PARALLEL_COMPARISONS: usize = 1 << 20;

pub(crate) struct CellMembers<'m, M> {
    /// Compared with all members.
    pub(crate) large: &'m [M],
    /// Compared only with large members.
    pub(crate) small: &'m [M],
}

#[derive(Debug, Default)]
pub(crate) struct OverfullCells {
    cells: Workspaces<OverfullCell>,
    columns: Workspaces<Columns>,
}

/// Spheres are gathered per row of tiles, so memory does not grow with the cell.
#[derive(Debug, Default)]
struct OverfullCell {
    rows: Vec<TileRow>,
    order: Vec<u32>,
}

#[derive(Clone, Debug)]
struct TileRow {
    first: Range<usize>,
    second: Range<usize>,
}

impl OverfullCells {
    pub(crate) fn memory_for(spheres: u64, threads: u64) -> u64 {
        threads * with_growth(Columns::BYTES_PER_SPHERE * spheres.min((TILE + ROW) as u64))
    }

    /// `run` is sorted by corner mask.
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
        self.among(input, CellMembers { large: run, small: &[] }, output, sink)
    }

    pub(crate) fn among<'o, O: Output>(
        &self,
        input: &SearchInput<'_>,
        members: CellMembers<'_, impl CellMember>,
        output: &'o O,
        sink: O::Sink<'o>,
    ) -> Result<O::Sink<'o>, Error> {
        let CellMembers { large, small } = members;
        self.cells.lend(|cell| {
            cell.arrange_all(input, large, small)?;
            let cell = &*cell;
            let id = |k: usize| {
                let k = cell.order.get(k).map_or(k, |&member| member as usize);
                if k < large.len() { large[k].id() } else { small[k - large.len()].id() }
            };
            cell.search(input, output, sink, |mut sink, row| {
                self.columns.lend(|columns| {
                    let local = row.gather(columns, &input.test, id)?;
                    input.run(TileTask { columns, test: &input.test, row: &local, sink: &mut sink });
                    sink.checked()
                })
            })
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
        for (a, b) in grouping.paired_groups() {
            self.plan(&first[a], &first[b], if a == b { &LATER_PARTNERS } else { &ALL_PARTNERS })?;
            self.plan(&first[a], &second[b], &ALL_PARTNERS)?;
            if a != b {
                self.plan(&first[b], &second[a], &ALL_PARTNERS)?;
            }
        }
        Ok(())
    }

    /// Orders members group by group, unless only one group exists. Returns each group's positions.
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
            let is_own = |id: u32| grouping.group_of(id as usize) == group;
            let own = || members.iter().zip(from as u32..).filter(|(member, _)| is_own(member.id()));
            let first = self.order.len();
            try_push(&mut groups, starts(own().map(|(member, _)| member), first), "groups of a cell")?;
            own().try_for_each(|(_, k)| try_push(&mut self.order, k, "spheres of an overfull cell"))?;
        }
        Ok(groups)
    }

    fn plan(
        &mut self,
        first: &Starts,
        second: &Starts,
        partners: &[&[MaskRange]; MASKS],
    ) -> Result<(), Error> {
        for (corner_mask, partners) in partners.iter().enumerate() {
            for &partners in *partners {
                let (first, second) = (range(first, (corner_mask, corner_mask + 1)), range(second, partners));
                for tile in tiles(first, TILE) {
                    let second = second.start.max(tile.start)..second.end;
                    for second in tiles(second, ROW) {
                        let row = TileRow { first: tile.clone(), second };
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
        output: &'o O,
        sink: O::Sink<'o>,
        compare: impl Fn(O::Sink<'o>, &TileRow) -> Result<O::Sink<'o>, Error> + Send + Sync,
    ) -> Result<O::Sink<'o>, Error> {
        let compare = |sink, row: usize| compare(sink, &self.rows[row]);
        let comparisons: usize = self.rows.iter().map(|row| row.first.len() * row.second.len()).sum();
        if comparisons < MIN_PARALLEL_COMPARISONS {
            return (0..self.rows.len()).try_fold(sink, compare);
        }
        sink.merge(search_chunks(output, input, self.rows.len(), 1, compare)?)
    }
}

impl TileRow {
    fn gather(
        &self,
        columns: &mut Columns,
        test: &PairTest<'_>,
        id: impl Fn(usize) -> u32,
    ) -> Result<Self, Error> {
        let Self { first, second } = self;
        let rest = second.start.max(first.end)..second.end.max(first.end);
        let (own, fetched) = (first.len(), first.len() + rest.len());
        let position = |k: usize| if k < own { first.start + k } else { rest.start + k - own };
        columns.gather(test, (0..fetched).map(|k| id(position(k))))?;
        let local = |at: usize| if at < first.end { at - first.start } else { at - rest.start + own };
        Ok(Self { first: 0..own, second: local(second.start)..local(second.end) })
    }
}

fn tiles(range: Range<usize>, size: usize) -> impl Iterator<Item = Range<usize>> {
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
        for tile in tiles(row.second.clone(), TILE) {
            for at in row.first.clone() {
                let run = tile.start.max(at + 1)..tile.end;
                if !run.is_empty() {
                    scan(vector, ScanInput { columns, test }, at, run, sink);
                }
            }
        }
    }
}
