//! Kernels against the CPU. Skipped without an adapter, unless `LAZYGRID_REQUIRE_GPU` is set.

#[path = "../../../tests/src/adapter.rs"]
pub(super) mod adapter;
mod births;
mod collisions;
#[path = "../../../tests/src/limited_device.rs"]
mod limited_device;
mod past_receivers;
mod surfaces;
mod vessels;

use adapter::or_skip;
use lazygrid::gpu::{GpuDevice, SoftwareAdapter, wgpu};
pub(crate) use limited_device::limited;

use super::detectors::DetectorOutputs;
use super::device::{buffer, filled, read};
use super::dispatches::{Groups, RunBuffers, StepDispatches};
use super::kernel::{self as k, Variant, expand};
use super::layout::{CLAIM_BYTES, ControlHeader};
use super::plan::Sizes;
use super::tables::Tables;
use crate::random::gaussian;
use crate::random::philox::{Key, Purpose, philox};
use crate::reaction::matching::tests::choose;
use crate::reaction::matching::{Matching, ReactionCandidate};
use crate::{Boundary, Model, Reaction, Species};

pub(crate) fn device() -> Option<GpuDevice> {
    or_skip(GpuDevice::shared(SoftwareAdapter::Allow))
}

const EVERYTHING: Variant = Variant { has_membranes: true, has_long_paths: true };

fn evaluate(gpu: &GpuDevice, includes: &str, body: &str, count: u32) -> Vec<[u32; 4]> {
    let source = format!(
        "{includes}\n@group(0) @binding(0) var<storage, read_write> out: array<vec4<u32>>;\n\
         @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) at: vec3<u32>) {{\n\
         let k = at.x;\nif (k < arrayLength(&out)) {{ {body} }}\n}}"
    );
    let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: None,
        source: wgpu::ShaderSource::Wgsl(expand(&source, EVERYTHING).into()),
    });
    let pipeline = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: None,
        layout: None,
        module: &module,
        entry_point: None,
        compilation_options: Default::default(),
        cache: None,
    });
    let out = buffer(gpu, "out", 16 * u64::from(count)).expect("a buffer");
    let bindings = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &pipeline.get_bind_group_layout(0),
        entries: &[wgpu::BindGroupEntry { binding: 0, resource: out.as_entire_binding() }],
    });
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    {
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &bindings, &[]);
        pass.dispatch_workgroups(count.div_ceil(64), 1, 1);
    }
    let bytes = read(gpu, encoder, &[(&out, 16 * u64::from(count))]).expect("read");
    bytemuck::pod_collect_to_vec(&bytes[0])
}

fn scattered(k: u32) -> ([u32; 4], [u32; 2]) {
    let word = |by: u32| k.wrapping_mul(by) ^ (k << 7);
    ([word(0x9e37_79b9), word(0x85eb_ca6b), k, 3], [word(0xc2b2_ae35), !k])
}

const SCATTERED: &str =
    "let counter = vec4((k * 0x9e3779b9u) ^ (k << 7u), (k * 0x85ebca6bu) ^ (k << 7u), k, 3u);
    let key = vec2((k * 0xc2b2ae35u) ^ (k << 7u), ~k);";

#[test]
fn random_words_match_the_cpu() {
    let Some(gpu) = device() else { return };
    let found =
        evaluate(&gpu, "#include philox", &format!("{SCATTERED} out[k] = philox(counter, key);"), 20_000);
    for (k, found) in (0..).zip(found) {
        let (counter, key) = scattered(k);
        assert_eq!(found, philox(counter, key), "{k}");
    }
}

