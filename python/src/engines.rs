//! The engines behind a detector. Each call leases one, so that several threads can use one detector at a time, and one
//! that iterates over chunks can call it again. An engine that is given back keeps its buffers for the next call.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use lazygrid::{Config, Error, Report};
use pyo3::PyResult;

use crate::{error, fork};

/// A detector, and the flag that ends its search.
struct Engine {
    detector: lazygrid::Detector,
    stop: Arc<AtomicBool>,
}

/// Engines of one configuration.
pub(crate) struct Engines {
    config: Config,
    /// `true` if calls are done by the calling thread alone.
    alone: bool,
    idle: Mutex<Idle>,
}

struct Idle {
    engines: Vec<Engine>,
    /// Of the call that ended last among those whose engine is leased again.
    report: Report,
}

impl Engines {
    /// The first engine, and those to come; `alone` where they have one thread.
    ///
    /// # Errors
    /// As `lazygrid::Detector::new`.
    pub(crate) fn new(config: Config, alone: bool) -> Result<Arc<Self>, Error> {
        let engine = Engine::new(&config)?;
        let idle = Idle { report: engine.detector.report(), engines: vec![engine] };
        Ok(Arc::new(Self { config, alone, idle: Mutex::new(idle) }))
    }

    /// An engine that is idle, or a new one.
    ///
    /// # Errors
    /// As `lazygrid::Detector::new`; `Error` in a copied process.
    pub(crate) fn lease(self: &Arc<Self>) -> PyResult<Lease> {
        if !self.alone {
            fork::use_threads()?;
        }
        let idle = self.idle().engines.pop();
        let engine = idle.map_or_else(|| Engine::new(&self.config).map_err(error::engine), Ok)?;
        Ok(Lease { engines: self.clone(), engine: Some(engine), leased: Arc::new(AtomicBool::new(true)) })
    }

    /// What the call that ended last did and why.
    pub(crate) fn report(&self) -> Report {
        let idle = self.idle();
        idle.engines.last().map_or_else(|| idle.report.clone(), |engine| engine.detector.report())
    }

    fn idle(&self) -> MutexGuard<'_, Idle> {
        // Nothing panics while it holds the lock.
        self.idle.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Engine {
    fn new(config: &Config) -> Result<Self, Error> {
        let stop = Arc::new(AtomicBool::new(false));
        Ok(Self { detector: lazygrid::Detector::new(config.clone().stop(stop.clone()))?, stop })
    }
}

/// An engine for the time of a call.
pub(crate) struct Lease {
    engines: Arc<Engines>,
    /// Only gone when it is given back.
    engine: Option<Engine>,
    leased: Arc<AtomicBool>,
}

impl Lease {
    /// The detector, and the flag that ends its search.
    pub(crate) fn parts(&mut self) -> (&mut lazygrid::Detector, &AtomicBool) {
        match &mut self.engine {
            Some(Engine { detector, stop }) => (detector, stop),
            None => unreachable!("an engine is given back when its lease ends"),
        }
    }

    /// What ends the search from elsewhere.
    pub(crate) fn stopper(&self) -> Stopper {
        let stop = self.engine.as_ref().map(|engine| engine.stop.clone()).unwrap_or_default();
        Stopper { engines: self.engines.clone(), leased: self.leased.clone(), stop }
    }

    /// Remembers what the last call did, for as long as the engine is away.
    pub(crate) fn keep_report(&self) {
        if let Some(engine) = &self.engine {
            let report = engine.detector.report();
            self.engines.idle().report = report;
        }
    }
}

impl Drop for Lease {
    fn drop(&mut self) {
        let mut idle = self.engines.idle();
        self.leased.store(false, Ordering::Relaxed);
        if let Some(engine) = self.engine.take() {
            engine.stop.store(false, Ordering::Relaxed);
            idle.engines.push(engine);
        }
    }
}

/// Ends the search of one lease.
pub(crate) struct Stopper {
    engines: Arc<Engines>,
    leased: Arc<AtomicBool>,
    stop: Arc<AtomicBool>,
}

impl Stopper {
    /// Ends the search, unless it has ended; one that the engine does for somebody else goes on.
    pub(crate) fn stop(&self) {
        // Under this lock leases end.
        let _idle = self.engines.idle();
        if self.leased.load(Ordering::Relaxed) {
            self.stop.store(true, Ordering::Relaxed);
        }
    }
}
