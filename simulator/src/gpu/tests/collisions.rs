use std::collections::HashMap;

use super::*;
use crate::gpu::kernel::Kernel;
use crate::gpu::layout::{MOVER_BYTES, NEXT_EVENT_BYTES, PUSH_BYTES, WINDOW_BYTES};
use crate::model::Contact;
use crate::model::boundary::Axis;
use crate::model::particles::{Particle, Particles};
use crate::motion::collisions::mover::{Mover, length};
use crate::motion::collisions::rounds::{Adjacency, SLACK, Window};
use crate::motion::collisions::rules::{CollisionEvent, Rules};
use crate::motion::collisions::tests::model;
use crate::motion::contact::Contacts;
use crate::random::philox::{StepKey, open_unit};
use crate::{Receiver, ReceiverKind};

const WINDOW: usize = WINDOW_BYTES as usize / 4;
const MOVER: usize = MOVER_BYTES as usize / 4;
const NEXT: usize = NEXT_EVENT_BYTES as usize / 4;
const ALLOWANCE: f32 = 0.25;
const HORIZON: f32 = 0.9;
const TOP_SPEED: f32 = 4.0;

fn crowd(contact: Contact, axis: Axis) -> Model {
    Model { time_step: 0.5, ..model(contact, axis) }
}

fn movers(model: &Model, case: u32) -> Vec<[u32; MOVER]> {
    let mover = |k: u32| {
        let words = philox([k, case, 0, 0], [1, 2]);
        let species = usize::from(words[3].is_multiple_of(4));
        let site = [k % 5, k / 5 % 5, k / 25].map(|c| 1.1 * (c as f32 + 0.5));
        let jitter = |c: usize| if k.is_multiple_of(9) { 0.3 } else { 0.08 } * (open_unit(words[c]) - 0.5);
        let [u, v, w] = gaussian::normals(philox([k, case, 1, 0], [1, 2])).map(|c| 0.6 * c);
        let mobility = match model.contact {
            Contact::Elastic => 1.0 / model.species[species].mass,
            _ => model.species[species].diffusion * model.time_step,
        };
        let [x, y, z] = [0, 1, 2].map(|c| site[c] + jitter(c));
        let values =
            [x, y, z, 0.0, 0.0, 0.0, 0.0, 0.0, u, v, w, [0.5, 0.3][species], u, v, w, mobility as f32];
        let mut words = values.map(f32::to_bits);
        words[3] = (k * 37) % 1009;
        words
    };
    (0..125).map(mover).collect()
}

fn on_cpu(words: &[u32; MOVER]) -> Mover {
    let value = |k: usize| f64::from(f32::from_bits(words[k]));
    let vector = |k: usize| [value(k), value(k + 1), value(k + 2)];
    let radius = f32::from_bits(words[11]);
    let motion = vector(8);
    Mover {
        position: std::array::from_fn(|k| value(k) + value(4 + k)),
        time: value(7),
        motion,
        speed: length(motion),
        velocity: vector(12),
        id: words[3],
        species: u32::from(radius < 0.4),
        radius,
        collided: false,
    }
}

struct Device {
    gpu: GpuDevice,
    run: RunBuffers,
    buffers: HashMap<&'static str, wgpu::Buffer>,
}

