//! What the device tests share: a device or a reason to skip, and buffers to and fro.

#![allow(dead_code, reason = "each test binary uses its part")]

#[path = "../../../tests/src/adapter.rs"]
mod adapter;
pub(crate) mod scenes;

use std::time::Duration;

use adapter::or_skip;
use bytemuck::Pod;
use lazygrid::gpu::{GpuDevice, wgpu};
use lazygrid_kernels::kernel::{Access, Binding, Kernel, Variant};

/// The device to test on. Without one the test says why and is skipped, unless `LAZYGRID_REQUIRE_GPU` is set.
pub(crate) fn device() -> Option<GpuDevice> {
    or_skip(GpuDevice::open(true))
}

pub(crate) fn upload<T: Pod>(own: &GpuDevice, data: &[T]) -> wgpu::Buffer {
    let bytes: &[u8] = bytemuck::cast_slice(data);
    let buffer = own.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("test input"),
        size: (bytes.len() as u64).max(16).next_multiple_of(16),
        usage: wgpu::BufferUsages::STORAGE
            | wgpu::BufferUsages::UNIFORM
            | wgpu::BufferUsages::COPY_DST
            | wgpu::BufferUsages::COPY_SRC,
        mapped_at_creation: false,
    });
    own.queue.write_buffer(&buffer, 0, bytes);
    buffer
}

pub(crate) fn download<T: Pod>(own: &GpuDevice, buffer: &wgpu::Buffer, count: usize) -> Vec<T> {
    if count == 0 {
        return Vec::new();
    }
    let size = (count * size_of::<T>()) as u64;
    let staging = own.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("test output"),
        size,
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    submit(own, |encoder| encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, size));
    staging.slice(..).map_async(wgpu::MapMode::Read, |result| result.expect("mapped"));
    let wait = wgpu::PollType::Wait { submission_index: None, timeout: Some(Duration::from_secs(600)) };
    own.device.poll(wait).expect("finished in time");
    bytemuck::pod_collect_to_vec(&staging.slice(..).get_mapped_range().expect("mapped"))
}

pub(crate) fn submit<R>(own: &GpuDevice, record: impl FnOnce(&mut wgpu::CommandEncoder) -> R) -> R {
    let mut encoder = own.device.create_command_encoder(&Default::default());
    let result = record(&mut encoder);
    own.queue.submit([encoder.finish()]);
    result
}

/// A small generator of its own: the same numbers everywhere (SplitMix64).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub(crate) fn word(&mut self) -> u32 {
        (self.bits() >> 32) as u32
    }

    /// In 0..1.
    pub(crate) fn unit(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1 << 24) as f32
    }
}

/// Runs one kernel on buffers given by the names of its bindings.
pub(crate) fn run(
    own: &GpuDevice,
    kernel: &Kernel,
    variant: Variant,
    groups: u32,
    buffers: &[(&str, &wgpu::Buffer)],
) {
    let module = own.device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some(kernel.name),
        source: wgpu::ShaderSource::Wgsl(kernel.wgsl(variant).into()),
    });
    let entry = |(binding, bound): (u32, Binding)| wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: wgpu::BindingType::Buffer {
            ty: match bound.access {
                Access::Uniform => wgpu::BufferBindingType::Uniform,
                access => wgpu::BufferBindingType::Storage { read_only: access == Access::Read },
            },
            has_dynamic_offset: false,
            min_binding_size: None,
        },
        count: None,
    };
    let layout = own.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: None,
        entries: &(0..).zip(kernel.bindings(variant)).map(entry).collect::<Vec<_>>(),
    });
    let pipeline_layout = own.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: None,
        bind_group_layouts: &[Some(&layout)],
        immediate_size: 0,
    });
    let pipeline = own.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some(kernel.name),
        layout: Some(&pipeline_layout),
        module: &module,
        entry_point: Some(kernel.name),
        compilation_options: wgpu::PipelineCompilationOptions {
            zero_initialize_workgroup_memory: false,
            ..Default::default()
        },
        cache: None,
    });
    let entry = |(binding, bound): (u32, Binding)| wgpu::BindGroupEntry {
        binding,
        resource: buffers
            .iter()
            .find(|(name, _)| *name == bound.name)
            .expect("a buffer for each binding")
            .1
            .as_entire_binding(),
    };
    let bindings = own.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &layout,
        entries: &(0..).zip(kernel.bindings(variant)).map(entry).collect::<Vec<_>>(),
    });
    submit(own, |encoder| {
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &bindings, &[]);
        pass.dispatch_workgroups(groups, 1, 1);
    });
}
