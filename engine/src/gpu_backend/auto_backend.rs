use std::sync::Arc;

use lazygrid_host::{HostBackend, PhaseTime, SearchBackend, Settings, Team, Work};
use lazygrid_kernels::Query;

use super::GpuBackend;
use crate::backend::DetectorBackend;
use crate::config::Config;
use crate::gpu::device::GpuDevice;
use crate::report::Report;
use crate::{Backend, Error, choice};

#[derive(Debug)]
pub(crate) struct AutoBackend {
    host: HostBackend,
    device: GpuBackend,
    choice_and_reason: (Backend, String),
}

impl AutoBackend {
    pub(crate) fn new(gpu: GpuDevice, config: Config) -> Result<Self, Error> {
        let host = HostBackend::new(config.settings.clone())?;
        let device = GpuBackend::on_team(gpu, config, Arc::clone(host.team()))?;
        Ok(Self { host, device, choice_and_reason: (Backend::Gpu, String::new()) })
    }

    fn last(&self) -> &dyn DetectorBackend {
        if self.choice_and_reason.0 == Backend::Cpu { &self.host } else { &self.device }
    }
}

impl DetectorBackend for AutoBackend {
    fn report(&self) -> Report {
        let mut report = self.last().report();
        report.prepend_reason(&self.choice_and_reason.1);
        report
    }

    fn memory_for(&self, spheres: u64, is_f64: bool) -> u64 {
        let on_host = self.host.memory_for(spheres.min(u64::from(self.device.profile.device_from)), is_f64);
        match choice::per_call(spheres, &self.device.profile).0 {
            Backend::Cpu => on_host,
            _ => on_host.saturating_add(self.device.memory_for(spheres, is_f64)),
        }
    }
}

impl SearchBackend for AutoBackend {
    fn settings(&self) -> &Settings {
        self.host.settings()
    }

    fn team(&self) -> &Arc<Team> {
        self.host.team()
    }

    fn report_mut(&mut self) -> (&mut u64, &mut Vec<PhaseTime>) {
        match self.choice_and_reason.0 {
            Backend::Cpu => self.host.report_mut(),
            _ => self.device.report_mut(),
        }
    }

    fn search(&mut self, query: &Query<'_>, work: Work<'_>) -> Result<(), Error> {
        self.choice_and_reason = choice::per_call(query.len() as u64, &self.device.profile);
        log::debug!("{}", self.choice_and_reason.1);
        match self.choice_and_reason.0 {
            Backend::Cpu => self.host.search(query, work),
            _ => self.device.search(query, work),
        }
    }
}

#[cfg(test)]
mod tests {
    use lazygrid_kernels::{Algorithm, Sphere};

    use super::*;
    use crate::backend::BackendFinder;
    use crate::gpu::costs::{Calibration, Crossover, SOFTWARE_SKIN_COSTS};
    use crate::gpu::device::SoftwareAdapter;

    #[test]
    fn calls_run_on_the_faster_backend() {
        let Ok(gpu) = GpuDevice::shared(SoftwareAdapter::Allow) else { return };
        let names = [&gpu.adapter.name, &gpu.adapter.driver, env!("CARGO_PKG_VERSION")].map(str::to_owned);
        let calibration = Calibration::new(names, Crossover::SOFTWARE, 1 << 19, SOFTWARE_SKIN_COSTS, 100);
        let backend =
            AutoBackend::new(gpu, Config::default().calibration([calibration])).expect("valid settings");
        let mut finder = BackendFinder::on(Box::new(backend));
        let spheres: Vec<Sphere> = (0..200).map(|k| Sphere::new([k as f32, 0.0, 0.0], 0.5)).collect();
        for (count, expected) in
            [(200, Backend::Gpu), (99, Backend::Cpu), (100, Backend::Gpu), (2, Backend::Cpu)]
        {
            assert_eq!(finder.count(&spheres[..count]), Ok(count as u64 - 1), "{count}");
            let report = finder.backend().report();
            assert_eq!((report.backend, report.spheres), (expected, count as u64), "{report:?}");
            assert_eq!(report.pairs, count as u64 - 1, "{report:?}");
            assert!(report.algorithm != Algorithm::Auto && report.reason.contains("100"), "{report:?}");
        }
        let [few, many] = [99, 100].map(|spheres| finder.backend().memory_for(spheres, false));
        assert!(0 < few && few < many, "{few}, {many}");
    }
}