impl Device {
    fn new(gpu: &GpuDevice, model: &Model, movers: &[[u32; MOVER]]) -> Self {
        let run = RunBuffers::new(gpu.clone(), &Tables::new(model, Key::new(1), 64), 0).expect("buffers");
        let n = movers.len() as u32;
        let pairs: Vec<[u32; 2]> = (0..n).flat_map(|j| (0..j).map(move |i| [i, j])).collect();
        let mut window = [0; WINDOW];
        window[0] = n;
        window[2] = HORIZON.to_bits();
        window[3] = ALLOWANCE.to_bits();
        window[5] = TOP_SPEED.to_bits();
        window[6] = pairs.len() as u32;
        window[9] = f32::INFINITY.to_bits();
        let mut next = vec![[0u32; NEXT]; movers.len()];
        next.iter_mut().for_each(|next| next[2] = 1);
        let tags: Vec<[u32; 2]> = movers.iter().map(|m| [on_cpu(m).species, m[3]]).collect();
        let with = |name, bytes: &[u8]| (name, written(gpu, name, bytes));
        let head = ControlHeader { count: n, ..ControlHeader::default() };
        gpu.queue.write_buffer(run.buffer("control"), 0, bytemuck::bytes_of(&head));
        let buffers = [
            with("movers", bytemuck::cast_slice(movers)),
            with("next_events", bytemuck::cast_slice(&next)),
            with("near_pairs", bytemuck::cast_slice(&pairs)),
            with("neighbors", &vec![0; 8 * pairs.len()]),
            with("tags", bytemuck::cast_slice(&tags)),
            with("window", bytemuck::cast_slice(&window)),
        ];
        Self { gpu: gpu.clone(), run, buffers: buffers.into() }
    }

    fn run(&mut self, kernel: &'static Kernel, items: u32, round: u32) {
        let groups = items.div_ceil(k::WORKGROUP_SIZE);
        let shared =
            ["params", "control", "reaction_rows", "species_rows", "event_rows", "scene_rows", "trajectory"];
        let shared: HashMap<&str, wgpu::Buffer> =
            shared.map(|name| (name, self.run.buffer(name).clone())).into();
        let rounds = ["round0", "round1"].map(|name| self.run.buffer(name).clone());
        let find = |name: &'static str| match name {
            "round" => rounds[round as usize % 2].clone(),
            other => self.buffers.get(other).or_else(|| shared.get(other)).expect(other).clone(),
        };
        let stage = self.run.stage(kernel, Groups::Fixed(groups), find).expect("a stage");
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        stage.encode(&mut encoder, groups);
        self.gpu.queue.submit([encoder.finish()]);
    }

    fn read<T: bytemuck::Pod>(&self, name: &str, count: usize) -> Vec<T> {
        let encoder = self.gpu.device.create_command_encoder(&Default::default());
        let buffer = self.buffers.get(name).unwrap_or_else(|| self.run.buffer(name));
        let bytes = read(&self.gpu, encoder, &[(buffer, (count * size_of::<T>()) as u64)]).expect("read");
        bytemuck::pod_collect_to_vec(&bytes[0])
    }

    fn list(&mut self, n: u32) -> Vec<Vec<u32>> {
        let pairs = n * (n - 1) / 2;
        self.run(&k::NEIGHBORS_COUNT, pairs, 0);
        self.run(&k::NEIGHBORS_RESERVE, n, 0);
        self.run(&k::NEIGHBORS_LIST, pairs, 0);
        let next: Vec<[u32; NEXT]> = self.read("next_events", n as usize);
        let all: Vec<u32> = self.read("neighbors", 2 * pairs as usize);
        let list = |next: &[u32; NEXT]| {
            let mut list = all[next[5] as usize..(next[5] + next[6]) as usize].to_vec();
            list.sort_unstable();
            list
        };
        next.iter().map(list).collect()
    }
}

const PASSES: u32 = 1 << 31;

#[test]
fn neighbors_match_the_cpu() {
    let Some(gpu) = device() else { return };
    for contact in [Contact::Separate, Contact::Elastic] {
        let model = crowd(contact, Axis::Periodic { low: 0.0, high: 5.5 });
        let rules = Rules::new(&model).expect("collisions");
        let words = movers(&model, 1);
        let cpu: Vec<Mover> = words.iter().map(on_cpu).collect();
        let found = Device::new(&gpu, &model, &words).list(words.len() as u32);
        let mut overlaps = 0;
        for (i, a) in cpu.iter().enumerate() {
            let mut expected = Vec::new();
            for (j, b) in cpu.iter().enumerate().filter(|(j, _)| *j != i) {
                let gap = a.gap(b, 0.0, &rules.boundary);
                if gap > 2.0 * f64::from(ALLOWANCE) {
                    continue;
                }
                let passes = rules.passes([a, b]);
                overlaps += u32::from(passes);
                if !passes || contact == Contact::Elastic {
                    expected.push(j as u32 | if passes { PASSES } else { 0 });
                }
            }
            expected.sort_unstable();
            assert_eq!(found[i], expected, "{contact:?} {i}");
        }
        assert!(overlaps > 4, "{overlaps}");
    }
}

