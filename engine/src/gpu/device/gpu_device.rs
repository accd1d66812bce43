use std::collections::HashMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::Duration;

use lazygrid_kernels::kernel::{Access, Kernel, Variant};

use super::adapter::{AdapterId, AdapterSummary, enumerate, optional_features, summarize, summary};
use super::constant::constant_buffer;
use super::error_scope::with_error_scope;
use super::mapping;
use super::pipelines::{Pipeline, Pipelines};
use super::subgroup_probe;
use crate::Error;

/// The permission to open a software rasterizer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SoftwareAdapter {
    /// Opens a software rasterizer if no hardware is present.
    Allow,
    /// Opens hardware only.
    Refuse,
}

#[derive(Debug, PartialEq, Eq, Hash)]
enum SharedRequest {
    Best(SoftwareAdapter),
    Named(AdapterId),
}

/// A device with its adapter and compiled kernels.
#[derive(Clone, Debug)]
pub struct GpuDevice {
    /// Device.
    pub device: wgpu::Device,
    /// Its queue.
    pub queue: wgpu::Queue,
    /// Its adapter.
    pub adapter: AdapterSummary,
    pub(crate) pipelines: Pipelines,
    lost: Arc<OnceLock<String>>,
}

impl GpuDevice {
    /// Opens the best adapter: discrete before integrated, hardware before software.
    ///
    /// # Errors
    /// [`Error::NoAdapter`] and [`Error::NoDevice`].
    pub fn open(software: SoftwareAdapter) -> Result<Self, Error> {
        let found = enumerate();
        let names = || match found.as_slice() {
            [] => "none is installed".to_owned(),
            some => some.iter().map(|a| a.get_info().name).collect::<Vec<_>>().join(", ") + " is software",
        };
        match found.iter().find(|adapter| software == SoftwareAdapter::Allow || summary(adapter).is_hardware)
        {
            Some(adapter) => Self::open_on(adapter),
            None => Err(Error::NoAdapter { reason: names() }),
        }
    }

    /// Opens this adapter, also a software rasterizer.
    ///
    /// # Errors
    /// [`Error::UnknownAdapter`] if no adapter or several match; [`Error::NoAdapter`] if none exists;
    /// [`Error::NoDevice`].
    pub fn open_adapter(id: &AdapterId) -> Result<Self, Error> {
        let found = enumerate();
        if found.is_empty() {
            return Err(Error::NoAdapter { reason: "none is installed".to_owned() });
        }
        let summaries: Vec<_> = found.iter().map(summary).collect();
        Self::open_on(&found[id.index_in(&summaries)?])
    }

    fn open_on(adapter: &wgpu::Adapter) -> Result<Self, Error> {
        let summary = summary(adapter);
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("lazygrid"),
            required_features: adapter.features() & optional_features(),
            required_limits: adapter.limits(),
            ..Default::default()
        };
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor))
            .map_err(|error| Error::NoDevice { adapter: summary.name.clone(), reason: error.to_string() })?;
        let lost = Arc::new(OnceLock::new());
        let lost_reason = Arc::clone(&lost);
        device.set_device_lost_callback(move |reason, message| {
            let _ = lost_reason.set(format!("{reason:?}: {message}"));
        });
        log::info!("GPU adapter: {} ({}, {})", summary.name, summary.api, summary.driver);
        subgroup_probe::run_once(&device, &queue);
        let pipelines = Pipelines::new(&device);
        Ok(Self { device, queue, adapter: summary, pipelines, lost })
    }
}

impl GpuDevice {
    /// Wraps a host application's device without replacing its handlers. An adapter's first device runs a short
    /// subgroup probe.
    pub fn from_wgpu(device: &wgpu::Device, queue: &wgpu::Queue) -> Self {
        subgroup_probe::run_once(device, queue);
        Self {
            adapter: summarize(device.adapter_info(), &device.limits(), device.features()),
            pipelines: Pipelines::new(device),
            device: device.clone(),
            queue: queue.clone(),
            lost: Arc::default(),
        }
    }

    /// Returns the process's shared device, kept until it is lost. A missing adapter stays missing.
    ///
    /// # Errors
    /// See [`open`](Self::open).
    pub fn shared(software: SoftwareAdapter) -> Result<Self, Error> {
        Self::get_shared(SharedRequest::Best(software), || Self::open(software))
    }

    /// Returns the process's shared device for this adapter.
    ///
    /// # Errors
    /// See [`open_adapter`](Self::open_adapter).
    pub fn shared_adapter(id: &AdapterId) -> Result<Self, Error> {
        Self::get_shared(SharedRequest::Named(id.clone()), || Self::open_adapter(id))
    }

    fn get_shared(which: SharedRequest, open: impl FnOnce() -> Result<Self, Error>) -> Result<Self, Error> {
        type Devices = HashMap<SharedRequest, Result<GpuDevice, Error>>;
        static DEVICES: Mutex<Option<Devices>> = Mutex::new(None);
        let mut devices = DEVICES.lock().unwrap_or_else(PoisonError::into_inner);
        let devices = devices.get_or_insert_default();
        match devices.get(&which) {
            Some(Ok(gpu)) if gpu.probe().is_ok() => return Ok(gpu.clone()),
            Some(Err(error @ Error::NoAdapter { .. })) => return Err(error.clone()),
            _ => {}
        }
        let opened = open();
        devices.insert(which, opened.clone());
        opened
    }

