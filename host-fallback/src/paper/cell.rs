//! Comparisons inside a cell: which of its spheres meet, by class, so that every pair is the business of one cell.

use std::ops::Range;

use super::entries::CLASS_BITS;
use super::workspace::Workspaces;
use crate::Error;
use crate::compare::{Columns, Output, Rule, Sink, Task, Vector, scan};
use crate::input::{Input, search_pieces};
use crate::memory::{extend, push, with_growth};
use crate::radix::{Entry, Key};

/// The number of classes.
const CLASSES: usize = 1 << CLASS_BITS;
/// Neighbouring classes: the first, and the one behind the last.
type Classes = (usize, usize);
/// For each class, the classes from itself on whose pairs with it belong to the cell.
const LATER: [&[Classes]; CLASSES] =
    [&[(7, 8)], &[(6, 8)], &[(5, 6), (7, 8)], &[(4, 8)], &[(7, 8)], &[(6, 8)], &[(7, 8)], &[(7, 8)]];
/// For each class, all classes whose pairs with it belong to the cell.
const ANY: [&[Classes]; CLASSES] = [
    &[(7, 8)],
    &[(6, 8)],
    &[(5, 6), (7, 8)],
    &[(4, 8)],
    &[(3, 4), (7, 8)],
    &[(2, 4), (6, 8)],
    &[(1, 2), (3, 4), (5, 6), (7, 8)],
    &[(0, 8)],
];
/// Spheres per tile side, so that what a tile loops over stays in the first-level cache's reach.
const TILE: usize = 1024;
/// Spheres that one row of tiles compares with at most: a unit of work for a thread.
const ROW: usize = 1 << 13;
/// Comparisons from which a cell's rows are spread over threads, about 0.1 ms.
const SPREAD: usize = 1 << 20;

/// A sphere in a cell.
pub(crate) trait Occupant: Sync {
    /// Its index in the input.
    fn id(&self) -> u32;
    /// On which axes the cell is its lowest, one bit per axis.
    fn class(&self) -> usize;
}

impl<K: Key> Occupant for Entry<K> {
    #[inline(always)]
    fn id(&self) -> u32 {
        self.id
    }

    #[inline(always)]
    fn class(&self) -> usize {
        self.key.low() as usize & (CLASSES - 1)
    }
}

/// The start of each class among the spheres of a cell, and the end of the last one.
type Starts = [u32; CLASSES + 1];

/// The start of each class among entries sorted by class, of which the first is at `from`.
fn starts(run: &[impl Occupant], from: usize) -> Starts {
    let mut starts = [from as u32; CLASSES + 1];
    for entry in run {
        starts[entry.class() + 1] += 1;
    }
    for class in 1..=CLASSES {
        starts[class] += starts[class - 1] - from as u32;
    }
    starts
}

/// Returns `true` if classes make any pair of these the cell's own.
pub(crate) fn owns_pairs(run: &[impl Occupant]) -> bool {
    run.len() > 1 && run.iter().fold(0, |all, entry| all | entry.class()) == CLASSES - 1
}

fn range(starts: &Starts, (first, end): Classes) -> Range<usize> {
    starts[first] as usize..starts[end] as usize
}

/// Small cells, gathered so that their spheres are fetched together and compared in one go.
#[derive(Debug, Default)]
pub(crate) struct Batch {
    ids: Vec<u32>,
    cells: Vec<Starts>,
    columns: Columns,
}

impl Batch {
    /// Adds the entries of one cell, sorted by class.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    #[inline]
    pub(crate) fn push(&mut self, run: &[impl Occupant]) -> Result<(), Error> {
        if owns_pairs(run) {
            push(&mut self.cells, starts(run, self.ids.len()), "a batch of cells")?;
            extend(&mut self.ids, run.iter().map(Occupant::id), "a batch of cells")?;
        }
        Ok(())
    }

    /// The most bytes held where no more than `entries` are gathered: ids, columns, and the classes of cells of two, for
    /// which room is doubled.
    pub(crate) fn memory_for(entries: u64) -> u64 {
        with_growth((4 + Columns::BYTES_PER_SPHERE) * entries) + size_of::<Starts>() as u64 * entries + 4096
    }

    /// The number of spheres that wait.
    pub(crate) fn len(&self) -> usize {
        self.ids.len()
    }

    /// Compares inside every cell, and empties the batch.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    pub(crate) fn search<S: Sink>(&mut self, input: &Input<'_>, sink: &mut S) -> Result<(), Error> {
        let Self { ids, cells, columns } = self;
        columns.gather(&input.rule, ids.iter().copied())?;
        input.run(Cells { columns, rule: &input.rule, cells, sink });
        ids.clear();
        cells.clear();
        Ok(())
    }
}

struct Cells<'c, S> {
    columns: &'c Columns,
    rule: &'c Rule<'c>,
    cells: &'c [Starts],
    sink: &'c mut S,
}

impl<S: Sink> Task for Cells<'_, S> {
    type Result = ();

    #[inline(always)]
    fn run<V: Vector>(self, vector: V) {
        let Self { columns, rule, cells, sink } = self;
        for starts in cells {
            for (class, later) in LATER.iter().enumerate() {
                for at in range(starts, (class, class + 1)) {
                    for &classes in *later {
                        let run = range(starts, classes);
                        let run = run.start.max(at + 1)..run.end;
                        if !run.is_empty() {
                            scan(vector, (columns, rule), at, run, sink);
                        }
                    }
                }
            }
        }
    }
}

/// A crowded cell, whose comparisons are cut into rows of tiles. Each row's spheres are fetched for it alone, so that
/// no more of them are held than a row has, however many are in the cell.
#[derive(Debug, Default)]
pub(crate) struct Crowd {
    rows: Vec<Row>,
    columns: Workspaces<Columns>,
}

