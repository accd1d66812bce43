use bytemuck::Pod;
use lazygrid_ranks::{Carrier, Difference, Received, Rounds};
use mpi::Count;
use mpi::collective::SystemOperation;
use mpi::datatype::{Partition, PartitionMut};
use mpi::topology::SimpleCommunicator;
use mpi::traits::{Communicator, CommunicatorCollectives};

use crate::Error;
use crate::agree::agree;
use crate::parts::Parts;

/// Carries data between the ranks. Everything here is collective.
pub(crate) struct Wire {
    comm: SimpleCommunicator,
    /// The most bytes of a message.
    limit: u64,
    /// Bytes that this rank has sent to others.
    sent: u64,
}

impl Wire {
    pub(crate) fn new(comm: SimpleCommunicator, limit: u64) -> Self {
        Self { comm, limit, sent: 0 }
    }

    pub(crate) fn comm(&self) -> &SimpleCommunicator {
        &self.comm
    }

    /// Bytes sent since the last call of this.
    pub(crate) fn take_sent(&mut self) -> u64 {
        std::mem::take(&mut self.sent)
    }

    /// Sends what is `leaving`, of which `most` elements go from some rank to another.
    fn rounds<T: Pod>(
        &mut self,
        what: &str,
        most: u64,
        (send, leaving): (&[T], &Parts),
        (received, coming): (&mut [T], &Parts),
    ) -> Result<(), Error> {
        let limit = self.limit / size_of::<T>() as u64;
        let rounds = Rounds::new(limit, self.ranks()).map_err(|_| self.too_small(what))?;
        self.count_sent(leaving.total() * size_of::<T>(), 1);
        for round in 0..rounds.count(most) {
            let (leaving, coming) = (leaving.in_round(rounds, round), coming.in_round(rounds, round));
            // A round's part of each rank is brought together, because places in a message are 32 bits too.
            let ranks = 0..leaving.lengths().len();
            let out: Vec<T> = ranks.clone().flat_map(|rank| &send[leaving.of(rank)]).copied().collect();
            let mut into = vec![T::zeroed(); coming.total()];
            self.message((&out, &leaving), (&mut into, &coming));
            let mut next = 0;
            for rank in ranks {
                let place = coming.of(rank);
                let length = place.len();
                received[place].copy_from_slice(&into[next..next + length]);
                next += length;
            }
        }
        Ok(())
    }

    /// One message from each rank to each. Its bytes are within the limit.
    fn message<T: Pod>(&self, (out, leaving): (&[T], &Parts), (into, coming): (&mut [T], &Parts)) {
        let (leaving, coming) = (byte_counts::<T>(leaving.lengths()), byte_counts::<T>(coming.lengths()));
        let out = Partition::new(bytemuck::cast_slice::<T, u8>(out), &leaving[..], begins(&leaving));
        let into = bytemuck::cast_slice_mut::<T, u8>(into);
        let mut into = PartitionMut::new(into, &coming[..], begins(&coming));
        self.comm.all_to_all_varcount_into(&out, &mut into);
    }

    fn too_small(&self, what: &str) -> Error {
        let range = format!("it does not let an element of {what} to each of {} ranks", self.ranks());
        Error::Setting { name: "message_limit".to_owned(), value: self.limit.to_string(), range }
    }

    fn count_sent(&mut self, bytes: usize, to: usize) {
        self.sent += (bytes * to) as u64;
    }
}

impl Carrier for Wire {
    type Error = Error;

    fn rank(&self) -> u32 {
        self.comm.rank() as u32
    }

    fn ranks(&self) -> u32 {
        self.comm.size() as u32
    }

    fn agree<T>(&self, result: Result<T, Error>) -> Result<T, Error> {
        agree(&self.comm, result)
    }

    fn sum(&mut self, values: &[u64]) -> Vec<u64> {
        let mut sums = vec![0; values.len()];
        self.comm.all_reduce_into(values, &mut sums[..], SystemOperation::sum());
        self.count_sent(size_of_val(values), 1);
        sums
    }