    /// Polls the device, and returns an error if the driver reports a loss, for which wgpu panics.
    ///
    /// # Errors
    /// [`Error::Timeout`] and [`Error::DeviceLost`]; [`Error::DeviceRejected`] for another device's submission.
    pub fn poll(&self, until: wgpu::PollType) -> Result<(), Error> {
        mapping::poll(&self.device, until)
    }

    /// Waits for `submission`, or for the newest if it is `None`, and maps all of `buffer` for reading.
    ///
    /// # Errors
    /// [`Error::Timeout`], [`Error::DeviceLost`] and [`Error::DeviceRejected`].
    pub fn map_for_reading(
        &self,
        buffer: &wgpu::Buffer,
        submission: Option<wgpu::SubmissionIndex>,
        timeout: Duration,
    ) -> Result<wgpu::BufferView, Error> {
        mapping::map_for_reading(&self.device, buffer, submission, timeout)
            .map_err(|error| self.reason(error))
    }

    pub(crate) fn check_lost(&self) -> Result<(), Error> {
        match self.lost.get() {
            Some(reason) => Err(Error::DeviceLost { reason: reason.clone() }),
            None => Ok(()),
        }
    }

    /// Returns the cause of `error`: calls on a lost device fail with other errors at first.
    pub(crate) fn reason(&self, error: Error) -> Error {
        self.probe().err().unwrap_or(error)
    }

    /// Creates a small buffer, because the driver reports a loss late, and for a host application's device only to the
    /// application.
    pub(crate) fn probe(&self) -> Result<(), Error> {
        self.check_lost()?;
        // A poll delivers the report of a loss.
        self.poll(wgpu::PollType::Poll)?;
        self.check_lost()?;
        match constant_buffer(&self.device, "a probe", &[0; 16]) {
            Ok(_) | Err(Error::DeviceOutOfMemory { .. }) => Ok(()),
            Err(error) => Err(Error::DeviceLost { reason: error.to_string() }),
        }
    }
}

#[cfg(test)]
pub(crate) fn device_or_skip() -> Option<GpuDevice> {
    match GpuDevice::shared(SoftwareAdapter::Allow) {
        Err(Error::NoAdapter { .. }) if std::env::var_os("LAZYGRID_REQUIRE_GPU").is_none() => None,
        gpu => Some(gpu.expect("a device")),
    }
}

impl GpuDevice {
    /// Runs `work` in an error scope, and returns the device's error instead of panicking. Messages name `what` and
    /// `bytes`.
    ///
    /// # Errors
    /// [`Error::DeviceOutOfMemory`], [`Error::DeviceLost`] and [`Error::DeviceRejected`].
    pub fn with_error_scope<T>(
        &self,
        what: &'static str,
        bytes: u64,
        work: impl FnOnce() -> T,
    ) -> Result<T, Error> {
        with_error_scope(&self.device, what, bytes, work).map_err(|error| self.reason(error))
    }
}

impl GpuDevice {
    /// Returns a compiled kernel and its bind group layout.
    ///
    /// # Errors
    /// See [`with_error_scope`](Self::with_error_scope).
    pub fn kernel(
        &self,
        kernel: &'static Kernel,
        variant: Variant,
    ) -> Result<(wgpu::ComputePipeline, wgpu::BindGroupLayout), Error> {
        self.pipelines.get(kernel, variant).map(|Pipeline { pipeline, layout }| (pipeline, layout))
    }

    /// Returns the reason why kernels do not use subgroup operations, if the device has them.
    pub fn subgroup_refusal(&self) -> Option<&str> {
        self.pipelines.subgroup_refusal()
    }

    /// Rewrites WGSL for tests. `rewrite` must keep all loops, and the results up to rounding.
    #[doc(hidden)]
    #[must_use]
    pub fn with_rewritten_kernels(self, rewrite: fn(&str) -> String) -> Self {
        Self { pipelines: self.pipelines.rewritten(rewrite), ..self }
    }

    /// Compiles WGSL without wgpu's loop counters, and keeps each text: pass numbers that change in buffers. Returns
    /// the compute pipeline of entry point `name` and its bind group layout: group 0, bindings numbered from 0.
    ///
    /// # Errors
    /// See [`with_error_scope`](Self::with_error_scope).
    ///
    /// # Safety
    /// Each loop of `wgsl` must end.
    pub unsafe fn compile(
        &self,
        name: &'static str,
        bindings: impl IntoIterator<Item = Access>,
        wgsl: String,
    ) -> Result<(wgpu::ComputePipeline, wgpu::BindGroupLayout), Error> {
        // SAFETY: the caller promises that each loop ends.
        let compiled = unsafe { self.pipelines.by_text(name, bindings.into_iter().collect(), wgsl) };
        let Pipeline { pipeline, layout } = compiled.map_err(|error| self.reason(error))?;
        Ok((pipeline, layout))
    }
}
