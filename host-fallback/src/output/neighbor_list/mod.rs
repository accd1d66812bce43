//! Neighbor lists with geometry: shifts, vectors and distances of all images within the cutoff.
//!
//! Minimum images suffice if no sphere has two images of another within the cutoff. Otherwise the search is between the
//! spheres and [their images](PeriodicImages).

mod fill;
mod images;
mod options;

use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use lazygrid_kernels::{Error, InputError, Interactions, Pair, Query, Space, Spheres};

pub use images::PeriodicImages;
pub use options::ListOptions;

use crate::compare::PairFilter;
use crate::disjoint_writes::close_gaps;
use crate::executor::{Executor, Team};
use crate::memory::try_resize;
use crate::output::NeighborsBuilder;
use fill::{Fill, Neighbor, OutputSlices, RowChunk};

const CHUNK_ROWS: usize = 1 << 9;
const CHUNK_SPHERES: usize = 1 << 13;

/// A neighbor list with geometry, in compressed sparse rows: the neighbors of sphere `k` are the entries
/// `offsets()[k]..offsets()[k + 1]`, ordered by index, then shift. Arrays of unrequested quantities are empty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NeighborList<'a> {
    offsets: &'a [u64],
    pairs: &'a [Pair],
    shifts: &'a [[i32; 3]],
    vectors: &'a [[f64; 3]],
    distances: &'a [f64],
}

impl<'a> NeighborList<'a> {
    /// Start of each sphere's neighbors; the last is the number of entries.
    pub fn offsets(&self) -> &'a [u64] {
        self.offsets
    }

    /// Sphere and neighbor per entry. In a full list `i` may exceed `j`, and equals it for an image of the sphere
    /// itself.
    pub fn pairs(&self) -> &'a [Pair] {
        self.pairs
    }

    /// Numbers of cell vectors to the image of the neighbor, per entry.
    pub fn shifts(&self) -> &'a [[i32; 3]] {
        self.shifts
    }

    /// Vector from sphere `i` to the image of its neighbor per entry, `(cⱼ − cᵢ) + (S₁e₁ + S₂e₂ + S₃e₃)`.
    pub fn vectors(&self) -> &'a [[f64; 3]] {
        self.vectors
    }

    /// Length of the vector, per entry.
    pub fn distances(&self) -> &'a [f64] {
        self.distances
    }

    /// Number of entries.
    pub fn len(&self) -> usize {
        self.pairs.len()
    }

    /// Returns `true` if the list has no entry.
    pub fn is_empty(&self) -> bool {
        self.pairs.is_empty()
    }
}

/// The contact test of a query.
#[derive(Clone, Copy, Debug)]
pub struct ContactTest<'a> {
    /// Spheres and exclusions.
    pub query: &'a Query<'a>,
    /// Space of the spheres.
    pub space: &'a Space,
    /// Species that pair, and their distances.
    pub table: Option<&'a Interactions>,
    /// Ends the work while `true`.
    pub stop: Option<&'a AtomicBool>,
}

impl ContactTest<'_> {
    fn is_stopped(&self) -> bool {
        self.stop.is_some_and(|stop| stop.load(Relaxed))
    }

    fn check_stop(&self) -> Result<(), Error> {
        if self.is_stopped() { Err(Error::Cancelled) } else { Ok(()) }
    }
}

/// The pairs that a list is built from.
#[derive(Clone, Copy, Debug)]
pub struct FoundPairs<'a> {
    /// Pairs of the query, or pairs between its spheres and their `images`, in canonical order.
    pub pairs: &'a [Pair],
    /// Images of the spheres; `None` if minimum images suffice.
    pub images: Option<&'a PeriodicImages>,
}

/// Builds neighbor lists in reused buffers.
#[derive(Debug, Default)]
pub struct NeighborListBuilder {
    lists: NeighborsBuilder,
    numbers: Vec<[f64; 4]>,
    offsets: Vec<u64>,
    pairs: Vec<Pair>,
    shifts: Vec<[i32; 3]>,
    vectors: Vec<[f64; 3]>,
    distances: Vec<f64>,
}

fn read(set: Spheres<'_>, into: &mut [[f64; 4]], executor: Executor) {
    executor.for_each_chunk(into, CHUNK_SPHERES, |chunk, into| {
        into.iter_mut().zip(chunk * CHUNK_SPHERES..).for_each(|(row, k)| *row = set.get_f64(k));
    });
}

