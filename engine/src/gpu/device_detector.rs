use std::ops::ControlFlow;
use std::time::Instant;

use lazygrid_host::{Canonical, Kept, Lists, Neighbors, Order, Phase, Settings, Skin, Survey};
use lazygrid_kernels::{Pair, Spheres};

use super::{Crossover, GpuDevice, GpuSession, GpuSettings, Ticket};
use crate::{Backend, Config, Error, Report, choice};

/// Parts in which the threads that order a list share it out.
const PARTS: usize = 128;

/// The GPU side of a `Detector`: checks and chooses like the CPU path, works in a session, and orders on the host.
#[derive(Debug)]
pub(crate) struct DeviceDetector {
    session: GpuSession,
    settings: Settings,
    crossover: (Crossover, &'static str),
    canonical: Canonical,
    lists: Lists,
    pairs: Vec<Pair>,
    report: Report,
}

impl DeviceDetector {
    pub(crate) fn new(own: GpuDevice, config: Config) -> Result<Self, Error> {
        let settings = config.settings;
        let crossover = choice::crossover(&config.calibrations, &own.adapter);
        let ratio = raster_ratio(config.raster_ratio)?;
        let gpu = GpuSettings {
            algorithm: settings.algorithm,
            crossover: crossover.0,
            raster_ratio: ratio,
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
            reason: String::new(),
            cost: None,
            candidates: None,
            phases: Vec::new(),
        };
        let mut session = GpuSession::new(own, gpu)?;
        if let Skin::Fixed(distance) = settings.skin {
            session.set_skin(Some(distance))?;
        }
        if let Some(timeout) = config.timeout {
            session.set_timeout(timeout);
        }
        let (canonical, lists, pairs) = Default::default();
        Ok(Self { session, settings, crossover, canonical, lists, pairs, report })
    }

    pub(crate) fn pairs(&mut self, spheres: Spheres<'_>) -> Result<&[Pair], Error> {
        self.list(spheres, self.settings.order)?;
        Ok(&self.pairs)
    }

    pub(crate) fn neighbors(&mut self, spheres: Spheres<'_>) -> Result<Neighbors<'_>, Error> {
        self.list(spheres, Order::Canonical)?;
        let start = Instant::now();
        let neighbors = self.lists.fill(&self.pairs, spheres.len())?;
        self.report.phases.push(Phase { name: "neighbors", time: start.elapsed() });
        Ok(neighbors)
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
        let Self { session, settings, canonical, pairs: ordered, .. } = self;
        let (mut handed, mut refused) = (0, None);
        session.finish_in_parts(ticket, |pairs| {
            if settings.order == Order::Canonical {
                refused = canonical.order(&parts(pairs), spheres.len(), ordered).err();
                std::mem::swap(pairs, ordered);
            }
            if refused.is_some() {
                return ControlFlow::Break(());
            }
            for part in pairs.chunks(chunk.max(1)) {
                handed += part.len() as u64;
                consume(part)?;
            }
            ControlFlow::Continue(())
        })?;
        self.conclude(handed);
        refused.map_or(Ok(handed), Err)
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
        let found = self.session.finish(ticket, self.settings.max_pairs)?;
        let (start, count) = (Instant::now(), found.len() as u64);
        if order == Order::Canonical {
            self.canonical.order(&parts(found), spheres.len(), &mut self.pairs)?;
        } else {
            self.session.swap_pairs(&mut self.pairs);
        }
        let ordering = start.elapsed();
        self.conclude(count);
        if order == Order::Canonical {
            self.report.phases.push(Phase { name: "order", time: ordering });
        }
        Ok(())
    }

    fn begin(&mut self, spheres: Spheres<'_>) -> Result<Ticket, Error> {
        self.report.phases.clear();
        self.report.spheres = spheres.len() as u64;
        self.report.pairs = 0;
        self.report.cost = None;
        self.report.candidates = None;
        let start = Instant::now();
        let survey = Survey::new(spheres, self.settings.interactions.as_ref())?;
        self.report.phases.push(Phase { name: "check", time: start.elapsed() });
        // Below 2³² by the survey.
        let load = (spheres.len() as u32, survey.occupied().count());
        let (algorithm, reason) = choice::algorithm(self.settings.algorithm, load, self.crossover);
        log::debug!("{reason}");
        self.report.algorithm = algorithm;
        self.report.reason = reason;
        let start = Instant::now();
        let ticket = self.session.begin_with(algorithm, spheres)?;
        self.report.phases.push(Phase { name: "upload", time: start.elapsed() });
        Ok(ticket)
    }

    fn conclude(&mut self, found: u64) {
        self.report.pairs = found;
        self.report.cost = self.session.cost();
        let ran = self.session.algorithm();
        if ran != self.report.algorithm {
            let instead = choice::one_level(ran, self.report.algorithm);
            log::info!("{instead}");
            self.report.algorithm = ran;
            self.report.reason += &format!("; {instead}");
        }
        self.report.candidates = self.session.kept();
        if let Some(Kept { count, age, rebuilt, .. }) = self.report.candidates {
            self.report.reason += &match rebuilt {
                None => format!("; {count} candidates of {age} calls ago"),
                Some(why) => format!("; {count} candidates were found: {why}"),
            };
        }
        self.report.phases.extend_from_slice(self.session.timings());
    }
}

/// The raster ratio that was `asked` for, as near as the GPU comes to it.
fn raster_ratio(asked: Option<f32>) -> Result<f32, Error> {
    let ratio = asked.unwrap_or(GpuSettings::RASTER_RATIO);
    if Config::RASTER_RATIOS.contains(&ratio) {
        return Ok(ratio.max(GpuSettings::MIN_RASTER_RATIO));
    }
    let range = "choose between 0.5 and 16";
    Err(Error::Setting { name: "raster_ratio", value: ratio.to_string(), range })
}

fn parts(pairs: &[Pair]) -> Vec<&[Pair]> {
    pairs.chunks(pairs.len().div_ceil(PARTS).max(1)).collect()
}

#[cfg(test)]
mod tests {
    use lazygrid_kernels::{Algorithm, Sphere};

    use super::*;
    use crate::gpu::adapter::device_or_skip;
    use crate::gpu::wgpu;

    /// Twenty sizes at one point, on a device that can bind a tenth of their entries.
    #[test]
    fn a_report_says_why_one_level_had_to_do() {
        let Some(own) = device_or_skip() else { return };
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
        let adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::PRIMARY));
        let adapter = adapters.into_iter().find(|a| a.get_info().name == own.adapter.name).expect("the same");
        // Room for the default output of 2²⁰ pairs, and for 2²¹ entries.
        let limits = wgpu::Limits { max_storage_buffer_binding_size: 8 << 20, ..adapter.limits() };
        let descriptor = wgpu::DeviceDescriptor { required_limits: limits, ..Default::default() };
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor)).expect("a device");
        let spheres: Vec<_> = (0..26_000).map(|k| Sphere::new([0.0; 3], 0.5_f32.powi(k % 20))).collect();
        let config = Config::default().backend(Backend::Gpu).algorithm(Algorithm::LazyGrid);
        let mut detector = DeviceDetector::new(GpuDevice::lent(&device, &queue), config).expect("made");
        assert_eq!(detector.count(Spheres::from(&spheres)), Ok(26_000 * 25_999 / 2));
        let report = detector.report();
        assert_eq!(report.algorithm, Algorithm::ArrayGrid);
        assert!(report.reason.contains("array-grid instead of lazy-grid: the entries"), "{}", report.reason);
    }
}
