//! Particles in Bevy's render world, colored by their number of contacts.
//!
//! One command encoder moves the particles, finds their contacts and draws them, without readback or copy.
//!
//! `cargo run --release` in this folder, with the Rust release that Bevy 0.20 needs.

use bevy::core_pipeline::{Core2d, Core2dSystems};
use bevy::prelude::*;
use bevy::render::renderer::{RenderContext, RenderDevice, RenderQueue, ViewQuery};
use bevy::render::view::ViewTarget;
use bevy::render::{RenderApp, RenderStartup};
use lazygrid::gpu::{ColumnLayout, GpuConfig, GpuDetector, GpuDevice, GpuOutput, GpuSpheres, Outcome, wgpu};

const PARTICLES: u32 = 20_000;
/// `u32` words per particle, as in `particles.wgsl`: position, radius, velocity, padding.
const WORDS: u32 = 8;

fn main() {
    App::new().add_plugins((DefaultPlugins, Contacts)).add_systems(Startup, spawn_camera).run();
}

fn spawn_camera(mut commands: Commands) {
    commands.spawn((Camera2d, Msaa::Off));
}

struct Contacts;

impl Plugin for Contacts {
    fn build(&self, app: &mut App) {
        if let Some(render) = app.get_sub_app_mut(RenderApp) {
            render
                .add_systems(RenderStartup, prepare)
                .add_systems(Core2d, draw.in_set(Core2dSystems::EarlyPostProcess));
        }
    }
}

#[derive(Resource)]
struct Scene {
    detector: GpuDetector,
    particles: wgpu::Buffer,
    contacts: wgpu::Buffer,
    shader: wgpu::ShaderModule,
    mover: wgpu::ComputePipeline,
    counter: wgpu::ComputePipeline,
    drawer: Option<(wgpu::TextureFormat, wgpu::RenderPipeline)>,
}

fn prepare(mut commands: Commands, device: Res<RenderDevice>, queue: Res<RenderQueue>) -> Result {
    let device = device.wgpu_device();
    // Without this probe, detectors use no subgroup operations.
    let _ = GpuDevice::from_wgpu(device, &queue);
    let layout = ColumnLayout { first: [0, 1, 2, 3], stride: [WORDS; 4] };
    let detector = GpuDetector::new(device, GpuConfig::default().columns(layout))?;
    let words: Vec<f32> = (0..PARTICLES).flat_map(particle).collect();
    let particles = buffer(device, "particles", 4 * u64::from(PARTICLES * WORDS));
    queue.write_buffer(&particles, 0, bytemuck::cast_slice(&words));
    let shader = device.create_shader_module(wgpu::include_wgsl!("particles.wgsl"));
    let pipeline = |entry_point| {
        device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(entry_point),
            layout: None,
            module: &shader,
            entry_point: Some(entry_point),
            compilation_options: Default::default(),
            cache: None,
        })
    };
    commands.insert_resource(Scene {
        detector,
        particles,
        contacts: buffer(device, "contacts", 4 * u64::from(PARTICLES)),
        mover: pipeline("move_particles"),
        counter: pipeline("count_contacts"),
        shader,
        drawer: None,
    });
    Ok(())
}

fn draw(view: ViewQuery<&ViewTarget>, scene: Option<ResMut<Scene>>, mut context: RenderContext) -> Result {
    let (Some(mut scene), target) = (scene, view.into_inner()) else { return Ok(()) };
    let device = context.render_device().wgpu_device().clone();
    let encoder = context.command_encoder();
    scene.step(&device, encoder)?;
    scene.draw(&device, encoder, target);
    Ok(())
}