/// Some spheres and a range of others, none of them earlier, to compare them with.
#[derive(Clone, Debug)]
struct Row {
    of: Range<usize>,
    with: Range<usize>,
}

impl Crowd {
    /// The most bytes held for cells of `spheres` spheres.
    pub(crate) fn memory_for(spheres: u64, threads: u64) -> u64 {
        threads * with_growth(Columns::BYTES_PER_SPHERE * spheres.min((TILE + ROW) as u64))
    }

    /// Compares inside one cell, whose entries are sorted by class.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    pub(crate) fn within<'o, O: Output>(
        &mut self,
        input: &Input<'_>,
        run: &[impl Occupant],
        (output, sink): (&'o O, O::Sink<'o>),
    ) -> Result<O::Sink<'o>, Error> {
        if !owns_pairs(run) {
            return Ok(sink);
        }
        self.rows.clear();
        let starts = starts(run, 0);
        self.plan(&starts, &starts, &LATER)?;
        self.search(input, |k| run[k].id(), (output, sink))
    }

    /// Compares the spheres `large` of one cell with each other and with its other spheres `small`; the entries of
    /// both are sorted by class.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    pub(crate) fn among<'o, O: Output>(
        &mut self,
        input: &Input<'_>,
        (large, small): (&[impl Occupant], &[impl Occupant]),
        (output, sink): (&'o O, O::Sink<'o>),
    ) -> Result<O::Sink<'o>, Error> {
        self.rows.clear();
        let (first, second) = (starts(large, 0), starts(small, large.len()));
        self.plan(&first, &first, &LATER)?;
        self.plan(&first, &second, &ANY)?;
        let id = |k: usize| if k < large.len() { large[k].id() } else { small[k - large.len()].id() };
        self.search(input, id, (output, sink))
    }

    /// Adds rows for every class of `of` with its partners among those of `with`.
    fn plan(&mut self, of: &Starts, with: &Starts, partners: &[&[Classes]; CLASSES]) -> Result<(), Error> {
        for (class, partners) in partners.iter().enumerate() {
            for &partners in *partners {
                let (of, with) = (range(of, (class, class + 1)), range(with, partners));
                for tile in pieces(of, TILE) {
                    let with = with.start.max(tile.start)..with.end;
                    for with in pieces(with, ROW) {
                        push(&mut self.rows, Row { of: tile.clone(), with }, "tiles of a crowded cell")?;
                    }
                }
            }
        }
        Ok(())
    }

    /// Compares the rows; `id` tells the sphere at a place in the cell.
    fn search<'o, O: Output>(
        &self,
        input: &Input<'_>,
        id: impl Fn(usize) -> u32 + Sync,
        (output, sink): (&'o O, O::Sink<'o>),
    ) -> Result<O::Sink<'o>, Error> {
        let compare = |mut sink: O::Sink<'o>, row: usize| {
            let row = &self.rows[row];
            self.columns.lend(|columns| {
                let local = row.gather(columns, &input.rule, &id)?;
                input.run(Tiles { columns, rule: &input.rule, row: &local, sink: &mut sink });
                sink.checked()
            })
        };
        let comparisons: usize = self.rows.iter().map(|row| row.of.len() * row.with.len()).sum();
        if comparisons < SPREAD {
            return (0..self.rows.len()).try_fold(sink, compare);
        }
        sink.merge(search_pieces((output, input), (self.rows.len(), 1), compare)?)
    }
}

impl Row {
    /// Fetches the row's spheres; returns where they are in the columns.
    fn gather(
        &self,
        columns: &mut Columns,
        rule: &Rule<'_>,
        id: impl Fn(usize) -> u32,
    ) -> Result<Self, Error> {
        let Self { of, with } = self;
        // From here on those compared with follow in the columns, whether they do in the cell or not.
        let rest = with.start.max(of.end)..with.end.max(of.end);
        let (own, fetched) = (of.len(), of.len() + rest.len());
        let place = |k: usize| if k < own { of.start + k } else { rest.start + k - own };
        columns.gather(rule, (0..fetched).map(|k| id(place(k))))?;
        let local = |at: usize| if at < of.end { at - of.start } else { at - rest.start + own };
        Ok(Self { of: 0..own, with: local(with.start)..local(with.end) })
    }
}

/// Cuts a range into pieces of at most `size`.
fn pieces(range: Range<usize>, size: usize) -> impl Iterator<Item = Range<usize>> {
    let end = range.end;
    range.step_by(size).map(move |from| from..end.min(from + size))
}

struct Tiles<'t, S> {
    columns: &'t Columns,
    rule: &'t Rule<'t>,
    row: &'t Row,
    sink: &'t mut S,
}

impl<S: Sink> Task for Tiles<'_, S> {
    type Result = ();

    #[inline(always)]
    fn run<V: Vector>(self, vector: V) {
        let Self { columns, rule, row, sink } = self;
        for tile in pieces(row.with.clone(), TILE) {
            for at in row.of.clone() {
                // Spheres of one class meet among themselves: each only those later than itself.
                let run = tile.start.max(at + 1)..tile.end;
                if !run.is_empty() {
                    scan(vector, (columns, rule), at, run, sink);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn partners_are_the_classes_that_have_all_bits_together() {
        for class in 0..CLASSES {
            let among =
                |ranges: &[Classes], other| ranges.iter().any(|&(from, to)| from <= other && other < to);
            for other in 0..CLASSES {
                let own = class | other == CLASSES - 1;
                assert_eq!(among(ANY[class], other), own, "any of {class} and {other}");
                assert_eq!(among(LATER[class], other), own && other >= class, "later of {class} and {other}");
            }
        }
    }
}
