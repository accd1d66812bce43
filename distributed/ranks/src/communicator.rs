use bytemuck::Pod;

use crate::Difference;
use crate::memory::try_collect;

/// The elements of all ranks, those of rank 0 first, and the count of each rank.
pub type RankData<T> = (Vec<T>, Vec<usize>);

/// The collective operations that the algorithm needs.
///
/// Every method is collective unless its documentation says otherwise: all ranks call it, in the same order. The
/// parameter `what` names the data in messages. `lazygrid-mpi` implements the trait over MPI.
pub trait Communicator {
    /// The failure of a transport or of a [rank](Self::failure), the same on all ranks.
    type Error;

    /// Returns the index of this rank. Not collective.
    fn rank(&self) -> u32;

    /// Returns the number of ranks. Not collective.
    fn ranks(&self) -> u32;

    /// Returns the sum of each element over all ranks, which give equally many.
    fn all_reduce_sum(&mut self, values: &[u64]) -> Vec<u64>;

    /// Returns the elements of every rank, on all ranks.
    ///
    /// # Errors
    /// Fails if they cannot be sent.
    fn all_gather<T: Pod>(&mut self, what: &str, own: &[T]) -> Result<RankData<T>, Self::Error>;

    /// Sends `counts[rank]` consecutive elements of `send` to each rank, and returns the elements for this rank.
    ///
    /// # Errors
    /// Fails if they cannot be sent.
    fn all_to_all_v<T: Pod>(
        &mut self,
        what: &str,
        send: &[T],
        counts: &[usize],
    ) -> Result<RankData<T>, Self::Error>;

    /// Returns `result` if no rank failed, else the error of the first rank that did, the same on all ranks.
    ///
    /// # Errors
    /// Fails with the failure of that rank.
    fn agree<T>(&self, result: Result<T, Self::Error>) -> Result<T, Self::Error>;

    /// Returns the failure of this rank, with a message. Not collective.
    fn failure(&self, message: String) -> Self::Error;

    /// Returns the failure of a detector of this rank, or of its memory. Not collective.
    fn detector_failure(&self, error: lazygrid::Error) -> Self::Error {
        self.failure(error.to_string())
    }

    /// Returns the error for a setting that is not the same on all ranks. Not collective.
    fn difference(&self, difference: Difference) -> Self::Error {
        self.failure(difference.to_string())
    }
}

/// Gathers the elements of all ranks on rank 0, in the order of ranks. The other ranks get none. Collective.
///
/// # Errors
/// Fails if the communicator fails.
pub fn gather<T: Pod, C: Communicator>(
    communicator: &mut C,
    what: &str,
    own: &[T],
) -> Result<Vec<T>, C::Error> {
    let mut counts = vec![0; communicator.ranks() as usize];
    counts[0] = own.len();
    communicator.all_to_all_v(what, own, &counts).map(|(all, _)| all)
}

/// Sends each element to its rank. Elements for one rank stay in order. Collective.
///
/// # Errors
/// Fails if the communicator fails.
pub fn send_to_ranks<T: Pod, C: Communicator>(
    communicator: &mut C,
    what: &str,
    mut send: Vec<(u32, T)>,
) -> Result<RankData<T>, C::Error> {
    let mut counts = vec![0; communicator.ranks() as usize];
    send.iter().for_each(|&(to, _)| counts[to as usize] += 1);
    send.sort_by_key(|&(to, _)| to);
    let elements = try_collect(send.len(), send.iter().map(|&(_, element)| element), "elements to send");
    drop(send);
    let elements = agree_on_memory(communicator, elements)?;
    communicator.all_to_all_v(what, &elements, &counts)
}

/// Returns what this rank made if memory was refused on no rank. Collective.
///
/// # Errors
/// Fails with the failure of the first rank that has one.
pub(crate) fn agree_on_memory<T, C: Communicator>(
    communicator: &C,
    made: Result<T, lazygrid::Error>,
) -> Result<T, C::Error> {
    communicator.agree(made.map_err(|error| communicator.detector_failure(error)))
}
