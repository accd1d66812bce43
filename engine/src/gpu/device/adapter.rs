use std::fmt;

use crate::Error;

/// A GPU or a software rasterizer.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct AdapterSummary {
    /// Adapter's name.
    pub name: String,
    /// Driver and its version.
    pub driver: String,
    /// API, such as `vulkan`.
    pub api: String,
    /// `false` for a software rasterizer.
    pub is_hardware: bool,
    /// `true` for a GPU that shares the CPU's memory.
    pub is_integrated: bool,
    /// Smallest and largest subgroup size.
    pub subgroup_sizes: [u32; 2],
    /// Support of subgroup operations.
    pub has_subgroups: bool,
    /// Support of timestamp queries.
    pub has_timestamps: bool,
    /// Bytes of the largest storage binding.
    pub storage_binding: u64,
    /// Bytes of the largest buffer.
    pub buffer: u64,
    /// Bytes of memory per workgroup.
    pub workgroup_memory: u32,
    /// Workgroups per dimension of a dispatch.
    pub groups_per_dimension: u32,
}

/// Returns every adapter that wgpu finds, hardware first.
pub fn adapters() -> Vec<AdapterSummary> {
    enumerate().iter().map(summary).collect()
}

/// The index or name of an adapter. Text that is a number is an index.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum AdapterId {
    /// Index among [`adapters`], starting at 0; `lazygrid devices` lists them.
    Index(usize),
    /// Name, or a part that no other adapter's name has, ignoring case.
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
    /// Returns the index in `found`.
    ///
    /// # Errors
    /// [`Error::UnknownAdapter`] if no adapter or several match.
    pub fn index_in(&self, found: &[AdapterSummary]) -> Result<usize, Error> {
        let named = |fits: &dyn Fn(&str) -> bool| -> Vec<usize> {
            (0..found.len()).filter(|&index| fits(&found[index].name.to_lowercase())).collect()
        };
        let matches = match self {
            Self::Index(index) => (*index..found.len()).take(1).collect(),
            Self::Name(name) => {
                let name = name.to_lowercase();
                // A whole name may be a part of another name.
                match named(&|other| other == name) {
                    whole if whole.len() == 1 => whole,
                    _ => named(&|other| other.contains(&name)),
                }
            }
        };
        // One GPU may be found once per API, the preferred one first.
        let is_one_gpu = |indices: &[usize]| {
            let apis: Vec<&str> = indices.iter().map(|&index| &*found[index].api).collect();
            let is_repeated = |(k, api): (usize, &&str)| apis[..k].contains(api);
            indices.iter().all(|&index| found[index].name == found[indices[0]].name)
                && !apis.iter().enumerate().any(is_repeated)
        };
        // A blank is a part of every name, also of an only one.
        let is_blank = matches!(self, Self::Name(name) if name.trim().is_empty());
        if let Some(&index) = matches.first().filter(|_| is_one_gpu(&matches) && !is_blank) {
            return Ok(index);
        }
        let one = |index: usize| format!("{index} {} ({})", found[index].name, found[index].api);
        let available = (0..found.len()).map(one).collect::<Vec<_>>().join(", ");
        Err(Error::UnknownAdapter { requested: self.to_string(), matches: matches.len(), available })
    }
}

/// Returns the features that host applications should request if present, with the adapter's limits.
pub fn optional_features() -> wgpu::Features {
    wgpu::Features::SUBGROUP | wgpu::Features::TIMESTAMP_QUERY | wgpu::Features::TIMESTAMP_QUERY_INSIDE_PASSES
}

/// Omits two default flags.
///
/// - Debugging information of shaders, for which naga counts the lines before each instruction: most of the time of
///   compiling a kernel.
/// - Validation of indirect dispatches, a dispatch each: kernels write at most 65,535 workgroups. Windows keeps it,
///   because DirectX 12 has `num_workgroups` of validated dispatches only.
fn instance_flags() -> wgpu::InstanceFlags {
    let omitted = match cfg!(windows) {
        true => wgpu::InstanceFlags::DEBUG,
        false => wgpu::InstanceFlags::DEBUG | wgpu::InstanceFlags::VALIDATION_INDIRECT_CALL,
    };
    wgpu::InstanceFlags::default().difference(omitted).with_env()
}

pub(super) fn enumerate() -> Vec<wgpu::Adapter> {
    let descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor { flags: instance_flags(), ..descriptor });
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

pub(super) fn summary(adapter: &wgpu::Adapter) -> AdapterSummary {
    summarize(adapter.get_info(), &adapter.limits(), adapter.features())
}

pub(super) fn summarize(
    info: wgpu::AdapterInfo,
    limits: &wgpu::Limits,
    features: wgpu::Features,
) -> AdapterSummary {
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
    fn adapter_is_found_by_index_or_unique_name() {
        let found = ["Card H1", "Card H1 Large", "Small Card", "llvmpipe (LLVM 15)", "llvmpipe"].map(card);
        for (requested, expected) in [
            ("0", Ok(0)),
            ("4", Ok(4)),
            ("small", Ok(2)),
            ("LARGE", Ok(1)),
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
            match (AdapterId::from(requested).index_in(&found), expected) {
                (Ok(index), Ok(expected)) => assert_eq!(index, expected, "{requested}"),
                (Err(error), Err(how_many)) => {
                    let text = error.to_string();
                    assert!(
                        matches!(error, Error::UnknownAdapter { matches, .. } if matches == how_many),
                        "{requested}: {text}"
                    );
                    assert!(text.contains(requested) && text.contains("1 Card H1 Large (vulkan)"), "{text}");
                }
                (found, expected) => panic!("{requested}: {found:?} instead of {expected:?}"),
            }
        }
        for blank in ["", " "] {
            assert!(AdapterId::from(blank).index_in(&[card("Card 1")]).is_err(), "'{blank}'");
        }
        let twins = ["Card", "Card"].map(card);
        assert!(AdapterId::from("card").index_in(&twins).is_err());
        assert_eq!(AdapterId::from(1).index_in(&twins), Ok(1));
        let by_two_apis =
            ["vulkan", "dx12"].map(|api| AdapterSummary { api: api.to_owned(), ..card("Card") });
        assert_eq!(AdapterId::from("card").index_in(&by_two_apis), Ok(0));
    }
}
