//! Where pairs go: counted, kept as a list, or handed over in chunks.
//!
//! An [`Output`] is shared by all threads; each opens a [`Sink`] of its own, and the sinks of neighbouring pieces of
//! work are merged in the order of the work, so that a list has the same order for any number of threads.

use std::ops::{ControlFlow, Range};
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering::Relaxed};
use std::sync::{Mutex, MutexGuard, PoisonError};

use lazygrid_kernels::Pair;
use rayon::iter::{IndexedParallelIterator, ParallelIterator};

use crate::simd::{MAX_LANES, Vector};

/// Pairs per buffer of a thread, 64 KiB: far below a core's cache, far above the cost of handing it on.
const CHUNK: usize = 8192;

/// One thread's end of an output.
pub(crate) trait Sink: Send {
    /// Takes one pair, in either order.
    fn pair(&mut self, i: u32, j: u32);

    /// Takes the pairs of sphere `id` with those lanes of `ids` whose bits are set in `lanes`.
    #[inline(always)]
    fn hits<V: Vector>(&mut self, _: V, id: u32, ids: &[u32; MAX_LANES], lanes: u32) {
        let mut open = lanes;
        while open != 0 {
            self.pair(id, ids[open.trailing_zeros() as usize % MAX_LANES]);
            open &= open - 1;
        }
    }

    /// Adds what the sink of the work that follows has taken.
    fn merge(self, later: Self) -> Self;

    /// Whether nobody wants further pairs.
    fn stopped(&self) -> bool {
        false
    }
}

/// What a search writes to.
pub(crate) trait Output: Sync {
    type Sink<'o>: Sink
    where
        Self: 'o;
    fn open(&self) -> Self::Sink<'_>;
}

/// Searches pieces of work over the threads, each from a sink to that sink with more in it, and merges the sinks in the
/// order of the pieces. None is begun that nobody wants any more.
pub(crate) fn search_pieces<'o, O: Output, P>(
    output: &'o O,
    pieces: impl IndexedParallelIterator<Item = P>,
    search: impl Fn(O::Sink<'o>, P) -> O::Sink<'o> + Send + Sync,
) -> O::Sink<'o> {
    let piece = |sink: O::Sink<'o>, piece| if sink.stopped() { sink } else { search(sink, piece) };
    pieces.fold(|| output.open(), piece).reduce(|| output.open(), Sink::merge)
}

/// Counts pairs.
pub(crate) struct Count;

#[derive(Default)]
pub(crate) struct Counter(pub(crate) u64);

impl Output for Count {
    type Sink<'o> = Counter;
    fn open(&self) -> Counter {
        Counter(0)
    }
}

impl Sink for Counter {
    #[inline]
    fn pair(&mut self, _: u32, _: u32) {
        self.0 += 1;
    }

    #[inline(always)]
    fn hits<V: Vector>(&mut self, _: V, _: u32, _: &[u32; MAX_LANES], lanes: u32) {
        self.0 += u64::from(lanes.count_ones());
    }

    fn merge(self, later: Self) -> Self {
        Self(self.0 + later.0)
    }
}

/// Writes pairs into chunks, which `to` keeps or hands over.
pub(crate) struct Written<'c> {
    pub(crate) to: To<'c>,
    /// Only pairs whose smaller index lies in here are taken.
    pub(crate) window: Range<u32>,
    /// Empty chunks to be used again.
    pub(crate) spare: Mutex<Vec<Vec<Pair>>>,
    pub(crate) stop: AtomicBool,
}

/// Called with each chunk.
pub(crate) type Consume<'c> = &'c mut (dyn FnMut(&[Pair]) -> ControlFlow<()> + Send);

