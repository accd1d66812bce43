use bytemuck::Pod;
use lazygrid_ranks::{Communicator as RankCommunicator, Difference, MessageRounds, RankData};
use mpi::Count;
use mpi::collective::SystemOperation;
use mpi::datatype::{Partition, PartitionMut};
use mpi::topology::SimpleCommunicator;
use mpi::traits::{Communicator, CommunicatorCollectives};

use crate::Error;
use crate::agree::agree;
use crate::rank_segments::RankSegments;

pub(crate) struct MpiCommunicator {
    comm: SimpleCommunicator,
    ranks_on_machine: u32,
    limit: u64,
    sent: u64,
}

struct Outgoing<'a, T> {
    data: &'a [T],
    segments: &'a RankSegments,
}

struct Incoming<'a, T> {
    data: &'a mut [T],
    segments: &'a RankSegments,
}

impl MpiCommunicator {
    /// Collective.
    pub(crate) fn new(comm: SimpleCommunicator, limit: u64) -> Self {
        let ranks_on_machine = comm.split_shared(comm.rank()).size() as u32;
        Self { comm, ranks_on_machine, limit, sent: 0 }
    }

    pub(crate) fn comm(&self) -> &SimpleCommunicator {
        &self.comm
    }

    pub(crate) fn take_sent(&mut self) -> u64 {
        std::mem::take(&mut self.sent)
    }

    fn exchange_in_rounds<T: Pod>(
        &mut self,
        what: &str,
        most: u64,
        outgoing: Outgoing<'_, T>,
        incoming: Incoming<'_, T>,
    ) -> Result<(), Error> {
        let (Outgoing { data: send, segments: leaving }, Incoming { data: received, segments: coming }) =
            (outgoing, incoming);
        let limit = self.limit / size_of::<T>().max(1) as u64;
        let rounds = MessageRounds::new(limit, self.ranks()).map_err(|_| self.too_small(what))?;
        self.count_sent(leaving.total() * size_of::<T>());
        // The first round is the largest.
        let buffers =
            try_zeroed(what, leaving.in_round(rounds, 0).total() as u64, self.rank()).and_then(|out| {
                Ok((out, try_zeroed(what, coming.in_round(rounds, 0).total() as u64, self.rank())?))
            });
        let (mut out, mut into): (Vec<T>, Vec<T>) = self.agree(buffers)?;
        for round in 0..rounds.count(most) {
            let (leaving, coming) = (leaving.in_round(rounds, round), coming.in_round(rounds, round));
            // Copies the segments, since offsets in a message have 32 bits.
            let ranks = 0..leaving.lengths().len();
            out.clear();
            ranks.clone().for_each(|rank| out.extend_from_slice(&send[leaving.range(rank)]));
            into.resize(coming.total(), T::zeroed());
            self.message(
                Outgoing { data: &out, segments: &leaving },
                Incoming { data: &mut into, segments: &coming },
            );
            let mut next = 0;
            for rank in ranks {
                let segment = coming.range(rank);
                let length = segment.len();
                received[segment].copy_from_slice(&into[next..next + length]);
                next += length;
            }
        }
        Ok(())
    }

    fn message<T: Pod>(&self, outgoing: Outgoing<'_, T>, incoming: Incoming<'_, T>) {
        let (Outgoing { data: out, segments: leaving }, Incoming { data: into, segments: coming }) =
            (outgoing, incoming);
        let (leaving, coming) = (byte_counts::<T>(leaving.lengths()), byte_counts::<T>(coming.lengths()));
        let out = Partition::new(bytes_of(out), &leaving[..], begins(&leaving));
        let mut into = PartitionMut::new(bytes_mut(into), &coming[..], begins(&coming));
        self.comm.all_to_all_varcount_into(&out, &mut into);
    }

    fn too_small(&self, what: &str) -> Error {
        let range = format!("it is below an element of {what} for each of {} ranks; raise it", self.ranks());
        Error::Setting { name: "message_limit".to_owned(), value: self.limit.to_string(), range }
    }

    fn count_sent(&mut self, bytes: usize) {
        self.sent += bytes as u64;
    }
}

impl RankCommunicator for MpiCommunicator {
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

    fn ranks_on_machine(&self) -> u32 {
        self.ranks_on_machine
    }

    fn all_reduce_sum(&mut self, values: &[u64]) -> Vec<u64> {
        let mut sums = vec![0; values.len()];
        self.comm.all_reduce_into(values, &mut sums[..], SystemOperation::sum());
        self.count_sent(size_of_val(values));
        sums
    }

    fn all_gather<T: Pod>(&mut self, what: &str, local: &[T]) -> Result<RankData<T>, Error> {
        let ranks = self.ranks() as usize;
        let mut counts = vec![0_u64; ranks];
        self.comm.all_gather_into(&(local.len() as u64), &mut counts[..]);
        let total: u64 = counts.iter().sum();
        let needed = total * size_of::<T>() as u64;
        if needed > i32::MAX as u64 {
            // Fails on all ranks.
            return Err(Error::Message { what: what.to_owned(), needed, limit: i32::MAX as u64 });
        }
        let mut all = self.agree(try_zeroed(what, total, self.rank()))?;
        let counts: Vec<usize> = counts.into_iter().map(|count| count as usize).collect();
        let bytes = byte_counts::<T>(&counts);
        let mut into = PartitionMut::new(bytes_mut(&mut all), &bytes[..], begins(&bytes));
        self.comm.all_gather_varcount_into(bytes_of(local), &mut into);
        self.count_sent((size_of_val(local) + size_of::<u64>()) * (ranks - 1));
        Ok((all, counts))
    }

