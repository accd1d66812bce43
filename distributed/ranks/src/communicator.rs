use bytemuck::Pod;

use crate::Difference;
use crate::memory::try_collect;

/// Elements by rank, and the count of each.
pub type RankData<T> = (Vec<T>, Vec<usize>);

/// Collective operations: unless stated, all ranks call them in the same order. `what` names the data in errors.
pub trait Communicator {
    /// Equal on all ranks.
    type Error;

    /// Not collective.
    fn rank(&self) -> u32;

    /// Not collective.
    fn ranks(&self) -> u32;

    /// Returns the number of ranks that share this rank's memory, itself included. Not collective.
    fn ranks_on_machine(&self) -> u32;

    fn all_reduce_sum(&mut self, values: &[u64]) -> Vec<u64>;

    fn all_gather<T: Pod>(&mut self, what: &str, local: &[T]) -> Result<RankData<T>, Self::Error>;

    /// Sends `counts[rank]` consecutive elements to each rank, and returns those for this rank.
    fn all_to_all_v<T: Pod>(
        &mut self,
        what: &str,
        send: &[T],
        counts: &[usize],
    ) -> Result<RankData<T>, Self::Error>;

    /// Returns `result` if no rank failed.
    ///
    /// # Errors
    /// On all ranks, the error of the first rank that failed.
    fn agree<T>(&self, result: Result<T, Self::Error>) -> Result<T, Self::Error>;

    /// For a failure of this rank. Not collective.
    fn failure(&self, message: String) -> Self::Error;

    /// For a failure of this rank's detector or memory. Not collective.
    fn detector_failure(&self, error: lazygrid::Error) -> Self::Error {
        self.failure(error.to_string())
    }

    /// Not collective.
    fn difference(&self, difference: Difference) -> Self::Error {
        self.failure(difference.to_string())
    }
}

/// Gathers elements on rank 0, by rank. Collective.
pub fn gather<T: Pod, C: Communicator>(
    communicator: &mut C,
    what: &str,
    local: &[T],
) -> Result<Vec<T>, C::Error> {
    let mut counts = vec![0; communicator.ranks() as usize];
    counts[0] = local.len();
    communicator.all_to_all_v(what, local, &counts).map(|(all, _)| all)
}

/// Sends each element to its rank, in order. Collective.
pub fn send_to_ranks<T: Pod, C: Communicator>(
    communicator: &mut C,
    what: &str,
    send: Vec<(u32, T)>,
) -> Result<RankData<T>, C::Error> {
    let mut counts = vec![0; communicator.ranks() as usize];
    send.iter().for_each(|&(to, _)| counts[to as usize] += 1);
    let zeros = std::iter::repeat_n(T::zeroed(), send.len());
    let elements = try_collect(send.len(), zeros, "elements to send");
    let elements = elements.map(|elements| in_order_of_ranks(elements, send, &counts));
    let elements = agree_on_memory(communicator, elements)?;
    communicator.all_to_all_v(what, &elements, &counts)
}

/// Fills `elements` by rank, in order. A stable sort would abort the process if its buffer exceeded the memory.
fn in_order_of_ranks<T>(mut elements: Vec<T>, send: Vec<(u32, T)>, counts: &[usize]) -> Vec<T> {
    let firsts = counts.iter().scan(0, |end, count| {
        *end += count;
        Some(*end - count)
    });
    let mut next: Vec<usize> = firsts.collect();
    for (to, element) in send {
        let at = &mut next[to as usize];
        elements[*at] = element;
        *at += 1;
    }
    elements
}

/// Collective.
pub(crate) fn agree_on_memory<T, C: Communicator>(
    communicator: &C,
    made: Result<T, lazygrid::Error>,
) -> Result<T, C::Error> {
    communicator.agree(made.map_err(|error| communicator.detector_failure(error)))
}
