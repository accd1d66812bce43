//! Delivery of an unordered stream while several threads search.
//!
//! # Correctness
//!
//! The consumer runs in a thread outside the pool, so it may wait for the pool of another detector. In a searching
//! thread, such a wait could execute other work of this pool, which could in turn wait for the consumer.

use std::panic::resume_unwind;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread;

use lazygrid_kernels::Pair;

use super::sink::{ChunkTarget, ChunkedOutput, PairConsumer};
use crate::Error;
use crate::executor::start_thread;

/// Runs `search`, and `consume` on a new thread. Recycles `free_chunks`.
pub(crate) fn deliver_unordered(
    consume: PairConsumer<'_>,
    free_chunks: &mut Vec<Vec<Pair>>,
    search: impl FnOnce(&ChunkedOutput<'_>) -> Result<(), Error>,
) -> Result<(), Error> {
    // With one waiting chunk per thread, no thread waits for a consumer that keeps up.
    let (sender, receiver) = sync_channel(rayon::current_num_threads());
    let end = sender.clone();
    let output = ChunkedOutput::new(ChunkTarget::Channel(sender), std::mem::take(free_chunks));
    let delivered = thread::scope(|scope| {
        let thread = thread::Builder::new().name("lazygrid-stream".to_owned());
        let chunks: Receiver<Vec<Pair>> = receiver;
        let output = &output;
        let consumer = start_thread(|| thread.spawn_scoped(scope, move || output.consume(&chunks, consume)))?;
        let end = EndOnDrop(end);
        let searched = search(output);
        drop(end);
        match consumer.join() {
            Ok(consumed) => searched.and(consumed),
            Err(panic) => resume_unwind(panic),
        }
    });
    *free_chunks = output.into_free_chunks();
    delivered
}

struct EndOnDrop(SyncSender<Vec<Pair>>);

impl Drop for EndOnDrop {
    fn drop(&mut self) {
        // Fails if the consumer's thread has already ended.
        let _ = self.0.send(Vec::new());
    }
}
