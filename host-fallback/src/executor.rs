//! The threads of a call: the calling thread alone, or all threads of a rayon pool. No other module uses
//! rayon.
//!
//! Work comes in numbered pieces. Whichever piece fails first ends the work, and its error is the answer.

use std::error::Error as _;
use std::sync::OnceLock;
use std::thread::available_parallelism;

use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::Error;

/// Executor per core of a pool at most. One is useful; a few do no harm, and a process may be given more cores while it
/// runs.
const MAX_THREADS_PER_CORE: usize = 4;
/// Executor of a pool that are started wherever they are asked for.
const MIN_MAX_THREADS: usize = 16;

/// Spheres from which on several threads pass over them: waking the others takes as long as passing over fewer.
pub(crate) const MIN_PARALLEL_SPHERES: usize = 1 << 14;
/// Work that ends sooner, in nanoseconds, is not worth waking the others.
const MIN_PARALLEL_NS: f32 = 300_000.0;

/// Which threads work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Executor {
    /// The calling thread, which wakes no other thread.
    Caller,
    /// The threads of the calling thread's pool, or of rayon's global pool.
    Pool,
}

impl Executor {
    /// Returns the threads of a call from here; a pool of one thread is not worth the switch.
    ///
    /// # Errors
    /// [`Error::ThreadPool`] where rayon's global pool is needed and cannot be started.
    pub(crate) fn current() -> Result<Self, Error> {
        if rayon::current_thread_index().is_none() {
            start_global()?;
        }
        Ok(if rayon::current_num_threads() == 1 { Self::Caller } else { Self::Pool })
    }

    /// The threads for a pass over `count` spheres or pairs with little work for each.
    pub(crate) fn for_light_work(self, count: usize) -> Self {
        if count < MIN_PARALLEL_SPHERES { Self::Caller } else { self }
    }

    /// Returns `true` if work that takes one thread `time` nanoseconds is best left to it.
    pub(crate) fn is_short(time: f32) -> bool {
        time < MIN_PARALLEL_NS
    }

    /// Does `work` with every item and its number.
    pub(crate) fn for_each<T: Send>(self, items: &mut [T], work: impl Fn(usize, &mut T) + Sync) {
        match self {
            Self::Pool if items.len() > 1 => {
                items.par_iter_mut().enumerate().for_each(|(k, item)| work(k, item));
            }
            _ => items.iter_mut().enumerate().for_each(|(k, item)| work(k, item)),
        }
    }

    /// Does `work` with every stretch of `size` values and its number; the last stretch may be shorter.
    pub(crate) fn for_each_chunk<T: Send>(
        self,
        values: &mut [T],
        size: usize,
        work: impl Fn(usize, &mut [T]) + Sync,
    ) {
        match self {
            Self::Pool if values.len() > size => {
                values.par_chunks_mut(size).enumerate().for_each(|(k, stretch)| work(k, stretch));
            }
            _ => values.chunks_mut(size).enumerate().for_each(|(k, stretch)| work(k, stretch)),
        }
    }

    /// Takes what `open` makes through neighbouring pieces, one after the other, and merges what comes out in the order
    /// of the pieces. No thread takes more than `most` pieces without offering the others some.
    ///
    /// # Errors
    /// The errors of `step` and `merge`.
    pub(crate) fn fold<S: Send, E: Send>(
        self,
        (pieces, most): (usize, usize),
        open: impl Fn() -> S + Sync + Send,
        step: impl Fn(S, usize) -> Result<S, E> + Sync + Send,
        merge: impl Fn(S, S) -> Result<S, E> + Sync + Send,
    ) -> Result<S, E> {
        match self {
            Self::Pool if pieces > 1 => {
                let pieces = (0..pieces).into_par_iter().with_max_len(most);
                pieces.try_fold(&open, step).try_reduce(&open, merge)
            }
            _ => (0..pieces).try_fold(open(), step),
        }
    }
}

/// The threads of a detector: those of a pool of its own, or of the caller's.
#[derive(Debug)]
pub struct Team {
    pool: Option<ThreadPool>,
    asked: Option<usize>,
}