#[test]
fn collision_rounds_match_the_cpu() {
    let Some(gpu) = device() else { return };
    let axes = [Axis::Open, Axis::Reflecting { low: 0.0, high: 5.5 }, Axis::Periodic { low: 0.0, high: 5.5 }];
    for (case, axis) in axes.into_iter().enumerate() {
        let model = crowd(Contact::Separate, axis);
        let rules = Rules::new(&model).expect("collisions");
        let words = movers(&model, case as u32);
        let n = words.len() as u32;
        let mut device = Device::new(&gpu, &model, &words);
        let lists = device.list(n);
        let pairs: Vec<[u32; 2]> = (0..n)
            .flat_map(|i| lists[i as usize].iter().filter(move |&&j| i < j).map(move |&j| [i, j]))
            .collect();
        let mut neighbors = Adjacency::default();
        neighbors.build(&pairs, n as usize);
        let window = Window {
            rules: &rules,
            neighbors: &neighbors,
            own_count: n as usize,
            horizon: HORIZON.into(),
            top_speed: TOP_SPEED.into(),
            slack: SLACK,
            limit: 1000,
        };
        let (mut happened, mut others) = (0, 0);
        for round in 0..6 {
            let before: Vec<[u32; MOVER]> = device.read("movers", n as usize);
            let cpu: Vec<Mover> = before.iter().map(on_cpu).collect();
            let expected: Vec<CollisionEvent> = (0..n).map(|at| window.next_event(&cpu, at)).collect();
            device.run(&k::COLLISIONS_PREDICT, n, round);
            let next: Vec<[u32; NEXT]> = device.read("next_events", n as usize);
            for (at, (found, event)) in next.iter().zip(&expected).enumerate() {
                let time = f64::from(f32::from_bits(found[0]));
                let is_never = event.time == f64::INFINITY && time > 1e38;
                assert!(
                    is_never || (time - event.time).abs() < 2e-5 * (1.0 + event.time),
                    "{axis:?} {round} {at}: {time} and not {}",
                    event.time
                );
            }
            let earliest = expected.iter().map(|event| event.time).fold(f64::INFINITY, f64::min);
            device.run(&k::COLLISIONS_CHOOSE, n, round);
            let next: Vec<[u32; NEXT]> = device.read("next_events", n as usize);
            for (found, event) in next.iter().zip(&expected) {
                let safe = window.safe_from(&cpu, &expected, event, earliest);
                let happens = event.time <= window.horizon && safe.is_some_and(|from| from <= earliest);
                others += u32::from(happens != (found[2] == 1));
            }
            device.run(&k::COLLISIONS_APPLY, n, round);
            let after: Vec<[u32; MOVER]> = device.read("movers", n as usize);
            for (at, found) in next.iter().enumerate() {
                if found[2] == 0 {
                    assert_eq!(before[at], after[at]);
                    continue;
                }
                happened += 1;
                let (outcome, _) = rules.outcome(&cpu, &expected[at]);
                let side = usize::from(expected[at].at[0] != at as u32);
                let (exact, found) = (outcome[side], on_cpu(&after[at]));
                for k in 0..3 {
                    assert!((exact.position[k] - found.position[k]).abs() < 1e-4, "{axis:?} {round} {at}");
                    assert!((exact.motion[k] - found.motion[k]).abs() < 1e-3, "{axis:?} {round} {at}");
                }
            }
        }
        assert!(happened > 40, "{axis:?}: {happened}");
        assert!(others <= 2, "{axis:?}: {others} of {happened} events differ");
    }
}

