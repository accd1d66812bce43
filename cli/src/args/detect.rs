use std::num::NonZeroUsize;

use lazygrid::gpu::{GpuDevice, SoftwareAdapter};
use lazygrid::{Algorithm, Backend, Config, Order, Space};
use lazygrid_io::arguments::radii_by_species;
use lazygrid_io::read::Options;
use lazygrid_io::write::{Output, TableFormat};

use super::{Detect, FRAME, STANDARD};
use crate::calibration_file;
use crate::error::CliError;

impl Detect {
    pub(crate) fn options(&self) -> Result<Options, CliError> {
        Ok(Options {
            format: self.format,
            radii: radii_by_species(&self.radii).map_err(CliError::RadiusTwice)?,
            space: self.space()?,
            ids: self.ids,
            groups: self.exclude_groups,
            precision: self.precision,
        })
    }

    fn space(&self) -> Result<Option<Space>, CliError> {
        let (Some(space), Some([xy, xz, yz])) = (self.periodic, self.tilt) else { return Ok(self.periodic) };
        let [x, y, z] = space.lengths();
        let of_unbounded = [("xy", xy, "y", y), ("xz", xz, "z", z), ("yz", yz, "z", z)]
            .into_iter()
            .find(|(_, tilt, _, length)| *tilt != 0.0 && length.is_none());
        if let Some((name, tilt, axis, _)) = of_unbounded {
            return Err(CliError::TiltOfUnboundedAxis { name, tilt, axis });
        }
        let vectors = [x.map(|x| [x, 0.0, 0.0]), y.map(|y| [xy, y, 0.0]), z.map(|z| [xz, yz, z])];
        let triclinic = Space::triclinic(vectors);
        triclinic.map(Some).map_err(|error| CliError::Setting(error.into()))
    }

    pub(crate) fn output(&self) -> Result<Option<Output>, CliError> {
        let Some(path) = &self.output else { return Ok(None) };
        if path.to_str().is_none() && path.to_string_lossy().contains(FRAME) {
            return Err(CliError::NumberedName { path: path.clone() });
        }
        let to_stdout = [STANDARD, "/dev/stdout"].iter().any(|name| path.as_os_str() == *name);
        let by_name = if to_stdout { Some(TableFormat::Csv) } else { TableFormat::from_extension(path) };
        let format = self.output_format.or(by_name);
        let format = format.ok_or_else(|| CliError::OutputFormat { path: path.clone() })?;
        if to_stdout && self.neighbors && format == TableFormat::Npy {
            return Err(CliError::NeighborsToStdout);
        }
        Ok(Some(Output { path: (!to_stdout).then(|| path.clone()), format }))
    }

    pub(crate) fn is_on_gpu(&self) -> bool {
        let runs_on_cpu = self.algorithm == Algorithm::Auto || Algorithm::CPU.contains(&self.algorithm);
        match self.backend {
            Backend::Cpu => false,
            Backend::Gpu => true,
            _ => self.adapter.is_some() || !runs_on_cpu,
        }
    }

    pub(crate) fn has_software_adapter(&self) -> Result<bool, CliError> {
        if !self.is_on_gpu() {
            return Ok(false);
        }
        let gpu = match &self.adapter {
            Some(adapter) => GpuDevice::shared_adapter(adapter),
            None => GpuDevice::shared(SoftwareAdapter::Allow),
        };
        gpu.map(|gpu| !gpu.adapter.is_hardware).map_err(CliError::Setting)
    }

    pub(crate) fn config(&self) -> Result<Config, CliError> {
        if self.backend == Backend::Cpu && self.timeout.is_some() {
            return Err(CliError::TimeoutOnCpu);
        }
        let order = if self.unordered { Order::Unordered } else { Order::Canonical };
        let config = Config::default().backend(self.backend).algorithm(self.algorithm).order(order);
        let config = with(config, self.adapter.clone(), Config::adapter);
        let config =
            if self.backend == Backend::Cpu { config } else { config.calibration(calibration_file::load()) };
        let config = with(config, self.tau, Config::tau);
        let config = with(config, self.cell_ratio, Config::cell_ratio);
        let config = with(config, self.skin, Config::skin);
        let config = with(config, self.threads.map(NonZeroUsize::get), Config::threads);
        let config = with(config, self.timeout, Config::timeout);
        Ok(with(config, self.max_pairs, Config::max_pairs))
    }
}

fn with<T>(config: Config, value: Option<T>, set: impl FnOnce(Config, T) -> Config) -> Config {
    match value {
        Some(value) => set(config, value),
        None => config,
    }
}