impl Scene {
    fn step(&mut self, device: &wgpu::Device, encoder: &mut wgpu::CommandEncoder) -> Result {
        {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            let buffers = [&self.particles, &self.contacts];
            pass.set_bind_group(0, &bind(device, &self.mover.get_bind_group_layout(0), &buffers), &[]);
            pass.set_pipeline(&self.mover);
            pass.dispatch_workgroups(PARTICLES.div_ceil(256), 1, 1);
        }
        let columns = [(); 4].map(|()| (&self.particles).into());
        let input = GpuSpheres::from_columns(columns, PARTICLES);
        let GpuOutput { pairs, outcome, .. } = self.detector.encode(encoder, &input)?;
        let mut pass = encoder.begin_compute_pass(&Default::default());
        let (own, found) = (self.counter.get_bind_group_layout(0), self.counter.get_bind_group_layout(1));
        let contacts = wgpu::BindGroupEntry { binding: 1, resource: self.contacts.as_entire_binding() };
        let own = wgpu::BindGroupDescriptor { label: None, layout: &own, entries: &[contacts] };
        pass.set_bind_group(0, &device.create_bind_group(&own), &[]);
        pass.set_bind_group(1, &bind(device, &found, &[&outcome, &pairs]), &[]);
        pass.set_pipeline(&self.counter);
        pass.dispatch_workgroups_indirect(&outcome, Outcome::DISPATCH_OFFSET);
        Ok(())
    }

    fn draw(&mut self, device: &wgpu::Device, encoder: &mut wgpu::CommandEncoder, target: &ViewTarget) {
        let format = target.main_texture_format();
        let made = self.drawer.take().filter(|(for_format, _)| *for_format == format);
        let (_, pipeline) =
            &*self.drawer.insert(made.unwrap_or_else(|| (format, drawer(device, &self.shader, format))));
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("particles"),
            color_attachments: &[Some(target.get_color_attachment())],
            ..Default::default()
        });
        let buffers = [&self.particles, &self.contacts];
        pass.set_bind_group(0, &bind(device, &pipeline.get_bind_group_layout(0), &buffers), &[]);
        pass.set_pipeline(pipeline);
        // The largest centered square, in which spheres are round.
        let size = target.main_texture().size();
        let [width, height] = [size.width, size.height].map(|length| length as f32);
        let side = width.min(height);
        pass.set_viewport(0.5 * (width - side), 0.5 * (height - side), side, side, 0.0, 1.0);
        pass.draw(0..6, 0..PARTICLES);
    }
}

fn drawer(
    device: &wgpu::Device,
    shader: &wgpu::ShaderModule,
    format: wgpu::TextureFormat,
) -> wgpu::RenderPipeline {
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("particles"),
        layout: None,
        vertex: wgpu::VertexState {
            module: shader,
            entry_point: Some("particle_corner"),
            compilation_options: Default::default(),
            buffers: &[],
        },
        primitive: Default::default(),
        depth_stencil: None,
        multisample: Default::default(),
        fragment: Some(wgpu::FragmentState {
            module: shader,
            entry_point: Some("particle_color"),
            compilation_options: Default::default(),
            targets: &[Some(format.into())],
        }),
        multiview_mask: None,
        cache: None,
    })
}

fn bind(device: &wgpu::Device, layout: &wgpu::BindGroupLayout, buffers: &[&wgpu::Buffer]) -> wgpu::BindGroup {
    let resources = buffers.iter().map(|buffer| buffer.as_entire_binding());
    let entries: Vec<_> =
        (0..).zip(resources).map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource }).collect();
    device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
}

fn buffer(device: &wgpu::Device, label: &str, size: u64) -> wgpu::Buffer {
    let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
    device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size,
        usage,
        mapped_at_creation: false,
    })
}

fn particle(index: u32) -> [f32; WORDS as usize] {
    let unit = |k: u32| {
        let k = (8 * index + k).wrapping_mul(0x9e37_79b9);
        let k = (k ^ (k >> 15)).wrapping_mul(0x846c_a68b);
        ((k ^ (k >> 16)) >> 8) as f32 / (1 << 23) as f32 - 1.0
    };
    let [x, y, z] = [0, 1, 2].map(|axis| 50.0 * unit(axis));
    let [u, v, w] = [3, 4, 5].map(|axis| 0.1 * unit(axis));
    [x, y, z, 0.6 + 0.4 * unit(6), u, v, w, 0.0]
}
