//! The threads of a call: the calling thread, or a rayon pool. No other module uses rayon. The first chunk that fails
//! ends the work.

use std::alloc::{GlobalAlloc, Layout, System};
use std::env;
use std::error::Error as _;
use std::hint::black_box;
use std::io;
use std::sync::OnceLock;
use std::thread::available_parallelism;

use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::Error;

/// Maximum threads of a pool per core: a process may get more cores while it runs.
const MAX_THREADS_PER_CORE: usize = 4;
/// Threads that a pool may always start.
const MIN_MAX_THREADS: usize = 16;

/// Bytes of a thread's stack in Rust, and of the pages that the C library maps for its thread-local values.
const THREAD_MEMORY: usize = (2 << 20) + (1 << 18);
/// glibc may serve smaller allocations from its own memory, in which threads cannot start.
const MIN_MAPPED: usize = (32 << 20) + 1;

/// Below this number of spheres, waking threads takes as long as a light pass.
pub(crate) const MIN_PARALLEL_SPHERES: usize = 1 << 14;
/// Estimated nanoseconds below which work stays in the calling thread.
const MIN_PARALLEL_NS: f32 = 300_000.0;

/// The threads of a call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Executor {
    /// Calling thread only.
    Caller,
    /// Calling thread's pool, or rayon's global pool.
    Pool,
}

impl Executor {
    pub(crate) fn current() -> Result<Self, Error> {
        start_threads()?;
        Ok(if rayon::current_num_threads() == 1 { Self::Caller } else { Self::Pool })
    }

    pub(crate) fn for_light_work(self, count: usize) -> Self {
        if count < MIN_PARALLEL_SPHERES { Self::Caller } else { self }
    }

    pub(crate) fn is_short(time: f32) -> bool {
        time < MIN_PARALLEL_NS
    }

    pub(crate) fn for_each<T: Send>(self, items: &mut [T], work: impl Fn(usize, &mut T) + Sync) {
        self.chunks(items, 1, &|k, item| work(k, &mut item[0]));
    }

    pub(crate) fn for_each_chunk<T: Send>(
        self,
        values: &mut [T],
        size: usize,
        work: impl Fn(usize, &mut [T]) + Sync,
    ) {
        self.chunks(values, size, &work);
    }

    /// Takes a `dyn` function, so that rayon's code is compiled once per type.
    fn chunks<T: Send>(self, values: &mut [T], size: usize, work: &(dyn Fn(usize, &mut [T]) + Sync)) {
        match self {
            Self::Pool if values.len() > size => {
                values.par_chunks_mut(size).enumerate().for_each(|(k, chunk)| work(k, chunk));
            }
            _ => values.chunks_mut(size).enumerate().for_each(|(k, chunk)| work(k, chunk)),
        }
    }

    pub(crate) fn fold<S: Send, E: Send>(
        self,
        chunks: Chunks,
        open: impl Fn() -> S + Sync + Send,
        step: impl Fn(S, usize) -> Result<S, E> + Sync + Send,
        merge: impl Fn(S, S) -> Result<S, E> + Sync + Send,
    ) -> Result<S, E> {
        self.fold_chunks(chunks, Fold { open: &open, step: &step, merge: &merge })
    }

    /// Compiled once per type, like [`chunks`](Self::chunks).
    fn fold_chunks<S: Send, E: Send>(
        self,
        Chunks { count, most_per_task }: Chunks,
        Fold { open, step, merge }: Fold<'_, S, E>,
    ) -> Result<S, E> {
        match self {
            Self::Pool if count > 1 => {
                let chunks = (0..count).into_par_iter().with_max_len(most_per_task);
                chunks.try_fold(open, step).try_reduce(open, merge)
            }
            _ => (0..count).try_fold(open(), step),
        }
    }
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct Chunks {
    pub(crate) count: usize,
    pub(crate) most_per_task: usize,
}

impl Chunks {
    pub(crate) fn unlimited(count: usize) -> Self {
        Self { count, most_per_task: usize::MAX }
    }
}

struct Fold<'a, S, E> {
    open: &'a (dyn Fn() -> S + Sync),
    step: &'a (dyn Fn(S, usize) -> Result<S, E> + Sync),
    merge: &'a (dyn Fn(S, S) -> Result<S, E> + Sync),
}