#[test]
fn separation_matches_the_cpu() {
    let Some(gpu) = device() else { return };
    let mut model = crowd(Contact::Separate, Axis::Reflecting { low: 0.0, high: 5.5 });
    model.reactions = vec![Reaction { reactants: [1, 1], binding_radius: 0.2, ..Reaction::default() }];
    let free_model = model.clone();
    let center = [4.4, 2.4, 2.4];
    let (radius, sees) = (0.8, vec![true, false]);
    model.receivers =
        vec![Receiver { center, radius, sees, kind: ReceiverKind::Reflecting, ..Receiver::default() }];
    let uploaded = movers(&model, 3);
    let n = uploaded.len() as u32;
    let mut particles = Particles::default();
    for mover in uploaded.iter().map(on_cpu) {
        let Mover { position, radius, species, id, .. } = mover;
        let position = position.map(|c| 0.5 * c as f32 + 1.0);
        particles.push(Particle { position, radius, species, id, ..Particle::default() }, false);
    }
    let mut device = Device::new(&gpu, &model, &uploaded);
    let moved: Vec<[f32; 4]> = (0..n as usize)
        .map(|at| {
            let [x, y, z] = particles.position_of(at);
            [x, y, z, particles.radius[at]]
        })
        .collect();
    let free = |at: u32| at % 7 != 3;
    let claims: Vec<[u32; 8]> = (0..n).map(|at| [0, 0, u32::from(!free(at)), 0, 0, 0, 0, 0]).collect();
    let pairs = n * (n - 1) / 2;
    let head = ControlHeader { count: n, pairs, ..ControlHeader::default() };
    gpu.queue.write_buffer(device.run.buffer("control"), 0, bytemuck::bytes_of(&head));
    for (name, bytes) in [
        ("moved", bytemuck::cast_slice(&moved)),
        ("claims", bytemuck::cast_slice(&claims)),
        ("species", bytemuck::cast_slice(&particles.species)),
        ("pushes", &vec![0; (PUSH_BYTES * u64::from(n)) as usize]),
    ] {
        device.buffers.insert(name, written(&gpu, name, bytes));
    }
    let [x, y, z] = center;
    let rows = [[x, y, z, 0.0], [0.0; 4]];
    gpu.queue.write_buffer(device.run.buffer("scene_rows"), 0, bytemuck::bytes_of(&rows));
    let near_pairs = device.buffers["near_pairs"].clone();
    device.buffers.insert("pairs", near_pairs);
    for pass in 0..4 {
        device.run(&k::SEPARATION_PUSH, pairs, pass.min(1));
        device.run(&k::SEPARATION_MOVE, n, 0);
    }
    let all: Vec<lazygrid::Pair> =
        (0..n).flat_map(|j| (0..j).map(move |i| lazygrid::Pair::new(i, j))).collect();
    let mut without_body = particles.clone();
    Contacts::new(&free_model).resolve(&mut without_body, &all, free, StepKey { key: Key::new(1), step: 0 });
    let resolved =
        Contacts::new(&model).resolve(&mut particles, &all, free, StepKey { key: Key::new(1), step: 0 });
    assert_ne!(particles, without_body);
    let control: Vec<u32> = device.read("control", size_of::<ControlHeader>() / 4);
    let contacts = std::mem::offset_of!(ControlHeader, contacts) / 4;
    assert_eq!((u64::from(control[contacts]), resolved > 300), (resolved, true));
    let found: Vec<[f32; 4]> = device.read("moved", n as usize);
    for (at, found) in found.iter().enumerate() {
        for (k, exact) in particles.position_of(at).into_iter().enumerate() {
            assert!((found[k] - exact).abs() < 1e-4, "{at}: {found:?}");
        }
    }
}
