use std::collections::HashMap;
use std::fmt;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use super::pipelines::Pipelines;
use super::recording::constant_buffer;
use crate::Error;

/// A GPU, or a software rasteriser, that can run the engine.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct AdapterSummary {
    /// The adapter's name.
    pub name: String,
    /// The driver and its version.
    pub driver: String,
    /// The API it is reached by, such as `vulkan`.
    pub api: String,
    /// `true` for hardware; `Backend::Auto` never chooses a software rasterizer.
    pub is_hardware: bool,
    /// `true` for a GPU that shares the memory of the CPU.
    pub is_integrated: bool,
    /// Smallest and largest subgroup.
    pub subgroup_sizes: [u32; 2],
    /// `true` if the adapter offers subgroup operations.
    pub has_subgroups: bool,
    /// `true` if the adapter offers timestamp queries.
    pub has_timestamps: bool,
    /// Bytes of the largest storage binding.
    pub storage_binding: u64,
    /// Bytes of the largest buffer.
    pub buffer: u64,
    /// Bytes of memory that a workgroup shares.
    pub workgroup_memory: u32,
    /// Workgroups per dimension of a dispatch.
    pub groups_per_dimension: u32,
}

/// Every adapter that wgpu finds here, hardware first.
pub fn adapters() -> Vec<AdapterSummary> {
    enumerate().iter().map(summary).collect()
}

/// Names one of several adapters. As text an index is a number; everything else is a name.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum AdapterId {
    /// Its place among [`adapters`], from 0 on; `lazygrid devices` lists them.
    Index(usize),
    /// Its name or a part of it that no other adapter has, in upper or lower case.
    Name(String),
}

impl From<usize> for AdapterId {
    fn from(index: usize) -> Self {
        Self::Index(index)
    }
}

impl From<&str> for AdapterId {
    fn from(text: &str) -> Self {
        text.parse().map_or_else(|_| Self::Name(text.to_owned()), Self::Index)
    }
}

impl fmt::Display for AdapterId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Index(index) => write!(f, "{index}"),
            Self::Name(name) => f.write_str(name),
        }
    }
}

impl AdapterId {
    /// The place among the adapters that there are.
    ///
    /// # Errors
    /// [`Error::UnknownAdapter`] where no adapter is meant, or several are.
    pub fn place_in(&self, found: &[AdapterSummary]) -> Result<usize, Error> {
        let named = |fits: &dyn Fn(&str) -> bool| -> Vec<usize> {
            (0..found.len()).filter(|&place| fits(&found[place].name.to_lowercase())).collect()
        };
        let fitting = match self {
            Self::Index(index) => (*index..found.len()).take(1).collect(),
            Self::Name(name) => {
                let name = name.to_lowercase();
                // One whole name may be a part of another.
                match named(&|other| other == name) {
                    whole if whole.len() == 1 => whole,
                    _ => named(&|other| other.contains(&name)),
                }
            }
        };
        if let [place] = fitting[..] {
            return Ok(place);
        }
        let one = |place: usize| format!("{place} {} ({})", found[place].name, found[place].api);
        let there_are = (0..found.len()).map(one).collect::<Vec<_>>().join(", ");
        Err(Error::UnknownAdapter { asked: self.to_string(), fitting: fitting.len(), there_are })
    }
}

/// The request for a shared device.
#[derive(Debug, PartialEq, Eq, Hash)]
enum Shared {
    Best { software: bool },
    Named(AdapterId),
}

/// A device, our own or a host application's, and what it runs on.
#[derive(Clone, Debug)]
pub struct GpuDevice {
    /// The device.
    pub device: wgpu::Device,
    /// Its queue.
    pub queue: wgpu::Queue,
    /// The adapter of the device.
    pub adapter: AdapterSummary,
    /// Kernels compiled for it so far.
    pub(crate) pipelines: Pipelines,
    lost: Arc<OnceLock<String>>,
}

impl GpuDevice {
    /// Opens the best adapter: a discrete GPU before an integrated one, and hardware before software, which is
    /// taken only where `software` allows it.
    ///
    /// # Errors
    /// [`Error::NoAdapter`] and [`Error::NoDevice`].
    pub fn open(software: bool) -> Result<Self, Error> {
        let found = enumerate();
        let names = || match found.as_slice() {
            [] => "none is installed".to_owned(),
            some => some.iter().map(|a| a.get_info().name).collect::<Vec<_>>().join(", ") + " is software",
        };
        match found.iter().find(|adapter| software || summary(adapter).is_hardware) {
            Some(adapter) => Self::open_on(adapter),
            None => Err(Error::NoAdapter { reason: names() }),
        }
    }

