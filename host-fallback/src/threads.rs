//! Who does the work of a call: the calling thread alone, or all threads of a rayon pool. Nothing else here knows of
//! rayon.
//!
//! Work comes in numbered pieces. Whichever piece fails first ends the work, and its error is the answer.

use rayon::prelude::*;

/// Which threads work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Threads {
    /// The calling thread, which wakes nobody.
    Calling,
    /// Those of the pool that the calling thread belongs to, or of rayon's global one.
    Pool,
}

impl Threads {
    /// Those that a call from here has; a pool of one thread is not worth the way there.
    pub(crate) fn here() -> Self {
        if rayon::current_num_threads() == 1 { Self::Calling } else { Self::Pool }
    }

    /// Does `work` with every item and its number.
    pub(crate) fn each<T: Send>(self, items: &mut [T], work: impl Fn(usize, &mut T) + Sync) {
        match self {
            Self::Pool if items.len() > 1 => {
                items.par_iter_mut().enumerate().for_each(|(k, item)| work(k, item));
            }
            _ => items.iter_mut().enumerate().for_each(|(k, item)| work(k, item)),
        }
    }

    /// Does `work` with every stretch of `size` values and its number; the last stretch may be shorter.
    pub(crate) fn each_stretch<T: Send>(
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
    /// Those of `step` and `merge`.
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