    fn share<T: Pod>(&mut self, what: &str, own: &[T]) -> Result<Received<T>, Error> {
        let ranks = self.ranks() as usize;
        let mut counts = vec![0_u64; ranks];
        self.comm.all_gather_into(&(own.len() as u64), &mut counts[..]);
        let total: u64 = counts.iter().sum();
        let needed = total * size_of::<T>() as u64;
        if needed > i32::MAX as u64 {
            // All ranks see the same counts.
            return Err(Error::Message { what: what.to_owned(), needed, limit: i32::MAX as u64 });
        }
        let mut all = self.agree(room(what, total, self.rank()))?;
        let counts: Vec<usize> = counts.into_iter().map(|count| count as usize).collect();
        let bytes = byte_counts::<T>(&counts);
        let mut into =
            PartitionMut::new(bytemuck::cast_slice_mut::<T, u8>(&mut all), &bytes[..], begins(&bytes));
        self.comm.all_gather_varcount_into(bytemuck::cast_slice::<T, u8>(own), &mut into);
        self.count_sent(size_of_val(own) + size_of::<u64>(), ranks - 1);
        Ok((all, counts))
    }

    fn exchange<T: Pod>(&mut self, what: &str, send: &[T], counts: &[usize]) -> Result<Received<T>, Error> {
        let own = self.rank() as usize;
        let lengths: Vec<u64> = counts.iter().map(|&count| count as u64).collect();
        let mut told = vec![0_u64; lengths.len()];
        self.comm.all_to_all_into(&lengths[..], &mut told[..]);
        self.count_sent(size_of::<u64>(), lengths.len() - 1);
        let leaving = Parts::new(counts.to_vec());
        let coming = Parts::new(told.iter().map(|&count| count as usize).collect());
        let room = room(what, told.iter().sum(), self.rank());
        // What stays is not sent.
        let (from_own, to_own) = (leaving.of(own), coming.of(own));
        let lengths = coming.lengths().to_vec();
        let (leaving, coming) = (leaving.without(own), coming.without(own));
        let (asked, mut most) = ([leaving.most() as u64, room.is_err().into()], [0; 2]);
        self.comm.all_reduce_into(&asked[..], &mut most[..], SystemOperation::max());
        let [most, refused] = most;
        let mut received = if refused > 0 { self.agree(room)? } else { room? };
        received[to_own].copy_from_slice(&send[from_own]);
        self.rounds(what, most, (send, &leaving), (&mut received, &coming))?;
        Ok((received, lengths))
    }

    fn failure(&self, message: String) -> Error {
        Error::Input { rank: self.rank(), index: None, message }
    }

    fn difference(&self, difference: Difference) -> Error {
        let message = difference.to_string();
        Error::Settings { name: difference.setting, ranks: difference.ranks, message }
    }
}

/// Returns a buffer for this number of elements, or the error if memory is refused.
pub(crate) fn room<T: Pod>(what: &str, elements: u64, rank: u32) -> Result<Vec<T>, Error> {
    let mut room = Vec::new();
    match usize::try_from(elements).ok().and_then(|elements| room.try_reserve_exact(elements).ok()) {
        Some(()) => {
            room.resize(elements as usize, T::zeroed());
            Ok(room)
        }
        None => {
            let bytes = elements.saturating_mul(size_of::<T>() as u64);
            Err(Error::OutOfMemory { rank, what: what.to_owned(), bytes })
        }
    }
}

/// Lengths in bytes, which the caller knows to be few enough.
fn byte_counts<T>(lengths: &[usize]) -> Vec<Count> {
    lengths.iter().map(|&length| (length * size_of::<T>()) as Count).collect()
}

/// Where each of these begins, one behind the other.
fn begins(lengths: &[Count]) -> Vec<Count> {
    lengths.iter().scan(0, |next, length| Some(std::mem::replace(next, *next + length))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refused_memory_is_an_error_that_names_the_rank() {
        assert_eq!(room::<u64>("ghosts", 3, 5), Ok(vec![0; 3]));
        let error = room::<u64>("ghosts", 1 << 60, 5).unwrap_err();
        assert!(
            error
                .to_string()
                .starts_with("rank 5: no memory for ghosts: 9223372036854775808 bytes were refused;"),
            "{error}"
        );
    }
}