#[test]
fn normal_numbers_and_directions_differ_in_the_last_bits_at_most() {
    let Some(gpu) = device() else { return };
    let includes = "#include philox\n#include normal";
    let body = |expression: &str| {
        format!(
            "{SCATTERED} let w = philox(counter, key); out[k] = vec4(bitcast<vec3<u32>>({expression}), 0u);"
        )
    };
    // Operations after the logarithm and the angle may round differently.
    let close = |a: f32, b: f32| (a - b).abs() <= 4e-7 * b.abs().max(0.25);
    for (expression, exact) in [
        ("normals(w)", gaussian::normals as fn([u32; 4]) -> [f32; 3]),
        ("direction(w.x, w.y)", |w| gaussian::direction(w[0], w[1])),
    ] {
        let found = evaluate(&gpu, includes, &body(expression), 50_000);
        for (k, [x, y, z, _]) in (0..).zip(found) {
            let (counter, key) = scattered(k);
            let exact = exact(philox(counter, key));
            for (found, exact) in [x, y, z].map(f32::from_bits).into_iter().zip(exact) {
                assert!(close(found, exact), "{expression} {k}: {found} and not {exact}");
            }
        }
    }
}

fn model() -> Model {
    let species = |name: &str| Species { name: name.into(), ..Species::default() };
    let reaction = |reactants: [u32; 2], products| Reaction {
        name: format!("{reactants:?}"),
        reactants,
        products,
        binding_radius: 1.0,
        ..Reaction::default()
    };
    Model {
        time_step: 1.0,
        species: vec![species("A"), species("B"), species("C")],
        reactions: vec![
            reaction([0, 0], [None, Some(2)]),
            reaction([0, 1], [Some(2), Some(1)]),
            reaction([1, 1], [Some(1), Some(2)]),
        ],
        ..Model::default()
    }
}

const CLAIMS: [[bool; 2]; 3] = [[true, true], [true, false], [false, true]];
const RULES: [u32; 3] = [0, 1, 4];

fn candidates(particles: u32, count: u32, salt: u32) -> Vec<ReactionCandidate> {
    let mut seen = std::collections::HashSet::new();
    let mut all = Vec::new();
    for k in 0..count {
        let [a, by, priority, kind] = Key::new(7).draw(k, salt, 0, Purpose::Pair);
        let a = a % particles;
        let b = (a + 1 + by % (particles - 1)) % particles;
        let id = |at: u32| (at * 37 + 11) % 1_000_003;
        let ids = [id(a).min(id(b)), id(a).max(id(b))];
        if seen.insert(ids) {
            let rule = [0, 0, 0, 1, 2][kind as usize % 5];
            let priority = priority % 5;
            all.push(ReactionCandidate {
                at: [a, b],
                consumes: CLAIMS[rule],
                rule: rule as u32,
                priority,
                ids,
            });
        }
    }
    all
}

fn matched(
    gpu: &GpuDevice,
    all: &[ReactionCandidate],
    particles: u32,
    [rounds, max_iterations]: [u32; 2],
) -> (u32, Vec<Option<f32>>) {
    let tables = Tables::new(&model(), Key::new(1), max_iterations);
    let mut buffers = RunBuffers::new(gpu.clone(), &tables, 0).expect("buffers");
    let sizes = Sizes { particles, pairs: all.len().max(1) as u32, ..Sizes::default() };
    let table = crate::reaction::interactions(&model()).expect("interactions");
    let settings = lazygrid::gpu::GpuConfig::default().interactions(table);
    let mut detector = lazygrid::gpu::GpuDetector::new(&gpu.device, settings).expect("a detector");
    let found = detector.reserve(particles).expect("buffers");
    let steps = StepDispatches::new(
        &mut buffers,
        sizes,
        rounds,
        DetectorOutputs { interactions: Some(found), candidates: None },
    )
    .expect("steps");
    let id = |at: u32| (at * 37 + 11) % 1_000_003;
    let rows: Vec<[u32; 6]> = all
        .iter()
        .map(|c| [c.at[0], c.at[1], id(c.at[0]), id(c.at[1]), RULES[c.rule as usize], c.priority])
        .collect();
    let order: Vec<u32> = (0..all.len() as u32).rev().collect();
    let moved: Vec<[f32; 4]> = (0..particles).map(|k| [k as f32, 0.0, 0.0, 0.0]).collect();
    let head = ControlHeader { count: particles, left: [all.len() as u32, 0], ..ControlHeader::default() };
    let write = |name: &str, bytes: &[u8]| gpu.queue.write_buffer(steps.buffer(name), 0, bytes);
    write("candidates", bytemuck::cast_slice(&rows));
    write("left0", bytemuck::cast_slice(&order));
    write("moved", bytemuck::cast_slice(&moved));
    write("control", bytemuck::bytes_of(&head));
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    steps.encode_matching(&mut encoder);
    let sources =
        [(steps.buffer("claims"), CLAIM_BYTES * u64::from(particles)), (steps.buffer("control"), 16)];
    let read = read(gpu, encoder, &sources).expect("read");
    let claims: Vec<[u32; 8]> = bytemuck::pod_collect_to_vec(&read[0]);
    let control: Vec<u32> = bytemuck::pod_collect_to_vec(&read[1]);
    (control[3], claims.iter().map(|c| (c[2] != 0).then_some(f32::from_bits(c[4]))).collect())
}