impl NeighborListBuilder {
    /// Builds the list from the pairs of a search.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`], [`Error::ThreadPool`], [`Error::Cancelled`], and [`InputError::Shift`] for a shift
    /// beyond 32 bits.
    pub fn build(
        &mut self,
        contact: ContactTest<'_>,
        found: FoundPairs<'_>,
        options: ListOptions,
        team: &Team,
    ) -> Result<NeighborList<'_>, Error> {
        let FoundPairs { pairs, images } = found;
        let rows = contact.query.first().len();
        let is_mirrored = images.is_none() && contact.query.second().is_none() && !options.is_half;
        let candidates = self.lists.rows(pairs, rows, is_mirrored)?;
        let entries = candidates.indices().len() + if options.has_self { rows } else { 0 };
        const LIST: &str = "a neighbor list";
        try_resize(&mut self.offsets, rows + 1, LIST)?;
        try_resize(&mut self.pairs, entries, LIST)?;
        try_resize(&mut self.shifts, if options.shifts { entries } else { 0 }, LIST)?;
        try_resize(&mut self.vectors, if options.vectors { entries } else { 0 }, LIST)?;
        try_resize(&mut self.distances, if options.distances { entries } else { 0 }, LIST)?;
        try_resize(&mut self.numbers, contact.query.len(), LIST)?;
        let (first, second) = self.numbers.split_at_mut(rows);
        team.pass(contact.query.len(), |executor| {
            read(contact.query.first(), first, executor);
            contact.query.second().into_iter().for_each(|set| read(set, second, executor));
            Ok(())
        })?;
        let (first, second) = (&*first, if contact.query.second().is_some() { &*second } else { &*first });
        let filter = images.and_then(|_| PairFilter::new(*contact.query, None));
        let fill = Fill { contact, first, second, images, options, filter, candidates };
        let all = OutputSlices {
            pairs: &mut self.pairs,
            shifts: &mut self.shifts,
            vectors: &mut self.vectors,
            distances: &mut self.distances,
        };
        self.offsets[0] = 0;
        let (_, counts) = self.offsets.split_at_mut(1);
        let mut chunks = RowChunk::all(&fill, all, counts)?;
        team.pass(entries, |executor| {
            executor.for_each(&mut chunks, |_, chunk| {
                if !contact.is_stopped() {
                    chunk.fill(&fill);
                }
            });
            contact.check_stop()
        })?;
        if options.shifts
            && let Some(Neighbor { i, j }) = chunks.iter().find_map(|chunk| chunk.too_far)
        {
            return Err(InputError::Shift { i, j }.into());
        }
        let filled = chunks.iter().map(|chunk| (chunk.start, chunk.filled));
        let filled = crate::memory::try_collect(filled, LIST)?;
        drop(chunks);
        self.close(&filled);
        Ok(NeighborList {
            offsets: &self.offsets,
            pairs: &self.pairs,
            shifts: &self.shifts,
            vectors: &self.vectors,
            distances: &self.distances,
        })
    }

    fn close(&mut self, filled: &[(usize, usize)]) {
        fn close<T: Copy>(values: &mut Vec<T>, filled: &[(usize, usize)]) {
            if !values.is_empty() {
                close_gaps(values, filled.iter().copied());
            }
        }
        close(&mut self.pairs, filled);
        close(&mut self.shifts, filled);
        close(&mut self.vectors, filled);
        close(&mut self.distances, filled);
        for k in 1..self.offsets.len() {
            self.offsets[k] += self.offsets[k - 1];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stop_flag_ends_the_filling_of_lists() {
        let rows = [[0.0_f64, 0.0, 0.0, 1.0]; 2];
        let (query, team) = (Query::new(&rows), Team::new(Some(1)).expect("one thread"));
        for is_stopped in [false, true] {
            let stop = AtomicBool::new(is_stopped);
            let contact =
                ContactTest { query: &query, space: &Space::UNBOUNDED, table: None, stop: Some(&stop) };
            let mut builder = NeighborListBuilder::default();
            let found = FoundPairs { pairs: &[Pair { i: 0, j: 1 }], images: None };
            let list = builder.build(contact, found, ListOptions::default(), &team).map(|list| list.len());
            assert_eq!(list, if is_stopped { Err(Error::Cancelled) } else { Ok(2) });
        }
    }
}
