//! A compute pass on the GPU counts each sphere's contacts from the detected pairs, without readback.
//!
//! `cargo run --release -p lazygrid --example embedded`

use std::error::Error;
use std::time::Duration;

use lazygrid::Sphere;
use lazygrid::gpu::{
    GpuConfig, GpuDetector, GpuDevice, GpuOutput, GpuSpheres, Outcome, optional_features, wgpu,
};

const SPHERES: u32 = 100_000;

/// One thread per pair, dispatched with the arguments that the detector writes.
const CONSUMER: &str = "
    @group(0) @binding(0) var<storage, read> outcome: array<u32>;
    @group(0) @binding(1) var<storage, read> pairs: array<vec2<u32>>;
    @group(0) @binding(2) var<storage, read_write> contacts: array<atomic<u32>>;

    @compute @workgroup_size(256)
    fn consume(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
               @builtin(local_invocation_index) local_index: u32) {
        let index = (group.x + group.y * groups.x) * 256u + local_index;
        // The low word of the count; results beyond 32 bits or the buffer raise the overflow flag.
        if (index < min(outcome[0], arrayLength(&pairs))) {
            let pair = pairs[index];
            atomicAdd(&contacts[pair.x], 1u);
            atomicAdd(&contacts[pair.y], 1u);
        }
    }";

fn main() -> Result<(), Box<dyn Error>> {
    let (device, queue) = simulator_device()?;
    let spheres = simulator_spheres(&device, &queue);
    let contacts = buffer(&device, "contacts", u64::from(SPHERES) * 4, wgpu::BufferUsages::COPY_SRC);
    let consumer = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some("consume"),
        layout: None,
        module: &device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("consume"),
            source: wgpu::ShaderSource::Wgsl(CONSUMER.into()),
        }),
        entry_point: None,
        compilation_options: Default::default(),
        cache: None,
    });

    // Without this probe, detectors use no subgroup operations.
    let _ = GpuDevice::from_wgpu(&device, &queue);
    let mut detector = GpuDetector::new(&device, GpuConfig::default())?;
    let GpuOutput { pairs, outcome, .. } = detector.reserve(SPHERES)?;
    let bindings = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("consume"),
        layout: &consumer.get_bind_group_layout(0),
        entries: &[entry(0, &outcome), entry(1, &pairs), entry(2, &contacts)],
    });

    let mut encoder = device.create_command_encoder(&Default::default());
    detector.encode(&mut encoder, &GpuSpheres::new(&spheres, SPHERES))?;
    {
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_pipeline(&consumer);
        pass.set_bind_group(0, &bindings, &[]);
        pass.dispatch_workgroups_indirect(&outcome, Outcome::DISPATCH_OFFSET);
    }
    queue.submit([encoder.finish()]);

    let found: Outcome = read(&device, &queue, &outcome, 1)?[0];
    let contacts: Vec<u32> = read(&device, &queue, &contacts, SPHERES as usize)?;
    let total: u64 = contacts.iter().map(|&count| u64::from(count)).sum();
    assert_eq!(found.overflow, 0, "the output holds all pairs");
    assert_eq!(total, 2 * found.found(), "every pair is a contact of two spheres");
    show(&format!(
        "{} pairs of {SPHERES} spheres; the busiest sphere has {} contacts\n",
        found.found(),
        contacts.iter().max().unwrap_or(&0)
    ))
}

fn simulator_device() -> Result<(wgpu::Device, wgpu::Queue), Box<dyn Error>> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapter = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions::default()))?;
    let descriptor = wgpu::DeviceDescriptor {
        required_features: adapter.features() & optional_features(),
        required_limits: adapter.limits(),
        ..Default::default()
    };
    Ok(pollster::block_on(adapter.request_device(&descriptor))?)
}

fn simulator_spheres(device: &wgpu::Device, queue: &wgpu::Queue) -> wgpu::Buffer {
    // Spheres fill 5 % of the box.
    let side = (f64::from(SPHERES) * 4.19 * 0.125 / 0.05).cbrt() as f32;
    let spheres: Vec<Sphere> =
        (0..SPHERES).map(|k| Sphere::new([1, 2, 3].map(|axis| unit(3 * k + axis) * side), 0.5)).collect();
    let buffer = buffer(device, "spheres", u64::from(SPHERES) * 16, wgpu::BufferUsages::COPY_DST);
    queue.write_buffer(&buffer, 0, bytemuck::cast_slice(&spheres));
    buffer
}

fn unit(k: u32) -> f32 {
    let k = (k ^ (k >> 16)).wrapping_mul(0x7feb_352d);
    let k = (k ^ (k >> 15)).wrapping_mul(0x846c_a68b);
    ((k ^ (k >> 16)) >> 8) as f32 / (1 << 24) as f32
}

fn buffer(device: &wgpu::Device, label: &str, size: u64, usage: wgpu::BufferUsages) -> wgpu::Buffer {
    device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size,
        usage: usage | wgpu::BufferUsages::STORAGE,
        mapped_at_creation: false,
    })
}

fn entry(binding: u32, buffer: &wgpu::Buffer) -> wgpu::BindGroupEntry<'_> {
    wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() }
}

fn read<T: bytemuck::Pod>(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    source: &wgpu::Buffer,
    count: usize,
) -> Result<Vec<T>, Box<dyn Error>> {
    let size = (count * size_of::<T>()) as u64;
    let staging = device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("staging"),
        size,
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let mut encoder = device.create_command_encoder(&Default::default());
    encoder.copy_buffer_to_buffer(source, 0, &staging, 0, size);
    queue.submit([encoder.finish()]);
    staging.slice(..).map_async(wgpu::MapMode::Read, drop);
    device.poll(wgpu::PollType::Wait { submission_index: None, timeout: Some(Duration::from_secs(60)) })?;
    Ok(bytemuck::pod_collect_to_vec(&staging.slice(..).get_mapped_range()?))
}

fn show(text: &str) -> Result<(), Box<dyn Error>> {
    Ok(std::io::Write::write_all(&mut std::io::stdout(), text.as_bytes())?)
}
