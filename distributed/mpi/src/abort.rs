use mpi::topology::SimpleCommunicator;
use mpi::traits::Communicator;

/// Makes a panic in any thread of this process end the job on all ranks, with exit code 101, after the panic's message
/// was written.
///
/// Otherwise the other ranks would wait until the launcher's time limit: unwinding ends in `MPI_Finalize`, which waits
/// for them in turn. A program calls this once, after MPI is initialized; the library does not, since a panic hook
/// belongs to the whole program.
pub fn abort_on_panic() {
    let before = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        before(panic);
        if mpi::is_initialized() && !mpi::is_finalized() {
            SimpleCommunicator::world().abort(101);
        }
        std::process::abort();
    }));
}