#[test]
fn matching_equals_sequential_greedy_matching() {
    let Some(gpu) = device() else { return };
    for (particles, count) in [(2, 1), (41, 300), (5_000, 300), (3_000, 9_000)] {
        for [rounds, max_iterations] in [[0, 60_000], [1, 60_000], [4, 60_000]] {
            let all = candidates(particles, count, rounds);
            let mut expected = vec![None; particles as usize];
            for chosen in choose(&mut Matching::default(), &all, particles as usize) {
                let ReactionCandidate { at, consumes, .. } = chosen;
                let own_positions = at.map(|at| at as f32);
                // Products next to a catalyst stay at their reactants.
                let positions = if consumes == [true; 2] {
                    [0.5 * (own_positions[0] + own_positions[1]); 2]
                } else {
                    own_positions
                };
                (0..2).filter(|&k| consumes[k]).for_each(|k| expected[at[k] as usize] = Some(positions[k]));
            }
            let found = matched(&gpu, &all, particles, [rounds, max_iterations]);
            assert_eq!(found, (0, expected), "{particles} particles, {count} candidates, {rounds} rounds");
        }
    }
}

#[test]
fn unfinished_matching_halts_the_run() {
    let Some(gpu) = device() else { return };
    let all = candidates(41, 300, 0);
    assert_eq!(matched(&gpu, &all, 41, [0, 64]).0, ControlHeader::ROUNDS_LEFT);
}

fn written(gpu: &GpuDevice, name: &'static str, bytes: &[u8]) -> wgpu::Buffer {
    let made = buffer(gpu, name, bytes.len() as u64).expect("a buffer");
    gpu.queue.write_buffer(&made, 0, bytes);
    made
}

