use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::thread;

use crate::common::device;
use lazygrid_check::Effort;
use lazygrid_check::kernels::CHECKS;

/// Called by several threads, as the driver compiles a kernel on one core.
fn faults(next: &AtomicUsize) -> Vec<String> {
    let Some(gpu) = device() else { return Vec::new() };
    std::iter::from_fn(|| CHECKS.get(next.fetch_add(1, Relaxed)))
        .filter_map(|check| {
            (check.run)(&gpu, Effort::Default).err().map(|fault| format!("{}: {fault}", check.name))
        })
        .collect()
}

#[test]
fn every_kernel_agrees_with_a_sequential_function() {
    let next = AtomicUsize::new(0);
    let cores = thread::available_parallelism().map_or(1, usize::from).min(4);
    let found: Vec<String> = thread::scope(|scope| {
        let takers: Vec<_> = (0..cores).map(|_| scope.spawn(|| faults(&next))).collect();
        takers.into_iter().flat_map(|taker| taker.join().expect("no check panics")).collect()
    });
    assert!(found.is_empty(), "{}", found.join("\n"));
}
