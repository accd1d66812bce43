//! Compiles pipelines and reads the driver's statistics, which wgpu does not expose.

use std::ffi::{CStr, CString, c_char};

use ash::vk;
use ash::{ext, khr};
use lazygrid_kernels::kernel::Access;

use super::spirv::Target;
use super::{Number, Program, Statistic, Text};

pub(super) struct Compiler {
    device: ash::Device,
    instance: ash::Instance,
    executables: Option<khr::pipeline_executable_properties::Device>,
    stage: vk::PipelineShaderStageCreateFlags,
    pub(super) target: Target,
    // Keeps the library of the other fields' functions loaded.
    _entry: ash::Entry,
}

struct DeviceSupport {
    robustness: bool,
    executables: bool,
    varying_subgroups: bool,
}

impl Compiler {
    pub(super) fn open(name: &str, uses_subgroups: bool) -> Result<Self, String> {
        // SAFETY: this opens the Vulkan loader, whose initializers are safe to run.
        let entry = unsafe { ash::Entry::load() }.map_err(|e| format!("no Vulkan: {e}"))?;
        let application = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_3);
        let info = vk::InstanceCreateInfo::default().application_info(&application);
        // SAFETY: `info` and all it refers to outlive the call.
        let instance = unsafe { entry.create_instance(&info, None) }.map_err(failed("vkCreateInstance"))?;
        match Self::on(&instance, name, uses_subgroups) {
            Ok((device, target, executables, stage)) => {
                Ok(Self { device, instance, executables, stage, target, _entry: entry })
            }
            Err(reason) => {
                // SAFETY: no object was created from the instance, and it is not used any more.
                unsafe { instance.destroy_instance(None) };
                Err(reason)
            }
        }
    }

    fn on(instance: &ash::Instance, name: &str, uses_subgroups: bool) -> Result<OpenedDevice, String> {
        // SAFETY: the instance is alive.
        let found = unsafe { instance.enumerate_physical_devices() };
        let found = found.map_err(failed("vkEnumeratePhysicalDevices"))?;
        let named = found.into_iter().find_map(|device| {
            // SAFETY: the device comes from this instance, which is alive.
            let properties = unsafe { instance.get_physical_device_properties(device) };
            (characters(&properties.device_name) == name).then_some((device, properties.api_version))
        });
        let (physical, version) = named.ok_or_else(|| format!("Vulkan has no device {name}"))?;
        let version = (vk::api_version_major(version), vk::api_version_minor(version));
        let device_support = device_support(instance, physical, version)?;
        let device = device(instance, physical, &device_support)?;
        let executables = device_support
            .executables
            .then(|| khr::pipeline_executable_properties::Device::new(instance, &device));
        let stage = match uses_subgroups && device_support.varying_subgroups {
            true => vk::PipelineShaderStageCreateFlags::ALLOW_VARYING_SUBGROUP_SIZE,
            false => vk::PipelineShaderStageCreateFlags::empty(),
        };
        Ok((
            device,
            Target { vulkan: version, checks_buffers: device_support.robustness },
            executables,
            stage,
        ))
    }

    pub(super) fn compile(
        &self,
        name: &str,
        words: &[u32],
        bindings: impl Iterator<Item = Access>,
        with_texts: bool,
    ) -> Result<Vec<Program>, String> {
        let entry = CString::new(name).map_err(|e| e.to_string())?;
        let bindings: Vec<_> =
            (0..).zip(bindings).map(|(number, access)| described(number, access)).collect();
        let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
        let mut made =
            PipelineObjects { device: &self.device, module: None, set: None, layout: None, pipeline: None };
        // SAFETY: the device is alive and `info` outlives the call.
        let set = unsafe { self.device.create_descriptor_set_layout(&info, None) };
        let sets = [*made.set.insert(set.map_err(failed("vkCreateDescriptorSetLayout"))?)];
        let info = vk::PipelineLayoutCreateInfo::default().set_layouts(&sets);
        // SAFETY: as before, and the layout of the set is alive.
        let layout = unsafe { self.device.create_pipeline_layout(&info, None) };
        let layout = *made.layout.insert(layout.map_err(failed("vkCreatePipelineLayout"))?);
        let info = vk::ShaderModuleCreateInfo::default().code(words);
        // SAFETY: as before; naga generated the words from a validated module.
        let module = unsafe { self.device.create_shader_module(&info, None) };
        let module = *made.module.insert(module.map_err(failed("vkCreateShaderModule"))?);
        let stage = vk::PipelineShaderStageCreateInfo::default()
            .flags(self.stage)
            .stage(vk::ShaderStageFlags::COMPUTE)
            .module(module)
            .name(&entry);
        let info = vk::ComputePipelineCreateInfo::default()
            .flags(self.captured(with_texts))
            .layout(layout)
            .stage(stage);
        // SAFETY: as before; the layout has each binding of the module (`kernels/tests/reflection.rs`).
        let pipelines =
            unsafe { self.device.create_compute_pipelines(vk::PipelineCache::null(), &[info], None) };
        let pipelines = pipelines.map_err(|(_, result)| failed("vkCreateComputePipelines")(result))?;
        let pipeline = *made.pipeline.insert(pipelines[0]);
        match &self.executables {
            None => Ok(Vec::new()),
            Some(extension) => executables(extension, pipeline, with_texts),
        }
    }

    fn captured(&self, with_texts: bool) -> vk::PipelineCreateFlags {
        let mut captured = vk::PipelineCreateFlags::empty();
        if self.executables.is_some() {
            captured |= vk::PipelineCreateFlags::CAPTURE_STATISTICS_KHR;
            if with_texts {
                captured |= vk::PipelineCreateFlags::CAPTURE_INTERNAL_REPRESENTATIONS_KHR;
            }
        }
        captured
    }

    pub(super) fn has_statistics(&self) -> bool {
        self.executables.is_some()
    }
}

