//! A loop on the GPU: every step moves the spheres and adds the count of overlaps to a total.
//!
//! `cargo run --release -p lazygrid --example service [SPHERES] [STEPS]`

use std::error::Error;
use std::io::Write;
use std::time::{Duration, Instant};

use lazygrid::Sphere;
use lazygrid::gpu::{GpuConfig, GpuDetector, GpuDevice, GpuSpheres, SoftwareAdapter, wgpu};

/// Moves each sphere by at most its radius per axis, within a periodic unit box.
const MOVE: &str = "
    @group(0) @binding(0) var<storage, read_write> spheres: array<vec4<f32>>;

    @compute @workgroup_size(256)
    fn move_spheres(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                    @builtin(local_invocation_index) local_index: u32) {
        let index = (group.x + group.y * groups.x) * 256u + local_index;
        if (index < arrayLength(&spheres)) {
            let h = index * 2654435761u;
            let step = vec3(f32(h & 1023u), f32((h >> 10u) & 1023u), f32(h >> 22u)) / 512.0 - 1.0;
            let sphere = spheres[index];
            spheres[index] = vec4(fract(sphere.xyz + step * sphere.w), sphere.w);
        }
    }";

/// Adds the 64-bit count of pairs and the overflow flags to the total.
const TALLY: &str = "
    @group(0) @binding(0) var<storage, read> outcome: array<u32>;
    @group(0) @binding(1) var<storage, read_write> total: array<u32, 3>;

    @compute @workgroup_size(1)
    fn tally() {
        let low = total[0] + outcome[0];
        total[1] += outcome[1] + select(0u, 1u, low < outcome[0]);
        total[0] = low;
        total[2] |= outcome[2];
    }";

fn main() -> Result<(), Box<dyn Error>> {
    let mut numbers = std::env::args().skip(1).map(|text| text.parse::<u32>());
    let spheres = numbers.next().transpose()?.unwrap_or(20_000).max(1);
    let steps = numbers.next().transpose()?.unwrap_or(100);
    let GpuDevice { device, queue, adapter, .. } = GpuDevice::open(SoftwareAdapter::Allow)?;

    // Spheres fill 5 % of the box.
    let radius = (0.05 / (4.19 * f64::from(spheres))).cbrt() as f32;
    let start: Vec<Sphere> =
        (0..spheres).map(|k| Sphere::new([1, 2, 3].map(|axis| unit(3 * k + axis)), radius)).collect();
    let positions = buffer(&device, u64::from(spheres) * 16);
    let total = buffer(&device, 16);
    queue.write_buffer(&positions, 0, bytemuck::cast_slice(&start));

    let mut detector = GpuDetector::new(&device, GpuConfig::default())?;
    let outcome = detector.reserve(spheres)?.outcome;
    let (mover, moved) = stage(&device, MOVE, &[&positions]);
    let (tally, tallied) = stage(&device, TALLY, &[&outcome, &total]);
    let groups = spheres.div_ceil(256);
    let rows = groups.div_ceil(65_535);

    let clock = Instant::now();
    for _ in 0..steps {
        let mut encoder = device.create_command_encoder(&Default::default());
        run(&mut encoder, &mover, &moved, [groups.div_ceil(rows), rows]);
        detector.encode(&mut encoder, &GpuSpheres::new(&positions, spheres))?;
        run(&mut encoder, &tally, &tallied, [1, 1]);
        queue.submit([encoder.finish()]);
    }
    let [low, high, overflow] = read_total(&device, &queue, &total)?;
    let seconds = clock.elapsed().as_secs_f64();
    let found = u64::from(high) << 32 | u64::from(low);
    writeln!(
        std::io::stdout(),
        "{} steps of {spheres} spheres on {}: {found} pairs in all, overflow flags {overflow}, {:.3} ms per step",
        steps,
        adapter.name,
        seconds * 1e3 / f64::from(steps.max(1)),
    )?;
    Ok(())
}

fn unit(k: u32) -> f32 {
    let k = (k ^ (k >> 16)).wrapping_mul(0x7feb_352d);
    let k = (k ^ (k >> 15)).wrapping_mul(0x846c_a68b);
    ((k ^ (k >> 16)) >> 8) as f32 / (1 << 24) as f32
}

fn buffer(device: &wgpu::Device, size: u64) -> wgpu::Buffer {
    device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size,
        usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC,
        mapped_at_creation: false,
    })
}

fn stage(
    device: &wgpu::Device,
    source: &str,
    buffers: &[&wgpu::Buffer],
) -> (wgpu::ComputePipeline, wgpu::BindGroup) {
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: None,
        layout: None,
        module: &device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: None,
            source: wgpu::ShaderSource::Wgsl(source.into()),
        }),
        entry_point: None,
        compilation_options: Default::default(),
        cache: None,
    });
    let entries: Vec<_> = (0..)
        .zip(buffers)
        .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
        .collect();
    let layout = pipeline.get_bind_group_layout(0);
    let bindings = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &layout,
        entries: &entries,
    });
    (pipeline, bindings)
}

fn run(
    encoder: &mut wgpu::CommandEncoder,
    pipeline: &wgpu::ComputePipeline,
    bindings: &wgpu::BindGroup,
    groups: [u32; 2],
) {
    let mut pass = encoder.begin_compute_pass(&Default::default());
    pass.set_pipeline(pipeline);
    pass.set_bind_group(0, bindings, &[]);
    pass.dispatch_workgroups(groups[0], groups[1], 1);
}

fn read_total(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    total: &wgpu::Buffer,
) -> Result<[u32; 3], Box<dyn Error>> {
    let staging = device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: 12,
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let mut encoder = device.create_command_encoder(&Default::default());
    encoder.copy_buffer_to_buffer(total, 0, &staging, 0, 12);
    queue.submit([encoder.finish()]);
    staging.slice(..).map_async(wgpu::MapMode::Read, drop);
    device.poll(wgpu::PollType::Wait { submission_index: None, timeout: Some(Duration::from_secs(600)) })?;
    Ok(bytemuck::pod_read_unaligned(&staging.slice(..).get_mapped_range()?))
}
