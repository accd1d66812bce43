//! An array of (cell, sphere) entries, one for every cell that a sphere overlaps, sorted by cell and class.

use glam::UVec3;

use crate::Error;
use crate::cover::{Cover, HOME, Raster};
use crate::detector::Input;
use crate::memory::{more, resize};
use crate::radix::{Entry, Key, Radix};
use crate::report::Report;
use crate::scatter::split_at;
use crate::threads::Threads;

/// Spheres per piece of the passes that count and write entries.
const PIECE: usize = 1 << 14;
/// Low bits of a key that hold the class; those above number the cell.
pub(crate) const CLASS_BITS: u32 = 3;

impl<K: Key> Entry<K> {
    #[inline(always)]
    pub(crate) fn cell(self) -> K {
        self.key.without(CLASS_BITS)
    }
}

/// How a cell's coordinates are packed into a key: counted from the lowest cell, in as many bits as the highest
/// needs.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Packing {
    low: UVec3,
    bits: UVec3,
}

impl Packing {
    /// For cells in `low..=high`.
    pub(crate) fn new(low: UVec3, high: UVec3) -> Self {
        let bits = (high - low).to_array().map(|extent| u32::BITS - extent.leading_zeros());
        Self { low, bits: bits.into() }
    }

    /// Bits of a key, those of the class included.
    pub(crate) fn bits(&self) -> u32 {
        self.bits.element_sum() + CLASS_BITS
    }

    fn is_narrow(&self) -> bool {
        self.bits() <= u32::BITS
    }

    #[inline(always)]
    pub(crate) fn key<K: Key>(&self, cell: UVec3, class: u8) -> K {
        let at = cell - self.low;
        let number = K::from(at.z).append(at.y, self.bits.y).append(at.x, self.bits.x);
        number.append(u32::from(class), CLASS_BITS)
    }

    pub(crate) fn cell<K: Key>(&self, key: K) -> UVec3 {
        let mut number = key.without(CLASS_BITS);
        let mut take = |bits: u32| {
            let axis = u64::from(number.low()) & ((1 << bits) - 1);
            number = number.without(bits);
            axis as u32
        };
        let (x, y) = (take(self.bits.x), take(self.bits.y));
        self.low + UVec3::new(x, y, number.low())
    }
}

/// The sorted entries of all spheres. Buffers survive between calls.
#[derive(Debug, Default)]
pub(crate) struct Entries {
    pub(crate) raster: Raster,
    packing: Packing,
    offsets: Vec<usize>,
    /// Where keys fit 32 bits, as they do unless the space is wide and the cells small.
    narrow: Radix<u32>,
    /// Where they do not; three coordinates of 32 bits always fit these.
    wide: Radix<u128>,
}

/// Work on entries whose keys have either width.
pub(crate) trait Visit {
    type Result;
    fn visit<K: Key>(self, entries: &[Entry<K>], packing: Packing) -> Self::Result;
}

impl Entries {
    /// Writes and sorts the entries.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    pub(crate) fn build(&mut self, input: &Input<'_>, report: &mut Report) -> Result<(), Error> {
        match input.is_periodic() {
            true => self.build_in::<true>(input, report),
            false => self.build_in::<false>(input, report),
        }
    }

    fn build_in<const PERIODIC: bool>(
        &mut self,
        input: &Input<'_>,
        report: &mut Report,
    ) -> Result<(), Error> {
        let survey = &input.survey;
        self.raster = Raster::new(survey, input.settings.raster_ratio, input.rule.lengths());
        if survey.spheres > 0 {
            let largest = survey.largest_radius();
            let (low, high) = self.raster.bounds_of(survey.min, survey.max, largest);
            self.packing = Packing::new(low, high);
        }
        let Self { raster, packing, offsets, narrow, wide } = self;
        let sphere = |k: usize| {
            let (center, radius) = input.rule.effective(k as u32);
            (raster.cover::<PERIODIC>(center, radius), HOME, k as u32)
        };
        let place = |cell| raster.wrap::<PERIODIC>(cell);
        let (n, threads) = (survey.spheres, input.threads);
        if packing.is_narrow() {
            wide.entries.clear();
            report.time("map", || fill((n, threads), (sphere, place), *packing, (narrow, offsets)))?;
            report.time("sort", || narrow.sort(packing.bits(), threads))?;
        } else {
            narrow.entries.clear();
            report.time("map", || fill((n, threads), (sphere, place), *packing, (wide, offsets)))?;
            report.time("sort", || wide.sort(packing.bits(), threads))?;
        }
        log::trace!("{} entries, {} key bits", narrow.entries.len() + wide.entries.len(), packing.bits());
        Ok(())
    }

    /// The entries, at the width they have.
    pub(crate) fn visit<V: Visit>(&self, visitor: V) -> V::Result {
        match self.packing.is_narrow() {
            true => visitor.visit(&self.narrow.entries, self.packing),
            false => visitor.visit(&self.wide.entries, self.packing),
        }
    }

    /// An upper estimate of the bytes held for `spheres` spheres: every one in as many cells as it can overlap, with
    /// wide keys.
    pub(crate) fn memory_for(spheres: u64, ratio: f32) -> u64 {
        spheres * most_cells(ratio) * Radix::<u128>::BYTES_PER_ENTRY
    }
}