impl Drop for Compiler {
    fn drop(&mut self) {
        // SAFETY: all objects of the device are destroyed (each call drops its `PipelineObjects`), nothing was submitted,
        // and neither handle is used any more.
        unsafe {
            self.device.destroy_device(None);
            self.instance.destroy_instance(None);
        }
    }
}

type OpenedDevice = (
    ash::Device,
    Target,
    Option<khr::pipeline_executable_properties::Device>,
    vk::PipelineShaderStageCreateFlags,
);

fn device_support(
    instance: &ash::Instance,
    physical: vk::PhysicalDevice,
    version: (u32, u32),
) -> Result<DeviceSupport, String> {
    // SAFETY: the device comes from this instance, which is alive.
    let extensions = unsafe { instance.enumerate_device_extension_properties(physical) };
    let extensions = extensions.map_err(failed("vkEnumerateDeviceExtensionProperties"))?;
    let has = |name: &CStr| {
        extensions.iter().any(|e| e.extension_name_as_c_str().is_ok_and(|extension| extension == name))
    };
    let mut robustness = vk::PhysicalDeviceRobustness2FeaturesEXT::default();
    let mut executables = vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR::default();
    let mut subgroups = vk::PhysicalDeviceSubgroupSizeControlFeatures::default();
    let mut features = vk::PhysicalDeviceFeatures2::default();
    if has(ext::robustness2::NAME) {
        features = features.push_next(&mut robustness);
    }
    if has(khr::pipeline_executable_properties::NAME) {
        features = features.push_next(&mut executables);
    }
    if version >= (1, 3) {
        features = features.push_next(&mut subgroups);
    }
    if version >= (1, 1) {
        // SAFETY: instance and device are of version 1.1 or later; the chain has only structures that this device
        // knows, and outlives the call.
        unsafe { instance.get_physical_device_features2(physical, &mut features) };
    }
    Ok(DeviceSupport {
        robustness: robustness.robust_buffer_access2 == vk::TRUE,
        executables: executables.pipeline_executable_info == vk::TRUE,
        varying_subgroups: subgroups.subgroup_size_control == vk::TRUE,
    })
}

/// Enables statistics, and wgpu's features that affect generated code.
fn device(
    instance: &ash::Instance,
    physical: vk::PhysicalDevice,
    device_support: &DeviceSupport,
) -> Result<ash::Device, String> {
    let mut robustness = vk::PhysicalDeviceRobustness2FeaturesEXT::default().robust_buffer_access2(true);
    let mut executables =
        vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR::default().pipeline_executable_info(true);
    let mut subgroups = vk::PhysicalDeviceSubgroupSizeControlFeatures::default().subgroup_size_control(true);
    let features = vk::PhysicalDeviceFeatures::default().robust_buffer_access(true);
    let priorities = [1.0];
    let queues = [vk::DeviceQueueCreateInfo::default().queue_priorities(&priorities)];
    let mut extensions = Vec::new();
    let mut info = vk::DeviceCreateInfo::default().queue_create_infos(&queues).enabled_features(&features);
    if device_support.robustness {
        extensions.push(ext::robustness2::NAME.as_ptr());
        info = info.push_next(&mut robustness);
    }
    if device_support.executables {
        extensions.push(khr::pipeline_executable_properties::NAME.as_ptr());
        info = info.push_next(&mut executables);
    }
    if device_support.varying_subgroups {
        info = info.push_next(&mut subgroups);
    }
    info = info.enabled_extension_names(&extensions);
    // SAFETY: the device comes from this instance, which is alive, and supports all requested extensions and features
    // (`robustBufferAccess` is mandatory). All that `info` refers to outlives the call. Each device has a queue family
    // 0 with a queue.
    unsafe { instance.create_device(physical, &info, None) }.map_err(failed("vkCreateDevice"))
}

fn described(number: u32, access: Access) -> vk::DescriptorSetLayoutBinding<'static> {
    let kind = match access {
        Access::Uniform => vk::DescriptorType::UNIFORM_BUFFER,
        _ => vk::DescriptorType::STORAGE_BUFFER,
    };
    vk::DescriptorSetLayoutBinding::default()
        .binding(number)
        .descriptor_type(kind)
        .descriptor_count(1)
        .stage_flags(vk::ShaderStageFlags::COMPUTE)
}

