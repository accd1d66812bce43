use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use lazygrid::{Backend, check_thread_memory, thread_pool};

use crate::run::replicas::{ReplicaResults, Replicas};
use crate::run::{ReplicaSlot, RunEnd};
use crate::{AnySimulation, Error};

pub(crate) fn at_once(groups: &[Replicas]) -> u32 {
    let Some(first) = groups.first() else { return 1 };
    let runs: u64 = groups.iter().map(|group| u64::from(group.count.get())).sum();
    match first.run.backend {
        Backend::Gpu => 1,
        _ => u64::min(threads(first) as u64, runs) as u32,
    }
}

fn threads(replicas: &Replicas) -> usize {
    replicas.run.threads.unwrap_or_else(rayon::current_num_threads).max(1)
}

/// Does all replicas, one per thread at once, until `watch` breaks. Directories must be prepared.
///
/// # Errors
/// The first error, with its group. The other runs then have checkpoints.
pub(crate) fn run_all(
    groups: &[Replicas],
    watch: &(impl Fn(usize, u32, &AnySimulation) -> ControlFlow<()> + Sync),
) -> Result<Vec<ReplicaResults>, (usize, Error)> {
    let Some(first) = groups.first() else { return Ok(Vec::new()) };
    let (threads, at_once) = (threads(first), at_once(groups) as usize);
    // In a common pool, a worker that waits for its run would begin another one.
    let pools = (0..at_once).map(|k| thread_pool(threads / at_once + usize::from(k < threads % at_once)));
    let pools = pools.collect::<Result<Vec<_>, _>>().map_err(|error| (0, error.into()))?;
    check_thread_memory(at_once).map_err(|error| (0, error.into()))?;
    let queue = RunQueue::new(groups, at_once as u32);
    std::thread::scope(|scope| {
        for pool in &pools {
            let work = || pool.install(|| queue.work(watch));
            let spawned = std::thread::Builder::new().spawn_scoped(scope, work);
            if let Err(error) = spawned {
                queue.stop.store(true, Ordering::Relaxed);
                let refused = lazygrid::Error::ThreadPool { threads: at_once, reason: error.to_string() };
                return Err((0, Error::from(refused)));
            }
        }
        Ok(())
    })?;
    let mut finished = vec![Vec::new(); groups.len()];
    for ((group, replica), end) in queue.ended.into_inner().unwrap_or_else(PoisonError::into_inner) {
        match end {
            Ok(RunEnd::Finished) => finished[group].push(replica),
            Ok(RunEnd::Stopped) => {}
            Err(error) => return Err((group, Error::Replica { replica, source: Box::new(error) })),
        }
    }
    let results = groups.iter().zip(finished).enumerate();
    results.map(|(k, (group, finished))| group.results(&finished).map_err(|error| (k, error))).collect()
}

struct RunQueue<'a> {
    groups: &'a [Replicas],
    at_once: u32,
    starts: Vec<usize>,
    next: AtomicUsize,
    stop: AtomicBool,
    ended: Mutex<BTreeMap<(usize, u32), Result<RunEnd, Error>>>,
}

impl<'a> RunQueue<'a> {
    fn new(groups: &'a [Replicas], at_once: u32) -> Self {
        let mut starts = vec![0];
        starts.extend(groups.iter().scan(0, |runs, group| {
            *runs += group.count.get() as usize;
            Some(*runs)
        }));
        let (next, stop) = (AtomicUsize::new(0), AtomicBool::new(false));
        Self { groups, at_once, starts, next, stop, ended: Mutex::default() }
    }

    fn work(&self, watch: &(impl Fn(usize, u32, &AnySimulation) -> ControlFlow<()> + Sync)) {
        while !self.stop.load(Ordering::Relaxed) {
            let run = self.next.fetch_add(1, Ordering::Relaxed);
            let group = self.starts.partition_point(|&start| start <= run) - 1;
            let Some(replicas) = self.groups.get(group) else { return };
            let index = (run - self.starts[group]) as u32;
            let slot = ReplicaSlot { index, count: replicas.count.get(), at_once: self.at_once };
            let ended = replicas.replica(index).run_here(slot, |simulation| {
                if watch(group, index, simulation).is_break() {
                    self.stop.store(true, Ordering::Relaxed);
                }
                match self.stop.load(Ordering::Relaxed) {
                    true => ControlFlow::Break(()),
                    false => ControlFlow::Continue(()),
                }
            });
            if ended.is_err() {
                self.stop.store(true, Ordering::Relaxed);
            }
            let mut all = self.ended.lock().unwrap_or_else(PoisonError::into_inner);
            all.insert((group, index), ended.map(|(end, _)| end));
        }
    }
}
