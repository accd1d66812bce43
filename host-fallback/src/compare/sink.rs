//! Outputs of a search: counters, lists and consumers of chunks.
//!
//! Threads share an [`Output`]; each opens a [`Sink`]. Sinks are merged in order of their work, so lists do not depend on
//! threads.

use std::ops::{ControlFlow, Range};
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, SyncSender};
use std::sync::{Mutex, MutexGuard, PoisonError};

use lazygrid_kernels::Pair;

use super::columns::MAX_LANES;
use super::simd::SimdWidth;
use crate::Error;
use crate::memory::{self, try_resize};

/// Pairs per chunk: 64 KiB, far below a core's cache, but enough to amortize delivery.
const CHUNK: usize = 8192;
/// Pairs of a chunk's initial part, which is cleared first.
const MIN_CHUNK: usize = 256;
/// Maximum partly filled chunks per thread, at the ends of its tasks.
const PARTLY_FILLED: u64 = 8;

/// Returns the most bytes in use while `threads` threads write a list.
pub(crate) fn memory_of_list(pairs: u64, threads: u64) -> u64 {
    let bytes = pairs.saturating_mul(size_of::<Pair>() as u64);
    let chunks = |count: u64| count.saturating_mul((CHUNK * size_of::<Pair>()) as u64);
    // Consecutive chunks are merged if one holds both, so at least half of all capacity is used.
    let buffered =
        bytes.saturating_mul(2).min(bytes.saturating_add(chunks(PARTLY_FILLED.saturating_mul(threads))));
    buffered.saturating_add(chunks(threads.saturating_add(1)))
}

/// Receives pairs as they are found.
pub type PairConsumer<'t> = &'t mut (dyn FnMut(&[Pair]) -> ControlFlow<()> + Send);

pub(crate) trait Sink: Send + Sized {
    fn hits<V: SimdWidth>(&mut self, vector: V, id: u32, ids: &[u32; MAX_LANES], lanes: u32);

    fn pair(&mut self, pair: Pair);

    /// Returns the lanes that [`hits`](Self::hits) would not drop; others need no decision.
    #[inline(always)]
    fn wanted(&self, _id: u32, _ids: &[u32; MAX_LANES], lanes: u32) -> u32 {
        lanes
    }

    #[inline(always)]
    fn pairs_at(&mut self, pairs: &[Pair], order: &[u32]) {
        pairs.iter().for_each(|&pair| self.pair(pair_at(pair, order)));
    }

    fn merge(self, later: Self) -> Result<Self, Error>;

    fn checked(self) -> Result<Self, Error> {
        Ok(self)
    }

    fn stopped(&self) -> bool {
        false
    }
}

#[inline(always)]
pub(crate) fn pair_at(pair: Pair, order: &[u32]) -> Pair {
    Pair::new(order[pair.i as usize], order[pair.j as usize])
}

pub(crate) trait Output: Sync {
    type Sink<'o>: Sink
    where
        Self: 'o;
    fn open(&self) -> Self::Sink<'_>;
}

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
    #[inline(always)]
    fn hits<V: SimdWidth>(&mut self, _: V, _: u32, _: &[u32; MAX_LANES], lanes: u32) {
        self.0 += u64::from(lanes.count_ones());
    }

    #[inline(always)]
    fn pair(&mut self, _: Pair) {
        self.0 += 1;
    }

    #[inline(always)]
    fn pairs_at(&mut self, pairs: &[Pair], _: &[u32]) {
        self.0 += pairs.len() as u64;
    }

    fn merge(self, later: Self) -> Result<Self, Error> {
        Ok(Self(self.0 + later.0))
    }
}

pub(crate) struct ChunkedOutput<'c> {
    pub(crate) to: ChunkTarget<'c>,
    /// Range of the smaller index; `None` for all.
    pub(crate) window: Option<Range<u32>>,
    /// Contents are arbitrary.
    pub(crate) free_chunks: Mutex<Vec<Vec<Pair>>>,
    pub(crate) stop: AtomicBool,
}

