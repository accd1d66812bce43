use mpi::topology::SimpleCommunicator;
use mpi::traits::Communicator;

/// Makes a panic in any thread end the job on all ranks with exit code 101. Otherwise the other ranks would wait in
/// `MPI_Finalize`. Programs call this once after initializing MPI, since a library must not set a panic hook.
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
