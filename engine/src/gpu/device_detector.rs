use std::ops::ControlFlow;
use std::time::Instant;

use lazygrid_host::{Neighbors, Order, Phase, Settings};
use lazygrid_kernels::{Pair, Spheres};
use rayon::slice::ParallelSliceMut;

use super::{GpuDevice, GpuError, GpuSession, GpuSettings};
use crate::{Backend, Config, Error, Report};

/// The GPU side of a `Detector`: checks like the CPU path, works in a session, and orders on the host.
#[derive(Debug)]
pub(crate) struct DeviceDetector {
    session: GpuSession,
    settings: Settings,
    pairs: Vec<Pair>,
    offsets: Vec<u64>,
    indices: Vec<u32>,
    report: Report,
    backend_reason: String,
}

impl DeviceDetector {
    pub(crate) fn new(own: GpuDevice, config: Config, reason: String) -> Result<Self, Error> {
        let settings = config.settings;
        let ratio = config.raster_ratio.unwrap_or(GpuSettings::RASTER_RATIO);
        let gpu = GpuSettings {
            algorithm: settings.algorithm,
            raster_ratio: ratio.max(GpuSettings::MIN_RASTER_RATIO),
            tau: config.tau.unwrap_or(GpuSettings::TAU),
            interactions: settings.interactions.clone(),
            space: settings.space,
            timed: true,
            ..GpuSettings::default()
        };
        let report = Report {
            spheres: 0,
            pairs: 0,
            backend: Backend::Gpu,
            adapter: Some(own.adapter.name.clone()),
            algorithm: settings.algorithm,
            reason: reason.clone(),
            phases: Vec::new(),
        };
        let session = GpuSession::new(own, gpu)?;
        let (pairs, offsets, indices) = Default::default();
        Ok(Self { session, settings, pairs, offsets, indices, report, backend_reason: reason })
    }

    pub(crate) fn pairs(&mut self, spheres: Spheres<'_>) -> Result<&[Pair], Error> {
        self.list(spheres, self.settings.order)?;
        Ok(&self.pairs)
    }

    pub(crate) fn neighbors(&mut self, spheres: Spheres<'_>) -> Result<Neighbors<'_>, Error> {
        self.list(spheres, Order::Canonical)?;
        let start = Instant::now();
        self.fill_lists(spheres.len());
        self.report.phases.push(Phase { name: "neighbors", time: start.elapsed() });
        Ok(Neighbors { offsets: &self.offsets, indices: &self.indices })
    }

    pub(crate) fn count(&mut self, spheres: Spheres<'_>) -> Result<u64, Error> {
        let ticket = self.begin(spheres)?;
        let found = self.session.finish_count(ticket)?;
        self.conclude(found);
        Ok(found)
    }

    pub(crate) fn stream(
        &mut self,
        spheres: Spheres<'_>,
        chunk: usize,
        mut consume: impl FnMut(&[Pair]) -> ControlFlow<()>,
    ) -> Result<u64, Error> {
        let ticket = self.begin(spheres)?;
        let order = self.settings.order;
        let mut handed = 0;
        self.session.finish_in_parts(ticket, |pairs| {
            if order == Order::Canonical {
                pairs.par_sort_unstable();
            }
            for part in pairs.chunks(chunk.max(1)) {
                handed += part.len() as u64;
                consume(part)?;
            }
            ControlFlow::Continue(())
        })?;
        self.conclude(handed);
        Ok(handed)
    }

    pub(crate) fn report(&self) -> &Report {
        &self.report
    }

    pub(crate) fn memory_for(&self, spheres: u64) -> u64 {
        // What cannot be held at all is refused when it is tried.
        u32::try_from(spheres).ok().and_then(|n| self.session.memory_for(n).ok()).unwrap_or(u64::MAX)
    }

    pub(crate) fn into_pairs(self) -> Vec<Pair> {
        self.pairs
    }

    fn list(&mut self, spheres: Spheres<'_>, order: Order) -> Result<(), Error> {
        let ticket = self.begin(spheres)?;
        self.session.finish(ticket, self.settings.max_pairs)?;
        self.session.swap_pairs(&mut self.pairs);
        self.conclude(self.pairs.len() as u64);
        if order == Order::Canonical {
            let start = Instant::now();
            self.pairs.par_sort_unstable();
            self.report.phases.push(Phase { name: "order", time: start.elapsed() });
        }
        Ok(())
    }

    fn begin(&mut self, spheres: Spheres<'_>) -> Result<super::Ticket, Error> {
        self.report.phases.clear();
        self.report.spheres = spheres.len() as u64;
        self.report.pairs = 0;
        let start = Instant::now();
        lazygrid_host::check_species(spheres, self.settings.interactions.as_ref())?;
        lazygrid_host::check(spheres)?;
        self.report.phases.push(Phase { name: "check", time: start.elapsed() });
        let start = Instant::now();
        let ticket = self.session.begin(spheres)?;
        self.report.phases.push(Phase { name: "upload", time: start.elapsed() });
        Ok(ticket)
    }

    fn conclude(&mut self, found: u64) {
        self.report.pairs = found;
        let algorithm = self.session.algorithm();
        let why = if self.settings.algorithm == algorithm { "asked for" } else { "by the number of spheres" };
        self.report.algorithm = algorithm;
        self.report.reason = format!("{}; {algorithm}: {why}", self.backend_reason);
        self.report.phases.extend_from_slice(self.session.timings());
    }

    /// As pairs come by `i`, then `j`, each sphere's list is ascending when those in which it comes second are
    /// written before those in which it comes first.
    fn fill_lists(&mut self, spheres: usize) {
        let Self { pairs, offsets, indices, .. } = self;
        offsets.clear();
        offsets.resize(spheres + 1, 0);
        for pair in pairs.iter() {
            offsets[pair.i as usize + 1] += 1;
            offsets[pair.j as usize + 1] += 1;
        }
        for k in 1..=spheres {
            offsets[k] += offsets[k - 1];
        }
        let mut next = offsets[..spheres].to_vec();
        indices.resize(2 * pairs.len(), 0);
        let mut put = |of: u32, other: u32| {
            indices[next[of as usize] as usize] = other;
            next[of as usize] += 1;
        };
        pairs.iter().for_each(|pair| put(pair.j, pair.i));
        pairs.iter().for_each(|pair| put(pair.i, pair.j));
    }
}

impl From<GpuError> for Error {
    fn from(error: GpuError) -> Self {
        match error {
            GpuError::TooManyPairs { found, limit } => {
                Self::Host(lazygrid_host::Error::TooManyPairs { found, limit })
            }
            other => Self::Gpu(other),
        }
    }
}
