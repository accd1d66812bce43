//! The detectors of one Python object. Each call leases one, so several threads can use the object at a time. A
//! returned detector keeps its buffers.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;

use lazygrid::{Backend, Config, Error, Report};
use pyo3::PyResult;

use crate::error;
use crate::fork::{self, Process};

/// Most idle detectors of streams, each of which has its own threads.
const MAX_IDLE_STREAMS: usize = 2;

struct PooledDetector {
    detector: lazygrid::Detector,
    cancel: Arc<AtomicBool>,
}

pub(crate) struct DetectorPool {
    config: Config,
    /// The settings of detectors of streams, if other detectors share rayon's global pool: a stream blocks its threads
    /// while Python takes no chunk.
    stream_config: Option<Config>,
    is_single_threaded: bool,
    is_on_cpu: bool,
    /// The process that has the threads of the idle detectors, or the connection to their GPU.
    process: Option<Process>,
    idle: Mutex<IdleDetectors>,
}

#[expect(clippy::vec_box, reason = "a lease moves the pointer, not the detector")]
struct IdleDetectors {
    detectors: Vec<Box<PooledDetector>>,
    for_streams: Vec<Box<PooledDetector>>,
    report: Report,
}

impl DetectorPool {
    pub(crate) fn new(config: Config, threads: Option<usize>) -> PyResult<Arc<Self>> {
        let first = PooledDetector::new(&config).map_err(error::engine)?;
        let report = first.detector.report();
        let is_on_cpu = report.backend == Backend::Cpu;
        let is_single_threaded = threads == Some(1);
        let process = match is_on_cpu && threads.is_none_or(|threads| threads == 1) {
            // The threads of the global pool start at the first call.
            true => None,
            false => {
                fork::use_threads()?;
                Some(Process::current())
            }
        };
        let stream_config = threads.is_none().then(|| config.clone().threads(lazygrid::default_threads()));
        let idle = Mutex::new(IdleDetectors { report, detectors: vec![first], for_streams: Vec::new() });
        Ok(Arc::new(Self { config, stream_config, is_single_threaded, is_on_cpu, process, idle }))
    }

    /// Leases an idle detector, or a new one; an `Error` in a forked process.
    pub(crate) fn lease(self: &Arc<Self>) -> PyResult<DetectorLease> {
        self.lease_with(None)
    }

    /// Leases a detector whose threads no other detector uses.
    pub(crate) fn lease_for_stream(self: &Arc<Self>) -> PyResult<DetectorLease> {
        self.lease_with(self.stream_config.as_ref())
    }

    fn lease_with(self: &Arc<Self>, stream_config: Option<&Config>) -> PyResult<DetectorLease> {
        self.check_process()?;
        let idle = self.idle().detectors(stream_config.is_some()).pop();
        let config = stream_config.unwrap_or(&self.config);
        let detector = idle.map_or_else(|| PooledDetector::new(config).map_err(error::engine), Ok)?;
        let has_stream_config = stream_config.is_some();
        Ok(DetectorLease {
            pool: self.clone(),
            detector: Some(detector),
            has_stream_config,
            has_searched: false,
            stream: None,
        })
    }

    fn check_process(&self) -> PyResult<()> {
        if let Some(process) = self.process {
            process.check()?;
        }
        if self.is_single_threaded && self.is_on_cpu { Ok(()) } else { fork::use_threads() }
    }

    pub(crate) fn report(&self) -> Report {
        self.idle().report.clone()
    }

    fn idle(&self) -> MutexGuard<'_, IdleDetectors> {
        self.idle.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl IdleDetectors {
    #[expect(clippy::vec_box, reason = "as in the structure")]
    fn detectors(&mut self, has_stream_config: bool) -> &mut Vec<Box<PooledDetector>> {
        if has_stream_config { &mut self.for_streams } else { &mut self.detectors }
    }
}

impl PooledDetector {
    fn new(config: &Config) -> Result<Box<Self>, Error> {
        let cancel = Arc::new(AtomicBool::new(false));
        let detector = lazygrid::Detector::new(config.clone().cancel_flag(cancel.clone()))?;
        Ok(Box::new(Self { detector, cancel }))
    }
}

pub(crate) struct DetectorLease {
    pool: Arc<DetectorPool>,
    /// `None` only while the lease ends.
    detector: Option<Box<PooledDetector>>,
    has_stream_config: bool,
    /// If `false`, the detector's report is not of this lease.
    has_searched: bool,
    /// The flag of a [`StreamStopper`]: `true` until the lease ends.
    stream: Option<Arc<AtomicBool>>,
}

impl DetectorLease {
    pub(crate) fn detector_and_cancel(&mut self) -> (&mut lazygrid::Detector, &AtomicBool) {
        self.has_searched = true;
        match self.detector.as_deref_mut() {
            Some(PooledDetector { detector, cancel }) => (detector, cancel),
            None => unreachable!("a detector is returned when its lease ends"),
        }
    }

    pub(crate) fn memory_for(&self, spheres: u64) -> u64 {
        self.detector.as_ref().map_or(0, |leased| leased.detector.memory_for(spheres))
    }

    pub(crate) fn is_on_cpu(&self) -> bool {
        self.pool.is_on_cpu
    }

    pub(crate) fn is_single_threaded(&self) -> bool {
        self.pool.is_single_threaded
    }

    pub(crate) fn stopper(&mut self) -> StreamStopper {
        let is_leased = self.stream.get_or_insert_with(|| Arc::new(AtomicBool::new(true))).clone();
        let cancel = self.detector.as_ref().map(|leased| leased.cancel.clone()).unwrap_or_default();
        StreamStopper { pool: self.pool.clone(), is_leased, cancel }
    }
}

impl Drop for DetectorLease {
    fn drop(&mut self) {
        let mut idle = self.pool.idle();
        if let Some(is_leased) = &self.stream {
            is_leased.store(false, Ordering::Relaxed);
        }
        let Some(leased) = self.detector.take() else { return };
        // A panic may have left the detector's buffers incomplete.
        if thread::panicking() {
            return;
        }
        leased.cancel.store(false, Ordering::Relaxed);
        if self.has_searched {
            idle.report = leased.detector.report();
        }
        let detectors = idle.detectors(self.has_stream_config);
        if !self.has_stream_config || detectors.len() < MAX_IDLE_STREAMS {
            detectors.push(leased);
            return;
        }
        drop(idle);
        // Ends its threads.
        drop(leased);
    }
}

pub(crate) struct StreamStopper {
    pool: Arc<DetectorPool>,
    is_leased: Arc<AtomicBool>,
    cancel: Arc<AtomicBool>,
}

impl StreamStopper {
    /// Ends the search, unless its lease has ended: the detector may then serve another call.
    pub(crate) fn stop(&self) {
        // Leases end under this lock.
        let _idle = self.pool.idle();
        if self.is_leased.load(Ordering::Relaxed) {
            self.cancel.store(true, Ordering::Relaxed);
        }
    }
}