struct PipelineObjects<'a> {
    device: &'a ash::Device,
    module: Option<vk::ShaderModule>,
    set: Option<vk::DescriptorSetLayout>,
    layout: Option<vk::PipelineLayout>,
    pipeline: Option<vk::Pipeline>,
}

impl Drop for PipelineObjects<'_> {
    fn drop(&mut self) {
        // SAFETY: all objects come from this device, which is alive; none was submitted or is used any more.
        unsafe {
            if let Some(pipeline) = self.pipeline {
                self.device.destroy_pipeline(pipeline, None);
            }
            if let Some(module) = self.module {
                self.device.destroy_shader_module(module, None);
            }
            if let Some(layout) = self.layout {
                self.device.destroy_pipeline_layout(layout, None);
            }
            if let Some(set) = self.set {
                self.device.destroy_descriptor_set_layout(set, None);
            }
        }
    }
}

fn executables(
    extension: &khr::pipeline_executable_properties::Device,
    pipeline: vk::Pipeline,
    with_texts: bool,
) -> Result<Vec<Program>, String> {
    let info = vk::PipelineInfoKHR::default().pipeline(pipeline);
    // SAFETY: the pipeline is alive, and its device has the feature.
    let found = unsafe { extension.get_pipeline_executable_properties(&info) };
    let found = found.map_err(failed("vkGetPipelineExecutablePropertiesKHR"))?;
    let one = |(index, properties): (u32, &vk::PipelineExecutablePropertiesKHR<'_>)| {
        let info = vk::PipelineExecutableInfoKHR::default().pipeline(pipeline).executable_index(index);
        // SAFETY: as before; the pipeline has an executable of this number and captured its statistics.
        let statistics = unsafe { extension.get_pipeline_executable_statistics(&info) };
        let statistics = statistics.map_err(failed("vkGetPipelineExecutableStatisticsKHR"))?;
        Ok(Program {
            name: characters(&properties.name),
            subgroup: properties.subgroup_size,
            statistics: statistics.iter().map(statistic).collect(),
            texts: if with_texts { texts(extension, &info)? } else { Vec::new() },
        })
    };
    (0..).zip(&found).map(one).collect()
}

fn statistic(raw: &vk::PipelineExecutableStatisticKHR<'_>) -> Statistic {
    // SAFETY: the format names the active member of the union; any bits are valid for each member.
    let value = unsafe {
        match raw.format {
            vk::PipelineExecutableStatisticFormatKHR::BOOL32 => Number::Whole(raw.value.b32.into()),
            vk::PipelineExecutableStatisticFormatKHR::INT64 => Number::Signed(raw.value.i64),
            vk::PipelineExecutableStatisticFormatKHR::UINT64 => Number::Whole(raw.value.u64),
            _ => Number::Real(raw.value.f64),
        }
    };
    Statistic { name: characters(&raw.name), value }
}

fn texts(
    extension: &khr::pipeline_executable_properties::Device,
    info: &vk::PipelineExecutableInfoKHR<'_>,
) -> Result<Vec<Text>, String> {
    const CALL: &str = "vkGetPipelineExecutableInternalRepresentationsKHR";
    // SAFETY: the executable is alive and captured its representations. Without buffers, the call returns only sizes.
    let sized = unsafe { extension.get_pipeline_executable_internal_representations(info) };
    let mut sized = sized.map_err(failed(CALL))?;
    let mut bytes: Vec<Vec<u8>> = sized.iter().map(|text| vec![0; text.data_size]).collect();
    for (text, bytes) in sized.iter_mut().zip(&mut bytes) {
        text.p_data = bytes.as_mut_ptr().cast();
    }
    let mut count = sized.len() as u32;
    let get = extension.fp().get_pipeline_executable_internal_representations_khr;
    // SAFETY: as before; each of the `count` structures has a buffer of its stated size, which outlives the call.
    let result = unsafe { get(extension.device(), info, &mut count, sized.as_mut_ptr()) };
    result.result().map_err(failed(CALL))?;
    let text = |(representation, bytes): (&vk::PipelineExecutableInternalRepresentationKHR<'_>, Vec<u8>)| {
        let text = String::from_utf8_lossy(&bytes).trim_end_matches('\0').to_owned();
        (representation.is_text == vk::TRUE).then(|| Text { name: characters(&representation.name), text })
    };
    Ok(sized.iter().zip(bytes).filter_map(text).collect())
}

fn failed(call: &'static str) -> impl Fn(vk::Result) -> String {
    move |result| format!("{call}: {result}")
}

fn characters(array: &[c_char]) -> String {
    let bytes: Vec<u8> = array.iter().take_while(|&&c| c != 0).map(|&c| c as u8).collect();
    String::from_utf8_lossy(&bytes).into_owned()
}