/// Where full chunks go.
pub(crate) enum To<'c> {
    /// Kept in order while they are at most `limit` pairs in all; beyond it only counted.
    List { limit: u64, kept: AtomicU64 },
    /// Handed over at once, one at a time, from whichever thread filled it.
    Consumer(Mutex<Consume<'c>>),
    /// Counted by smaller index.
    Tally(&'c [AtomicU32]),
}

impl<'c> Written<'c> {
    pub(crate) fn new(to: To<'c>, spare: Vec<Vec<Pair>>) -> Self {
        let (spare, stop) = (Mutex::new(spare), AtomicBool::new(false));
        Self { to, window: 0..u32::MAX, spare, stop }
    }

    /// The chunks that can be used again.
    pub(crate) fn into_spare(self) -> Vec<Vec<Pair>> {
        self.spare.into_inner().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether a list has passed its limit.
    fn is_too_long(&self) -> bool {
        matches!(&self.to, To::List { limit, kept } if kept.load(Relaxed) > *limit)
    }

    /// Disposes of a chunk; `Some` gives it back to be kept.
    fn dispose(&self, mut chunk: Vec<Pair>) -> Option<Vec<Pair>> {
        match &self.to {
            To::List { limit, kept } => {
                let len = chunk.len() as u64;
                if kept.fetch_add(len, Relaxed) + len <= *limit {
                    return Some(chunk);
                }
            }
            To::Consumer(consume) => {
                let mut consume = lock(consume);
                if !self.stop.load(Relaxed) && consume(&chunk).is_break() {
                    self.stop.store(true, Relaxed);
                }
            }
            To::Tally(counts) => {
                for pair in &chunk {
                    counts[pair.i as usize].fetch_add(1, Relaxed);
                }
            }
        }
        chunk.clear();
        lock(&self.spare).push(chunk);
        None
    }
}

impl<'c> Output for Written<'c> {
    type Sink<'o>
        = Writer<'o, 'c>
    where
        Self: 'o;

    fn open(&self) -> Writer<'_, 'c> {
        Writer { output: self, found: 0, chunk: Vec::new(), len: 0, counting: false, chunks: Vec::new() }
    }
}

/// One thread's chunk in the making, and those it keeps.
pub(crate) struct Writer<'o, 'c> {
    output: &'o Written<'c>,
    found: u64,
    /// Empty, or [`CHUNK`] pairs of which `len` are taken.
    chunk: Vec<Pair>,
    len: usize,
    /// Set once the list is known to be too long: from then on pairs are only counted.
    counting: bool,
    chunks: Vec<Vec<Pair>>,
}

impl Writer<'_, '_> {
    /// Hands on the last chunk; returns how many pairs were taken and those that were kept, in order.
    pub(crate) fn finish(mut self) -> (u64, Vec<Vec<Pair>>) {
        self.flush();
        (self.found, self.chunks)
    }

    /// Room for the pairs of one comparison.
    #[inline(always)]
    fn room(&mut self) -> &mut [Pair; MAX_LANES] {
        if self.chunk.len() < self.len + MAX_LANES {
            self.renew();
        }
        let room = self.chunk[self.len..].first_chunk_mut();
        room.expect("a new chunk has room")
    }

    #[cold]
    #[inline(never)]
    fn renew(&mut self) {
        self.flush();
        self.chunk = lock(&self.output.spare).pop().unwrap_or_default();
        self.chunk.resize(CHUNK, Pair::default());
    }

    fn flush(&mut self) {
        let mut chunk = std::mem::take(&mut self.chunk);
        chunk.truncate(std::mem::take(&mut self.len));
        if self.output.window != (0..u32::MAX) {
            chunk.retain(|pair| self.output.window.contains(&pair.i));
        }
        if chunk.capacity() > 0 {
            self.found += chunk.len() as u64;
            self.chunks.extend(self.output.dispose(chunk));
            self.counting = self.output.is_too_long();
        }
    }
}

impl Sink for Writer<'_, '_> {
    #[inline]
    fn pair(&mut self, i: u32, j: u32) {
        if self.counting {
            self.found += 1;
        } else {
            self.room()[0] = Pair::new(i, j);
            self.len += 1;
        }
    }

    #[inline(always)]
    fn hits<V: Vector>(&mut self, vector: V, id: u32, ids: &[u32; MAX_LANES], lanes: u32) {
        if self.counting {
            self.found += u64::from(lanes.count_ones());
        } else {
            self.len += vector.pack(id, ids, lanes, self.room());
        }
    }

    fn merge(mut self, later: Self) -> Self {
        self.flush();
        let Self { found, mut chunks, chunk, len, counting, .. } = later;
        self.found += found;
        self.counting |= counting;
        self.chunks.append(&mut chunks);
        (self.chunk, self.len) = (chunk, len);
        self
    }

    fn stopped(&self) -> bool {
        self.output.stop.load(Relaxed)
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // What the mutexes guard is whole after every statement, so a panic elsewhere leaves nothing half done.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