    /// Opens this adapter, be it hardware or software.
    ///
    /// # Errors
    /// [`Error::UnknownAdapter`] where no adapter is meant, or several are; [`Error::NoAdapter`] if there is
    /// none at all, and [`Error::NoDevice`].
    pub fn open_adapter(id: &AdapterId) -> Result<Self, Error> {
        let found = enumerate();
        if found.is_empty() {
            return Err(Error::NoAdapter { reason: "none is installed".to_owned() });
        }
        let summaries: Vec<_> = found.iter().map(summary).collect();
        Self::open_on(&found[id.place_in(&summaries)?])
    }

    fn open_on(adapter: &wgpu::Adapter) -> Result<Self, Error> {
        let summary = summary(adapter);
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("lazygrid"),
            required_features: adapter.features() & wanted_features(),
            required_limits: adapter.limits(),
            ..Default::default()
        };
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor))
            .map_err(|error| Error::NoDevice { adapter: summary.name.clone(), reason: error.to_string() })?;
        let lost = Arc::new(OnceLock::new());
        let losing = Arc::clone(&lost);
        device.set_device_lost_callback(move |reason, message| {
            // The first reason is the one that counts.
            let _ = losing.set(format!("{reason:?}: {message}"));
        });
        log::info!("GPU adapter: {} ({}, {})", summary.name, summary.api, summary.driver);
        let pipelines = Pipelines::new(&device);
        Ok(Self { device, queue, adapter: summary, pipelines, lost })
    }
}

impl GpuDevice {
    /// A host application's device. Its handlers are left alone.
    pub fn lent(device: &wgpu::Device, queue: &wgpu::Queue) -> Self {
        Self {
            adapter: summarize(device.adapter_info(), &device.limits(), device.features()),
            pipelines: Pipelines::new(device),
            device: device.clone(),
            queue: queue.clone(),
            lost: Arc::default(),
        }
    }

    /// The same as [`open`](Self::open), but one device for the whole process, with its compiled kernels, until it is
    /// lost. That there is no adapter is looked up once.
    ///
    /// # Errors
    /// The same as [`open`](Self::open).
    pub fn shared(software: bool) -> Result<Self, Error> {
        Self::share(Shared::Best { software }, || Self::open(software))
    }

    /// The same as [`open_adapter`](Self::open_adapter), but one device for the whole process, as [`shared`](Self::shared) has
    /// it.
    ///
    /// # Errors
    /// The same as [`open_adapter`](Self::open_adapter).
    pub fn shared_adapter(id: &AdapterId) -> Result<Self, Error> {
        Self::share(Shared::Named(id.clone()), || Self::open_adapter(id))
    }

    fn share(which: Shared, open: impl FnOnce() -> Result<Self, Error>) -> Result<Self, Error> {
        type Devices = HashMap<Shared, Result<GpuDevice, Error>>;
        static DEVICES: Mutex<Option<Devices>> = Mutex::new(None);
        let mut devices = DEVICES.lock().unwrap_or_else(PoisonError::into_inner);
        let devices = devices.get_or_insert_default();
        match devices.get(&which) {
            Some(Ok(own)) if own.probe().is_ok() => return Ok(own.clone()),
            Some(Err(error @ Error::NoAdapter { .. })) => return Err(error.clone()),
            _ => {}
        }
        let opened = open();
        devices.insert(which, opened.clone());
        opened
    }

    /// # Errors
    /// [`Error::DeviceLost`] once the driver has said so.
    pub(crate) fn check_lost(&self) -> Result<(), Error> {
        match self.lost.get() {
            Some(reason) => Err(Error::DeviceLost { reason: reason.clone() }),
            None => Ok(()),
        }
    }

    /// The reason behind an error: on a lost device calls are refused for other reasons first.
    pub(crate) fn reason(&self, error: Error) -> Error {
        self.probe().err().unwrap_or(error)
    }

    /// Whether the device still works. That it was lost is told late, and to a host application only for its own
    /// device; but then it refuses even a small buffer.
    pub(crate) fn probe(&self) -> Result<(), Error> {
        // A poll is what brings the news; its own failure adds nothing.
        let _ = self.device.poll(wgpu::PollType::Poll);
        self.check_lost()?;
        match constant_buffer(&self.device, "a probe", &[0; 16]) {
            Ok(_) | Err(Error::DeviceOutOfMemory { .. }) => Ok(()),
            Err(error) => Err(Error::DeviceLost { reason: error.to_string() }),
        }
    }
}

