use mpi::collective::SystemOperation;
use mpi::traits::{Communicator, CommunicatorCollectives, Root};

use crate::Error;

/// Returns this rank's result if no rank failed. Collective.
///
/// # Errors
/// On all ranks, the error of the first rank that failed.
pub fn agree<T>(comm: &impl Communicator, result: Result<T, Error>) -> Result<T, Error> {
    let rank = comm.rank();
    let failed_rank = if result.is_err() { rank } else { i32::MAX };
    let mut first = i32::MAX;
    comm.all_reduce_into(&failed_rank, &mut first, SystemOperation::min());
    if first == i32::MAX {
        return result;
    }
    let mut text = match &result {
        Err(error) if first == rank => postcard::to_stdvec(error).unwrap_or_default(),
        Err(error) => {
            log::info!("{error}, besides what rank {first} says");
            Vec::new()
        }
        Ok(_) => Vec::new(),
    };
    let speaker = comm.process_at_rank(first);
    let mut length = text.len() as u64;
    speaker.broadcast_into(&mut length);
    text.resize(length as usize, 0);
    speaker.broadcast_into(&mut text[..]);
    let unread =
        |_| Error::Detection { rank: first as u32, message: "failed, and could not say why".to_owned() };
    Err(postcard::from_bytes(&text).unwrap_or_else(unread))
}
