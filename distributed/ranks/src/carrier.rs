use bytemuck::Pod;

use crate::{Body, Difference, Ghosts, Hull, Particle, Published};

/// Elements that came from all ranks, those of rank 0 first, and how many from each.
pub type Received<T> = (Vec<T>, Vec<usize>);

/// A communicator: the collective operations that the algorithm needs. Every method is collective unless it says otherwise: all ranks call it,
/// in the same order.
///
/// `lazygrid-mpi` has the one through MPI.
pub trait Carrier {
    /// The failure of a transport or of a [rank](Self::failure). It is the same on all ranks.
    type Error;

    /// The number of this rank, from 0 on. Not collective.
    fn rank(&self) -> u32;

    /// The number of ranks. Not collective.
    fn ranks(&self) -> u32;

    /// The sum of each place over all ranks, which have equally many.
    fn sum(&mut self, values: &[u64]) -> Vec<u64>;

    /// A few elements of each rank, on all ranks. `what` they are is for messages.
    ///
    /// # Errors
    /// Fails if they cannot be sent.
    fn share<T: Pod>(&mut self, what: &str, own: &[T]) -> Result<Received<T>, Self::Error>;

    /// Sends to each rank its part of `send`, `counts[rank]` elements of it one rank after the other.
    ///
    /// # Errors
    /// Fails if they cannot be sent.
    fn exchange<T: Pod>(
        &mut self,
        what: &str,
        send: &[T],
        counts: &[usize],
    ) -> Result<Received<T>, Self::Error>;

    /// The result of this rank where no rank failed, else on all ranks the error of the first that did.
    ///
    /// # Errors
    /// Fails with the failure of that rank.
    fn agree<T>(&self, result: Result<T, Self::Error>) -> Result<T, Self::Error>;

    /// The failure of this rank, from a message. Not collective.
    fn failure(&self, message: String) -> Self::Error;

    /// The error for a setting that is not the same on all ranks. Not collective.
    fn difference(&self, difference: Difference) -> Self::Error {
        self.failure(difference.to_string())
    }
}

/// Brings elements of all ranks to rank 0, in the order of ranks. The others get none.
///
/// # Errors
/// Fails if the communicator fails.
pub fn gather<T: Pod, C: Carrier>(carrier: &mut C, what: &str, own: &[T]) -> Result<Vec<T>, C::Error> {
    let mut counts = vec![0; carrier.ranks() as usize];
    counts[0] = own.len();
    carrier.exchange(what, own, &counts).map(|(all, _)| all)
}

/// Sends to each rank what belongs there, in the order in which it is here.
///
/// # Errors
/// Fails if the communicator fails.
pub fn deliver<T: Pod, C: Carrier>(
    carrier: &mut C,
    what: &str,
    mut send: Vec<(u32, T)>,
) -> Result<Received<T>, C::Error> {
    let mut counts = vec![0; carrier.ranks() as usize];
    send.iter().for_each(|&(to, _)| counts[to as usize] += 1);
    send.sort_by_key(|&(to, _)| to);
    let send: Vec<T> = send.into_iter().map(|(_, element)| element).collect();
    carrier.exchange(what, &send, &counts)
}

impl Published {
    /// Tells all ranks the hulls of these bodies, and gets to know theirs.
    ///
    /// # Errors
    /// Fails if the communicator fails.
    pub fn by<C: Carrier>(carrier: &mut C, bodies: &[Body]) -> Result<Self, C::Error> {
        let (hulls, counts) = carrier.share("hulls", &Hull::of(bodies))?;
        let mut hulls = hulls.into_iter();
        Ok(Self::new(counts.iter().map(|&count| hulls.by_ref().take(count).collect())))
    }
}

impl Ghosts {
    /// Sends out the spheres at the places that are `leaving` to each rank, and gets those that others send here.
    ///
    /// # Errors
    /// Fails if the communicator fails.
    pub fn trade<C: Carrier>(
        carrier: &mut C,
        leaving: &[Vec<u32>],
        of: impl Fn(u32) -> Particle,
    ) -> Result<Self, C::Error> {
        let counts: Vec<usize> = leaving.iter().map(Vec::len).collect();
        let send: Vec<_> = leaving.iter().flatten().map(|&k| of(k)).collect();
        let (ghosts, counts) = carrier.exchange("ghosts", &send, &counts)?;
        Ok(Self::new(ghosts, &counts))
    }
}