/// The device of this process's tests; none if there is no adapter and none is required.
#[cfg(test)]
pub(crate) fn device_or_skip() -> Option<GpuDevice> {
    match GpuDevice::shared(true) {
        Err(Error::NoAdapter { .. }) if std::env::var_os("LAZYGRID_REQUIRE_GPU").is_none() => None,
        own => Some(own.expect("a device")),
    }
}

/// Features that are used where they are offered. A host application does well to request them for its device,
/// together with the adapter's own limits; none is required.
pub fn wanted_features() -> wgpu::Features {
    wgpu::Features::SUBGROUP | wgpu::Features::TIMESTAMP_QUERY
}

fn enumerate() -> Vec<wgpu::Adapter> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let mut found = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::PRIMARY));
    let compute = wgpu::DownlevelFlags::COMPUTE_SHADERS;
    found.retain(|adapter| adapter.get_downlevel_capabilities().flags.contains(compute));
    found.sort_by_key(|adapter| match adapter.get_info().device_type {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    });
    found
}

fn summary(adapter: &wgpu::Adapter) -> AdapterSummary {
    summarize(adapter.get_info(), &adapter.limits(), adapter.features())
}

fn summarize(info: wgpu::AdapterInfo, limits: &wgpu::Limits, features: wgpu::Features) -> AdapterSummary {
    AdapterSummary {
        driver: format!("{} {}", info.driver, info.driver_info).trim().to_owned(),
        api: info.backend.to_string(),
        is_hardware: info.device_type != wgpu::DeviceType::Cpu,
        is_integrated: info.device_type == wgpu::DeviceType::IntegratedGpu,
        subgroup_sizes: [info.subgroup_min_size, info.subgroup_max_size],
        has_subgroups: features.contains(wgpu::Features::SUBGROUP),
        has_timestamps: features.contains(wgpu::Features::TIMESTAMP_QUERY),
        storage_binding: limits.max_storage_buffer_binding_size,
        buffer: limits.max_buffer_size,
        workgroup_memory: limits.max_compute_workgroup_storage_size,
        groups_per_dimension: limits.max_compute_workgroups_per_dimension,
        name: info.name,
    }
}

/// A graphics card of this name, for tests.
#[cfg(test)]
pub(crate) fn card(name: &str) -> AdapterSummary {
    AdapterSummary {
        name: name.to_owned(),
        driver: "driver 1".to_owned(),
        api: "vulkan".to_owned(),
        is_hardware: true,
        is_integrated: false,
        subgroup_sizes: [32; 2],
        has_subgroups: true,
        has_timestamps: true,
        storage_binding: 1 << 31,
        buffer: 1 << 31,
        workgroup_memory: 48 << 10,
        groups_per_dimension: 65_535,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn adapters_go_by_index_or_by_a_name_that_only_one_has() {
        let found = ["Card H1", "Card H1 Large", "Small Card", "llvmpipe (LLVM 15)", "llvmpipe"].map(card);
        for (asked, expected) in [
            ("0", Ok(0)),
            ("4", Ok(4)),
            ("small", Ok(2)),
            ("LARGE", Ok(1)),
            // The whole name of one, and a part of another.
            ("card h1", Ok(0)),
            ("llvmpipe", Ok(4)),
            ("LLVM 15", Ok(3)),
            ("card", Err(3)),
            ("h1", Err(2)),
            ("5", Err(0)),
            ("18446744073709551615", Err(0)),
            ("-1", Err(0)),
            ("radeon", Err(0)),
            ("", Err(5)),
        ] {
            match (AdapterId::from(asked).place_in(&found), expected) {
                (Ok(place), Ok(expected)) => assert_eq!(place, expected, "{asked}"),
                (Err(error), Err(how_many)) => {
                    let text = error.to_string();
                    assert!(
                        matches!(error, Error::UnknownAdapter { fitting, .. } if fitting == how_many),
                        "{asked}: {text}"
                    );
                    assert!(text.contains(asked) && text.contains("1 Card H1 Large (vulkan)"), "{text}");
                }
                (found, expected) => panic!("{asked}: {found:?} instead of {expected:?}"),
            }
        }
        // Two cards of one kind have but their indices.
        let twins = ["Card", "Card"].map(card);
        assert!(AdapterId::from("card").place_in(&twins).is_err());
        assert_eq!(AdapterId::from(1).place_in(&twins), Ok(1));
    }
}