impl Team {
    /// A team of `asked` threads; `None` for the rayon pool that each call comes from.
    ///
    /// # Errors
    /// [`Error::ThreadPool`] if the system refuses the threads.
    pub fn new(asked: Option<usize>) -> Result<Self, Error> {
        let pool = match asked {
            // One thread is the calling one.
            None | Some(1) => None,
            Some(threads) => Some(pool(threads)?),
        };
        Ok(Self { pool, asked })
    }

    /// Passes over `count` items with the threads that are worth it: few are left to the calling one.
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

    /// Runs `task` in the pool.
    pub(crate) fn within<R: Send>(&self, task: impl FnOnce() -> R + Send) -> R {
        within(self.pool.as_ref(), task)
    }

    /// Returns the threads of a call from here.
    ///
    /// # Errors
    /// The same as [`Executor::current`].
    pub(crate) fn executor(&self) -> Result<Executor, Error> {
        if self.asked == Some(1) { Ok(Executor::Caller) } else { Executor::current() }
    }

    /// The number of threads in a call from here.
    pub(crate) fn count(&self) -> usize {
        match (&self.pool, self.asked) {
            (Some(pool), _) => pool.current_num_threads(),
            (None, Some(threads)) => threads,
            (None, None) => count(),
        }
    }
}

/// Runs `task` in this pool, or in that of whoever calls if there is none.
fn within<R: Send>(pool: Option<&ThreadPool>, task: impl FnOnce() -> R + Send) -> R {
    match pool {
        Some(pool) => pool.install(task),
        None => task(),
    }
}

/// The number of threads that the pool of a caller from here has, or would have.
fn count() -> usize {
    if rayon::current_thread_index().is_some() { rayon::current_num_threads() } else { cores() }
}

/// A pool of the `asked` number of threads, or as many as are of any use.
///
/// # Errors
/// [`Error::ThreadPool`] where the system refuses the threads.
fn pool(asked: usize) -> Result<ThreadPool, Error> {
    let cores = cores();
    let threads = useful(asked, cores);
    if threads < asked {
        log::warn!("{asked} threads were asked for; {threads} were started, for {cores} can run at a time");
    }
    let built = ThreadPoolBuilder::new().num_threads(threads).build();
    built.map_err(|error| Error::ThreadPool { threads, reason: error.to_string() })
}

/// The number of useful threads among those `asked` for.
fn useful(asked: usize, cores: usize) -> usize {
    asked.min((MAX_THREADS_PER_CORE * cores).max(MIN_MAX_THREADS))
}

fn cores() -> usize {
    available_parallelism().map_or(1, usize::from)
}

/// Starts rayon's global pool unless somebody has: rayon itself would do so at the first use, and panic where the system
/// refuses the threads.
fn start_global() -> Result<(), Error> {
    static STARTED: OnceLock<Result<(), String>> = OnceLock::new();
    let started = STARTED.get_or_init(|| match ThreadPoolBuilder::new().build_global() {
        // One without a source says that the pool is there already.
        Err(error) if error.source().is_some() => Err(error.to_string()),
        _ => Ok(()),
    });
    started.clone().map_err(|reason| Error::ThreadPool { threads: cores(), reason })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn threads_that_nobody_can_run_are_not_started() {
        for (asked, cores, started) in [(1, 1, 1), (7, 2, 7), (16, 1, 16), (17, 1, 16), (64, 16, 64)] {
            assert_eq!(useful(asked, cores), started, "{asked} on {cores} cores");
        }
        assert_eq!(useful(100_000, 2), 16);
        assert_eq!(useful(100_000, 64), 256);
        let started = pool(100_000).expect("some threads").current_num_threads();
        assert!(started <= (MAX_THREADS_PER_CORE * cores()).max(MIN_MAX_THREADS), "{started}");
    }

    #[test]
    fn folds_keep_the_order_and_the_first_error_ends_them() {
        for threads in [Executor::Caller, Executor::Pool] {
            let fold = |limit: usize| {
                let step = |mut all: Vec<usize>, k| {
                    all.push(k);
                    if k < limit { Ok(all) } else { Err(k) }
                };
                threads.fold((1000, 7), Vec::new, step, |a, b| Ok([a, b].concat()))
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