pub(crate) enum ChunkTarget<'c> {
    /// Keeps up to `limit` pairs in order, and counts the others.
    List {
        limit: u64,
        collected: AtomicU64,
    },
    Consumer(Mutex<PairConsumer<'c>>),
    Channel(SyncSender<Vec<Pair>>),
    /// Counts pairs by smaller index.
    Tally(&'c [AtomicU32]),
}

impl<'c> ChunkedOutput<'c> {
    pub(crate) fn new(to: ChunkTarget<'c>, free_chunks: Vec<Vec<Pair>>) -> Self {
        let (free_chunks, stop) = (Mutex::new(free_chunks), AtomicBool::new(false));
        Self { to, window: None, free_chunks, stop }
    }

    pub(crate) fn into_free_chunks(self) -> Vec<Vec<Pair>> {
        self.free_chunks.into_inner().unwrap_or_else(PoisonError::into_inner)
    }

    fn is_too_long(&self) -> bool {
        matches!(&self.to, ChunkTarget::List { limit, collected } if collected.load(Relaxed) > *limit)
    }

    #[inline(always)]
    fn inside(&self, id: u32, ids: &[u32; MAX_LANES], lanes: u32) -> u32 {
        let Some(Range { start, end }) = self.window else { return lanes };
        if id < start {
            return 0;
        }
        let others = if id < end { u32::MAX - start } else { end - start };
        let wanted = |k: usize| u32::from(ids[k].wrapping_sub(start) < others) << k;
        lanes & (0..MAX_LANES).fold(0, |mask, k| mask | wanted(k))
    }

    fn finish_chunk(&self, chunk: Vec<Pair>) -> Result<Option<Vec<Pair>>, Error> {
        match &self.to {
            ChunkTarget::List { limit, collected } => {
                let len = chunk.len() as u64;
                if collected.fetch_add(len, Relaxed) + len <= *limit {
                    return Ok(Some(chunk));
                }
            }
            ChunkTarget::Consumer(consume) => match consume.lock() {
                Ok(mut consume) => {
                    if !self.stop.load(Relaxed) && consume(&chunk).is_break() {
                        self.stop.store(true, Relaxed);
                    }
                }
                // The consumer has panicked, and must not be called again.
                Err(_) => self.stop.store(true, Relaxed),
            },
            ChunkTarget::Channel(sender) => {
                // An empty chunk would end the thread, which ends early only after a panic or an error.
                if !chunk.is_empty() && !self.stop.load(Relaxed) {
                    if sender.send(chunk).is_err() {
                        self.stop.store(true, Relaxed);
                    }
                    return Ok(None);
                }
            }
            ChunkTarget::Tally(counts) => {
                for pair in &chunk {
                    counts[pair.i as usize].fetch_add(1, Relaxed);
                }
            }
        }
        self.put_back(chunk)?;
        Ok(None)
    }

    pub(super) fn consume(
        &self,
        chunks: &Receiver<Vec<Pair>>,
        consume: PairConsumer<'_>,
    ) -> Result<(), Error> {
        for chunk in chunks.iter().take_while(|chunk| !chunk.is_empty()) {
            if !self.stop.load(Relaxed) && consume(&chunk).is_break() {
                self.stop.store(true, Relaxed);
            }
            self.put_back(chunk)?;
        }
        Ok(())
    }

    /// Keeps the length, because growing would clear the new part.
    fn put_back(&self, chunk: Vec<Pair>) -> Result<(), Error> {
        if chunk.capacity() > 0 {
            memory::try_push(&mut lock(&self.free_chunks), chunk, "chunks of pairs")?;
        }
        Ok(())
    }
}

impl<'c> Output for ChunkedOutput<'c> {
    type Sink<'o>
        = Writer<'o, 'c>
    where
        Self: 'o;

    fn open(&self) -> Writer<'_, 'c> {
        let (chunk, chunks) = (Vec::new(), Vec::new());
        Writer { output: self, found: 0, chunk, len: 0, counting: false, chunks, refused: None }
    }
}

pub(crate) struct Writer<'o, 'c> {
    output: &'o ChunkedOutput<'c>,
    found: u64,
    chunk: Vec<Pair>,
    len: usize,
    /// `true` if the list is too long or memory was refused.
    counting: bool,
    chunks: Vec<Vec<Pair>>,
    refused: Option<Error>,
}

impl Writer<'_, '_> {
    pub(crate) fn finish(mut self) -> Result<(u64, Vec<Vec<Pair>>), Error> {
        self.flush()?;
        let Self { found, chunks, .. } = self.checked()?;
        Ok((found, chunks))
    }

    #[inline(always)]
    fn free_slots(&mut self) -> Option<&mut [Pair; MAX_LANES]> {
        if self.chunk.len() < self.len + MAX_LANES
            && let Err(error) = self.renew()
        {
            self.refuse(error);
            return None;
        }
        self.chunk[self.len..].first_chunk_mut()
    }

    /// Chunks grow as they fill, so few pairs clear little memory.
    #[cold]
    #[inline(never)]
    fn renew(&mut self) -> Result<(), Error> {
        if self.chunk.is_empty() || self.len + MAX_LANES > CHUNK {
            self.flush()?;
            self.chunk = lock(&self.output.free_chunks).pop().unwrap_or_default();
            if self.chunk.capacity() < CHUNK {
                return try_resize(&mut self.chunk, CHUNK, "pairs");
            }
        }
        let len = (2 * self.len).clamp(MIN_CHUNK, CHUNK).max(self.chunk.len());
        try_resize(&mut self.chunk, len, "pairs")
    }

    #[cold]
    fn refuse(&mut self, error: Error) {
        (self.counting, self.refused) = (true, Some(error));
        (self.chunk, self.len) = (Vec::new(), 0);
    }

    fn flush(&mut self) -> Result<(), Error> {
        let mut chunk = std::mem::take(&mut self.chunk);
        chunk.truncate(std::mem::take(&mut self.len));
        if chunk.capacity() > 0 {
            self.found += chunk.len() as u64;
            if let Some(chunk) = self.output.finish_chunk(chunk)? {
                memory::try_push(&mut self.chunks, chunk, "chunks of pairs")?;
            }
            self.counting = self.output.is_too_long();
        }
        Ok(())
    }
}

impl Sink for Writer<'_, '_> {
    #[inline(always)]
    fn wanted(&self, id: u32, ids: &[u32; MAX_LANES], lanes: u32) -> u32 {
        if self.counting { lanes } else { self.output.inside(id, ids, lanes) }
    }

    #[inline(always)]
    fn hits<V: SimdWidth>(&mut self, vector: V, id: u32, ids: &[u32; MAX_LANES], lanes: u32) {
        if self.counting {
            self.found += u64::from(lanes.count_ones());
        } else {
            let lanes = self.output.inside(id, ids, lanes);
            if lanes != 0
                && let Some(slots) = self.free_slots()
            {
                self.len += vector.pack(id, ids, lanes, slots);
            }
        }
    }

    #[inline(always)]
    fn pair(&mut self, pair: Pair) {
        if self.counting {
            self.found += 1;
        } else if self.output.window.as_ref().is_none_or(|window| window.contains(&pair.i))
            && let Some(slots) = self.free_slots()
        {
            slots[0] = pair;
            self.len += 1;
        }
    }

    #[inline(always)]
    fn pairs_at(&mut self, pairs: &[Pair], order: &[u32]) {
        for chunk in pairs.chunks(MAX_LANES) {
            if self.counting || self.output.window.is_some() {
                chunk.iter().for_each(|&pair| self.pair(pair_at(pair, order)));
            } else if let Some(slots) = self.free_slots() {
                slots.iter_mut().zip(chunk).for_each(|(slot, &pair)| *slot = pair_at(pair, order));
                self.len += chunk.len();
            }
        }
    }

    fn merge(mut self, later: Self) -> Result<Self, Error> {
        let Self { found, mut chunks, chunk, len, counting, refused, .. } = later;
        self.found += found;
        self.refused = self.refused.or(refused);
        // Joins nearly empty chunks, which many threads would leave.
        if chunks.is_empty() && !self.chunk.is_empty() && self.len + len + MAX_LANES <= CHUNK {
            let needed = self.chunk.len().max(self.len + len);
            try_resize(&mut self.chunk, needed, "pairs")?;
            self.chunk[self.len..self.len + len].copy_from_slice(&chunk[..len]);
            self.len += len;
            self.output.put_back(chunk)?;
        } else {
            self.flush()?;
            memory::try_extend(&mut self.chunks, chunks.drain(..), "chunks of pairs")?;
            (self.chunk, self.len) = (chunk, len);
        }
        self.counting |= counting;
        Ok(self)
    }

    fn checked(self) -> Result<Self, Error> {
        match self.refused {
            None => Ok(self),
            Some(error) => Err(error),
        }
    }

    fn stopped(&self) -> bool {
        self.output.stop.load(Relaxed)
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // The guarded values are consistent after every statement, even after a panic.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