/// The threads of a detector: its own pool, or the caller's.
#[derive(Debug)]
pub struct Team {
    pool: Option<ThreadPool>,
    requested: Option<usize>,
}

impl Team {
    /// Creates a team of `requested` threads; `None` for the rayon pool of each caller.
    ///
    /// # Errors
    /// [`Error::ThreadPool`] if the system refuses the threads, and [`Error::OutOfMemory`].
    pub fn new(requested: Option<usize>) -> Result<Self, Error> {
        let pool = match requested {
            None | Some(1) => None,
            Some(threads) => Some(pool(threads)?),
        };
        Ok(Self { pool, requested })
    }

    /// Runs a pass over `count` items, in the pool if they are enough.
    ///
    /// # Errors
    /// The errors of `task`, and [`Error::ThreadPool`].
    pub fn pass<R: Send>(
        &self,
        count: usize,
        task: impl FnOnce(Executor) -> Result<R, Error> + Send,
    ) -> Result<R, Error> {
        match count < MIN_PARALLEL_SPHERES {
            true => task(Executor::Caller),
            false => self.within(|| task(self.executor()?)),
        }
    }

    pub(crate) fn within<R: Send>(&self, task: impl FnOnce() -> R + Send) -> R {
        match &self.pool {
            Some(pool) => pool.install(task),
            None => task(),
        }
    }

    pub(crate) fn executor(&self) -> Result<Executor, Error> {
        if self.requested == Some(1) { Ok(Executor::Caller) } else { Executor::current() }
    }

    pub(crate) fn count(&self) -> usize {
        match (&self.pool, self.requested) {
            (Some(pool), _) => pool.current_num_threads(),
            (None, Some(threads)) => threads,
            // Starts the global pool, because a program may have given it any number of threads.
            (None, None) => {
                start_threads().map_or_else(|_| default_threads(), |()| rayon::current_num_threads())
            }
        }
    }
}

fn pool(requested: usize) -> Result<ThreadPool, Error> {
    let cores = cores();
    let threads = useful(requested, cores);
    if threads < requested {
        log::warn!("{requested} threads requested; starting {threads}, the limit for {cores} cores");
    }
    thread_pool(threads)
}

/// Starts a pool of `threads` threads.
///
/// # Errors
/// Returns [`Error::ThreadPool`] if the system refuses the threads, and [`Error::OutOfMemory`].
pub fn thread_pool(threads: usize) -> Result<ThreadPool, Error> {
    check_thread_memory(threads)?;
    let built = ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = built.map_err(|error| Error::ThreadPool { threads, reason: error.to_string() })?;
    // The threads allocate their thread-local values now, while there is memory.
    pool.broadcast(|_| ());
    Ok(pool)
}

/// Checks that there is memory for the stacks and thread-local values of `threads` more threads. Without memory for these
/// values, the C library ends the process.
///
/// # Errors
/// Returns [`Error::OutOfMemory`] if the system refuses the memory.
pub fn check_thread_memory(threads: usize) -> Result<(), Error> {
    let bytes = threads.saturating_mul(THREAD_MEMORY).saturating_add(MIN_MAPPED);
    // From the system itself: an allocator that counts must not see memory that nothing uses.
    let is_available = Layout::from_size_align(bytes, 1).is_ok_and(|layout| {
        // SAFETY: the size is above zero, and the same allocator frees the block with the same layout, once.
        unsafe {
            // The compiler could remove an allocation without a use.
            let block = black_box(System.alloc(layout));
            if !block.is_null() {
                System.dealloc(block, layout);
            }
            !block.is_null()
        }
    });
    let refused = Error::OutOfMemory { what: "stacks of threads", bytes: bytes as u64 };
    if is_available { Ok(()) } else { Err(refused) }
}