/// How many cells a sphere overlaps at most where the raster's edge is `ratio` × the largest diameter.
pub(crate) fn most_cells(ratio: f32) -> u64 {
    if ratio < 1.0 { 27 } else { 8 }
}

/// Writes an entry for every cell that each of `n` spheres overlaps, sphere by sphere. `sphere` tells what the `k`-th
/// covers, the most that its classes can have, and its id; where there are many it is asked twice, to count first.
/// `place` tells the cell from one that is covered.
///
/// # Errors
/// [`Error::OutOfMemory`].
pub(crate) fn fill<K: Key>(
    (n, threads): (usize, Threads),
    (sphere, place): (impl Fn(usize) -> (Cover, u8, u32) + Sync, impl Fn(UVec3) -> UVec3 + Sync),
    packing: Packing,
    (radix, offsets): (&mut Radix<K>, &mut Vec<usize>),
) -> Result<(), Error> {
    let entries = &mut radix.entries;
    if n <= PIECE {
        entries.clear();
        for (cover, most, id) in (0..n).map(&sphere) {
            more(entries, cover.cells(), "entries of cells")?;
            #[expect(clippy::disallowed_methods, reason = "there is room for all cells of the sphere")]
            cover.for_each(|cell, class| {
                entries.push(Entry { key: packing.key(place(cell), class & most), id });
            });
        }
        return Ok(());
    }
    let range = |piece: usize| piece * PIECE..n.min((piece + 1) * PIECE);
    resize(offsets, n.div_ceil(PIECE), "counting entries of cells")?;
    threads.each(offsets, |piece, count| {
        *count = range(piece).map(|k| sphere(k).0.cells()).sum();
    });
    resize(entries, accumulate(offsets), "entries of cells")?;
    let mut targets = split_at(entries, offsets.iter().copied())?;
    threads.each(&mut targets, |piece, target| {
        let mut slots = target.iter_mut();
        for (cover, most, id) in range(piece).map(&sphere) {
            cover.for_each(|cell, class| {
                if let Some(slot) = slots.next() {
                    *slot = Entry { key: packing.key(place(cell), class & most), id };
                }
            });
        }
    });
    Ok(())
}

/// Turns the lengths of pieces into their ends; returns the last.
pub(crate) fn accumulate(lengths: &mut [usize]) -> usize {
    lengths.iter_mut().fold(0, |total, length| {
        *length += total;
        *length
    })
}

/// Where the run of entries of one cell that starts at `from` ends: galloping, since most runs are short, then a
/// binary search.
#[inline]
pub(crate) fn run_end<K: Key>(entries: &[Entry<K>], from: usize) -> usize {
    let cell = entries[from].cell();
    let (mut last, mut step) = (from, 1);
    while last + step < entries.len() && entries[last + step].cell() == cell {
        last += step;
        step *= 2;
    }
    let window = &entries[last..entries.len().min(last + step)];
    last + window.partition_point(|entry| entry.cell() == cell)
}

/// The entries of the cells that start in piece `piece` of `size` entries each.
pub(crate) fn cells_of_piece<K: Key>(entries: &[Entry<K>], piece: usize, size: usize) -> &[Entry<K>] {
    let cut = |at: usize| match at {
        0 => 0,
        _ if at >= entries.len() => entries.len(),
        _ if entries[at - 1].cell() == entries[at].cell() => run_end(entries, at),
        _ => at,
    };
    &entries[cut(piece * size)..cut((piece + 1) * size)]
}