#[test]
fn survivors_are_compacted_in_output_order() {
    let Some(gpu) = device() else { return };
    let tables = Tables::new(&model(), Key::new(1), 64);
    for (count, is_cell_order, halted) in [(700, 1, 0), (700, 0, 0), (1_100_001, 1, 0), (700, 1, 1)] {
        let mut buffers = RunBuffers::new(gpu.clone(), &tables, 0).expect("buffers");
        let word = |k: u32| philox([k, 0, 0, 0], [3, 0])[0];
        let mut order: Vec<u32> = (0..count).collect();
        order.sort_by_key(|&k| word(k));
        let row = |k: u32| [k as f32, 0.5, -1.0, if word(k) % 5 == 0 { -1.0 } else { 0.25 }];
        let moved: Vec<[f32; 4]> = (0..count).map(row).collect();
        let species: Vec<u32> = (0..count).map(|k| word(k) % 3).collect();
        let tags: Vec<[u32; 2]> = (0..count).map(|k| [9, k * 7 + 1]).collect();
        let product = |k: u32| if word(k) % 7 == 2 { crate::gpu::layout::NOTHING } else { 5 };
        let claim = |k: u32| [0, 0, u32::from(word(k) % 7 < 3), product(k), k, 1, 2, 3];
        let claims: Vec<[u32; 8]> = (0..count).map(claim).collect();
        let head = ControlHeader { count, halted, capacity: count, ..ControlHeader::default() };
        let with = |name, bytes: &[u8]| written(&gpu, name, bytes);
        let made: std::collections::HashMap<&str, wgpu::Buffer> = [
            ("order", with("order", bytemuck::cast_slice(&order))),
            ("moved", with("moved", bytemuck::cast_slice(&moved))),
            ("species", with("species", bytemuck::cast_slice(&species))),
            ("tags", with("tags", bytemuck::cast_slice(&tags))),
            ("claims", with("claims", bytemuck::cast_slice(&claims))),
            ("spheres", with("spheres", &vec![0; 16 * count as usize])),
            ("ids", with("ids", &vec![0; 4 * count as usize])),
            ("events", with("events", &[0; 64])),
            ("sums", with("sums", &vec![0; 4 * (count as usize / 256 + 2)])),
            ("output_order", with("output_order", bytemuck::cast_slice(&[is_cell_order, 0, 0, 0]))),
        ]
        .into();
        gpu.queue.write_buffer(buffers.buffer("control"), 0, bytemuck::bytes_of(&head));
        let [params, control, log] = ["params", "control", "log"].map(|name| buffers.buffer(name).clone());
        let find = |name| match name {
            "params" => params.clone(),
            "control" => control.clone(),
            "log" => log.clone(),
            other => made[other].clone(),
        };
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        for (kernel, groups) in [
            (&k::SURVIVORS_COUNT, count.div_ceil(k::WORKGROUP_SIZE)),
            (&k::SURVIVORS_SCAN, 1),
            (&k::SURVIVORS_PLACE, count.div_ceil(k::WORKGROUP_SIZE)),
        ] {
            buffers.stage(kernel, Groups::Fixed(groups), find).expect("a stage").encode(&mut encoder, groups);
        }
        let n = u64::from(count);
        let read = read(
            &gpu,
            encoder,
            &[
                (&made["spheres"], 16 * n),
                (&made["tags"], 8 * n),
                (&control, size_of::<ControlHeader>() as u64),
            ],
        )
        .expect("read");
        let head: ControlHeader = bytemuck::pod_read_unaligned(&read[2][..size_of::<ControlHeader>()]);
        let found: Vec<([u32; 4], [u32; 2])> = bytemuck::pod_collect_to_vec::<u8, [u32; 4]>(&read[0])
            .into_iter()
            .zip(bytemuck::pod_collect_to_vec::<u8, [u32; 2]>(&read[1]))
            .collect();
        if halted == 1 {
            assert!(found.iter().zip(&tags).all(|((sphere, tag), old)| *sphere == [0; 4] && tag == old));
            continue;
        }
        let expected: Vec<([u32; 4], [u32; 2])> = (0..count as usize)
            .map(|k| if is_cell_order == 1 { order[k] as usize } else { k })
            .filter(|&at| moved[at][3] >= 0.0 && (claims[at][2] == 0 || claims[at][3] == 5))
            .map(|at| match claims[at][2] {
                0 => (moved[at].map(f32::to_bits), [species[at], tags[at][1]]),
                _ => ([claims[at][4], 1, 2, 3], [5, tags[at][1]]),
            })
            .collect();
        assert_eq!((head.alive, head.done, head.logged), (expected.len() as u32, 1, 1));
        assert!(found[..expected.len()] == expected[..], "{count} particles, listed: {is_cell_order}");
    }
}

#[test]
fn buffer_begins_with_its_contents() {
    let Some(gpu) = device() else { return };
    let made = filled(&gpu, "three words", &[1u32, 2, 3]).expect("a buffer");
    let encoder = gpu.device.create_command_encoder(&Default::default());
    let back = read(&gpu, encoder, &[(&made, 4), (&made, 12)]).expect("read");
    assert_eq!(back, [vec![1, 0, 0, 0], vec![1, 0, 0, 0, 2, 0, 0, 0, 3, 0, 0, 0]]);
}