    fn all_to_all_v<T: Pod>(
        &mut self,
        what: &str,
        send: &[T],
        counts: &[usize],
    ) -> Result<RankData<T>, Error> {
        let rank = self.rank() as usize;
        let lengths: Vec<u64> = counts.iter().map(|&count| count as u64).collect();
        let mut received_counts = vec![0_u64; lengths.len()];
        self.comm.all_to_all_into(&lengths[..], &mut received_counts[..]);
        self.count_sent(size_of::<u64>() * (lengths.len() - 1));
        let leaving = RankSegments::new(counts.to_vec());
        let coming = RankSegments::new(received_counts.iter().map(|&count| count as usize).collect());
        let buffer = try_zeroed(what, received_counts.iter().sum(), self.rank());
        let (from_self, to_self) = (leaving.range(rank), coming.range(rank));
        let lengths = coming.lengths().to_vec();
        let (leaving, coming) = (leaving.without(rank), coming.without(rank));
        let (local, mut most) = ([leaving.max_length() as u64, buffer.is_err().into()], [0; 2]);
        self.comm.all_reduce_into(&local[..], &mut most[..], SystemOperation::max());
        let [most, refused] = most;
        let mut received = if refused > 0 { self.agree(buffer)? } else { buffer? };
        received[to_self].copy_from_slice(&send[from_self]);
        let outgoing = Outgoing { data: send, segments: &leaving };
        let incoming = Incoming { data: &mut received, segments: &coming };
        self.exchange_in_rounds(what, most, outgoing, incoming)?;
        Ok((received, lengths))
    }

    fn failure(&self, message: String) -> Error {
        Error::Input { rank: self.rank(), index: None, message }
    }

    fn detector_failure(&self, error: lazygrid::Error) -> Error {
        Error::from_detector(self.rank(), error)
    }

    fn difference(&self, difference: Difference) -> Error {
        let message = difference.to_string();
        Error::Settings { name: difference.setting, ranks: difference.ranks, message }
    }
}

fn try_zeroed<T: Pod>(what: &str, elements: u64, rank: u32) -> Result<Vec<T>, Error> {
    let mut buffer = try_reserved(what, elements, rank)?;
    buffer.resize(elements as usize, T::zeroed());
    Ok(buffer)
}

/// Returns an empty vector with the capacity for `elements`.
///
/// # Errors
/// [`Error::OutOfMemory`] on this rank alone: agree on the result before a collective call.
pub fn try_reserved<T>(what: &str, elements: u64, rank: u32) -> Result<Vec<T>, Error> {
    let mut buffer = Vec::new();
    let reserved =
        usize::try_from(elements).ok().and_then(|elements| buffer.try_reserve_exact(elements).ok());
    let bytes = elements.saturating_mul(size_of::<T>() as u64);
    reserved.map(|()| buffer).ok_or_else(|| Error::OutOfMemory { rank, what: what.to_owned(), bytes })
}

/// An empty slice of bytes has the address 1, `MPI_IN_PLACE` of Open MPI; one of larger numbers has another.
fn bytes_of<T: Pod>(buffer: &[T]) -> &[u8] {
    match buffer {
        [] => bytemuck::cast_slice::<u64, u8>(&[]),
        _ => bytemuck::cast_slice(buffer),
    }
}

fn bytes_mut<T: Pod>(buffer: &mut [T]) -> &mut [u8] {
    match buffer {
        [] => bytemuck::cast_slice_mut::<u64, u8>(&mut []),
        _ => bytemuck::cast_slice_mut(buffer),
    }
}

fn byte_counts<T>(lengths: &[usize]) -> Vec<Count> {
    lengths.iter().map(|&length| (length * size_of::<T>()) as Count).collect()
}

fn begins(lengths: &[Count]) -> Vec<Count> {
    lengths.iter().scan(0, |next, length| Some(std::mem::replace(next, *next + length))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refused_memory_is_an_error_with_the_rank() {
        assert_eq!(try_zeroed::<u64>("ghosts", 3, 5), Ok(vec![0; 3]));
        let error = try_zeroed::<u64>("ghosts", 1 << 60, 5).unwrap_err();
        assert!(
            error
                .to_string()
                .starts_with("rank 5: no memory for ghosts: 9223372036854775808 bytes were refused;"),
            "{error}"
        );
    }

    #[test]
    fn bytes_of_no_rank_are_gathered() {
        let universe = mpi::initialize().unwrap();
        let mut communicator = MpiCommunicator::new(universe.world(), 1 << 20);
        assert_eq!(communicator.all_gather::<u8>("bytes", &[]), Ok((Vec::new(), vec![0])));
        assert_eq!(communicator.all_to_all_v::<u8>("bytes", &[], &[0]), Ok((Vec::new(), vec![0])));
    }
}
