use std::fmt::Debug;

use lazygrid_host::{HostBackend, PairFinder, SearchBackend};

use crate::report::Report;

pub(crate) trait DetectorBackend: SearchBackend + Debug + Send + Sync {
    fn report(&self) -> Report;

    fn memory_for(&self, spheres: u64, is_f64: bool) -> u64;
}

impl DetectorBackend for HostBackend {
    fn report(&self) -> Report {
        self.report().into()
    }

    fn memory_for(&self, spheres: u64, is_f64: bool) -> u64 {
        self.memory_for(spheres, is_f64)
    }
}

pub(crate) type BackendFinder = PairFinder<Box<dyn DetectorBackend>>;