/// Starts a thread with `spawn` if there is memory for it.
///
/// # Errors
/// Returns [`Error::ThreadPool`] if the system refuses the thread, and [`Error::OutOfMemory`].
pub fn start_thread<T>(spawn: impl FnOnce() -> io::Result<T>) -> Result<T, Error> {
    check_thread_memory(1)?;
    spawn().map_err(|error| Error::ThreadPool { threads: 1, reason: error.to_string() })
}

fn useful(requested: usize, cores: usize) -> usize {
    requested.min((MAX_THREADS_PER_CORE * cores).max(MIN_MAX_THREADS))
}

fn cores() -> usize {
    available_parallelism().map_or(1, usize::from)
}

/// Returns the number of threads of rayon's global pool, without starting it.
pub fn default_threads() -> usize {
    let set = env::var("RAYON_NUM_THREADS").ok().and_then(|threads| threads.parse().ok());
    set.filter(|&threads| threads > 0).unwrap_or_else(cores)
}

/// Starts rayon's global pool, unless it runs or the caller is in another pool. Rayon would panic if the system refused
/// the threads.
///
/// # Errors
/// Returns [`Error::ThreadPool`] if the system refuses the threads, or refused them before, and [`Error::OutOfMemory`].
pub fn start_threads() -> Result<(), Error> {
    if rayon::current_thread_index().is_some() {
        return Ok(());
    }
    static STARTED: OnceLock<Result<(), String>> = OnceLock::new();
    if STARTED.get().is_none() {
        check_thread_memory(default_threads())?;
    }
    let started = STARTED.get_or_init(|| match ThreadPoolBuilder::new().build_global() {
        Ok(()) => {
            rayon::broadcast(|_| ());
            Ok(())
        }
        // An error without a source: the pool runs already.
        Err(error) if error.source().is_none() => Ok(()),
        Err(error) => Err(error.to_string()),
    });
    started.clone().map_err(|reason| Error::ThreadPool { threads: default_threads(), reason })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pools_are_limited_to_useful_threads() {
        for (requested, cores, started) in [(1, 1, 1), (7, 2, 7), (16, 1, 16), (17, 1, 16), (64, 16, 64)] {
            assert_eq!(useful(requested, cores), started, "{requested} on {cores} cores");
        }
        assert_eq!(useful(100_000, 2), 16);
        assert_eq!(useful(100_000, 64), 256);
        let started = pool(100_000).expect("some threads").current_num_threads();
        assert!(started <= (MAX_THREADS_PER_CORE * cores()).max(MIN_MAX_THREADS), "{started}");
    }

    #[test]
    fn team_without_a_number_has_the_global_pool() {
        let team = Team::new(None).expect("a team");
        assert_eq!(team.count(), rayon::current_num_threads());
        let inside = thread_pool(3).expect("threads").install(|| team.count());
        assert_eq!(inside, 3);
        assert_eq!(default_threads(), rayon::current_num_threads());
    }

    #[test]
    fn fold_keeps_the_order_and_ends_at_the_first_error() {
        for threads in [Executor::Caller, Executor::Pool] {
            let fold = |limit: usize| {
                let step = |mut all: Vec<usize>, k| {
                    all.push(k);
                    if k < limit { Ok(all) } else { Err(k) }
                };
                threads.fold(Chunks { count: 1000, most_per_task: 7 }, Vec::new, step, |a, b| {
                    Ok([a, b].concat())
                })
            };
            assert_eq!(fold(usize::MAX), Ok((0..1000).collect()));
            assert!(fold(400).is_err_and(|k| k >= 400));
            let mut values = vec![0; 1000];
            threads.for_each_chunk(&mut values, 33, |k, stretch| stretch.fill(k));
            threads.for_each(&mut values, |k, value| *value = (k / 33 == *value).into());
            assert_eq!(values, [1; 1000]);
        }
    }
}
