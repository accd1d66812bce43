use std::collections::HashMap;

use lazygrid::Algorithm;

use super::*;
use crate::Simulation;
use crate::gpu::device::encoded;
use crate::gpu::layout::{EventRow, ReceptorRow};
use crate::gpu::{GpuOptions, GpuSimulation};
use crate::model::boundary::Axis;
use crate::model::receiver::{Receiver, ReceiverKind, signed_distance};
use crate::model::receptors::ReceptorType;
use crate::motion::adsorption;
use crate::motion::binding::{rejected, requests};
use crate::motion::path_hit::{Path, first_passage, hit_probability};
use crate::motion::propagate::Event;
use crate::motion::receiver_state::ReceiverState;
use crate::motion::reflection::reflect_path;
use crate::motion::request_counts::tests::request_model;
use crate::motion::wall::reflected;
use crate::random::philox::{Draws, open_unit};

#[test]
fn adsorption_and_unbinding_match_the_cpu() {
    let Some(gpu) = device() else { return };
    let includes = "#include params\nvar<private> params: Params;\n#include philox\n#include normal\n#include unit_32\n#include first_passage\n#include adsorption";
    let body = "let length = ldexp(1.0, i32((k / 24u) % 8u) - 6);
        let surface = surface_of(ldexp(1.0, i32(k % 24u) - 16), length, 0.5);
        params.key = vec2(5u, 6u);
        var draws = Draws(vec4(k, 0u, 3u, PURPOSE_UNBINDING), vec4(0u), 4u);
        let a = 0.25 * length * f32((k / 192u) % 8u);
        let b = max(0.5 * length * f32((k / 1536u) % 8u) - length, -0.375);
        out[k] = bitcast<vec4<u32>>(vec4(adsorption_probability(surface, a, b), effective_part(surface),
            height_after(surface, &draws), length));";
    let found = evaluate(&gpu, includes, body, 12_288);
    let (mut others, time_step) = (0, 0.1);
    for (k, found) in (0..).zip(found) {
        let [stays, fraction, above, scale] = found.map(|word| f64::from(f32::from_bits(word)));
        let length = 2f64.powi((k / 24 % 8) as i32 - 6);
        let reactivity = 2f64.powi((k % 24) as i32 - 16) * length / time_step;
        let step = adsorption::AdsorptionStep::new(length * length, time_step, (0.5, reactivity));
        let heights = [
            0.25 * length * f64::from(k / 192 % 8),
            (0.5 * length * f64::from(k / 1536 % 8) - length).max(-0.375),
        ];
        let close = |found: f64, exact: f64| (found / exact - 1.0).abs() < 1e-5;
        assert_eq!(scale, length);
        let expected = step.sticking(heights);
        assert!((stays - expected).abs() < 2e-5 * expected + 2e-7, "{k}: {stays} and not {expected}");
        assert!(
            close(fraction, step.effective_fraction()),
            "{k}: {fraction} and not {}",
            step.effective_fraction()
        );
        let mut draws = Draws::new(Key([5, 6]), k, 3, Purpose::Unbinding);
        // A trial at the threshold may fall on either side.
        others += u32::from((above - step.height_after(&mut draws)).abs() > 1e-4 * length);
    }
    assert!(others <= 4, "{others} of 12 288 heights differ");
}

fn spheres(displacements: [[f32; 3]; 3]) -> ([Receiver; 3], String) {
    let receiver =
        |center, radius| Receiver { center, radius, kind: ReceiverKind::Reflecting, ..Receiver::default() };
    let receivers = [
        receiver([0.0, 0.25, 0.0], 0.5),
        receiver([1.0, 0.0, 0.5], 0.375),
        receiver([-1.5, -1.0, 0.0], 0.75),
    ];
    let vector = |[x, y, z]: [f32; 3]| format!("vec3<f32>({x:?}, {y:?}, {z:?})");
    let mut text = String::new();
    for (k, (receiver, displacement)) in receivers.iter().zip(displacements).enumerate() {
        let (center, radius) = (vector(receiver.center), receiver.radius);
        text += &format!("scene_rows[{}] = bitcast<vec4<u32>>(vec4({center}, 0.0));\n", 2 * k);
        text += &format!(
            "scene_rows[{}] = bitcast<vec4<u32>>(vec4({}, 0.0));\n",
            2 * k + 1,
            vector(displacement)
        );
        text += &format!("event_rows[{k}].radius = {radius:?};\nevent_rows[{k}].kind = REFLECTING;\n");
        text += &format!("event_rows[{k}].receiver = {k}u;\n");
    }
    (receivers, text)
}

#[test]
fn paths_reflect_as_on_the_cpu() {
    let Some(gpu) = device() else { return };
    let includes = "const NOTHING: u32 = 0xffffffffu;\nstruct Now { step: u32 }\nvar<private> control: Now;
#include params
var<private> params: Params;
#include philox
#include boundary
#include event
var<private> trajectory: TrajectoryHeader;
var<private> event_rows: array<EventRow, 3>;
var<private> scene_rows: array<vec4<u32>, 6>;
#include receiver_cells
#include no_membranes
#include reflection";
    let boundaries = [
        (Boundary::default(), 0),
        (Boundary::reflecting([-2.0; 3], [2.0; 3]), 1),
        (Boundary::periodic([-2.0; 3], [2.0; 3]), 2),
    ];
    for (boundary, axes) in boundaries {
        for displacements in [[[0.0; 3]; 3], [[0.25, 0.0, 0.0], [0.0, -0.5, 0.125], [0.0; 3]]] {
            let (receivers, text) = spheres(displacements);
            let walls = "params.low = vec3(-2.0); params.high = vec3(2.0);";
            let body = format!(
                "{text} {walls} params.axes = vec3({axes}u); params.is_open = {};
                let words = philox(vec4(k, 1u, 2u, 3u), vec2(4u, 5u));
                let more = philox(vec4(k, 2u, 2u, 3u), vec2(4u, 5u));
                let before = 4.0 * vec3(open_unit(words.x), open_unit(words.y), open_unit(words.z)) - 2.0;
                let end = before + 4.0 * (vec3(open_unit(more.x), open_unit(more.y), open_unit(more.z)) - 0.5);
                trajectory.max_displacement = 0.6; params.time_step = 1.0; params.max_requeries = 8u;
                var kind: SpeciesRow;
                kind.decays_begin = 3u; kind.cell_lists = NOTHING;
                var path: Path;
                path.before = before; path.end = end; path.after = confined(end, 0.0);
                let reflected = reflect_path(kind, path);
                out[k] = vec4(bitcast<vec3<u32>>(reflected.after), reflected.first + 1u);",
                u32::from(axes == 0)
            );
            let count = 20_000;
            let (mut bounced, mut others) = (0, 0);
            for (k, [x, y, z, first]) in (0..).zip(evaluate(&gpu, includes, &body, count)) {
                let units = |word: u32| philox([k, word, 2, 3], [4, 5]).map(open_unit);
                let [before, random_units] = [units(1), units(2)];
                let before: [f32; 3] = std::array::from_fn(|k| 4.0 * before[k] - 2.0);
                let end = std::array::from_fn(|k| before[k] + 4.0 * (random_units[k] - 0.5));
                let path = Path {
                    before,
                    end,
                    after: boundary.confine(end),
                    free: end,
                    drift: [0.0; 3],
                    diffusion: 0.0,
                };
                let states: Vec<ReceiverState> = (0..)
                    .zip(receivers.clone().into_iter().zip(displacements))
                    .map(|(index, (receiver, displacement))| ReceiverState {
                        displacement,
                        ..ReceiverState::new(index, receiver, 1.0)
                    })
                    .collect();
                let is_outside = |state: &&ReceiverState| {
                    signed_distance(state.receiver.radius, state.center, &boundary, before) >= 0.0
                };
                let around: Vec<&ReceiverState> = states.iter().filter(is_outside).collect();
                let expected = reflect_path(&around, &boundary, &path, &mut [0.0; 3]);
                let (after, by) =
                    expected.map_or((path.after, 0), |reflected| (reflected.path.after, reflected.first + 1));
                let found = [x, y, z].map(f32::from_bits);
                bounced += u32::from(first > 0);
                // A grazing reflection amplifies rounding.
                let near = found.into_iter().zip(after).all(|(a, b)| (a - b).abs() < 1e-3);
                others += u32::from(first != by || !near);
            }
            assert!(bounced > 500, "{bounced}");
            assert!(
                others <= count / 1000,
                "{others} of {count} paths differ, axes {axes}, {displacements:?}"
            );
        }
    }
}

/// Receptors and occupied ones: enough for all, some or no requests.
const RECEPTORS: [[u32; 2]; 3] = [[5_000, 100], [900, 7], [40, 40]];

#[derive(Default)]
struct Crowd {
    spheres: Vec<[f32; 4]>,
    claims: Vec<[u32; 8]>,
    events: Vec<Event>,
    requests: [u32; 3],
}

fn crowd(count: u32) -> Crowd {
    let mut crowd = Crowd::default();
    let mut bound = [0; 3];
    for at in 0..count {
        let [rank, which, ..] = philox([at, 9, 0, 0], [3, 0]);
        let receiver = which % 3;
        let index = receiver as usize;
        let is_bound = bound[index] < RECEPTORS[index][1];
        bound[index] += u32::from(is_bound);
        let sphere = [0.0, 0.0, 1.0, -2.0 - receiver as f32];
        crowd.spheres.push(if is_bound { sphere } else { [0.5, 0.5, 0.5, 0.25] });
        let rank = rank % 7 * 0x1234_5678;
        let request = [rank, crowd.requests[index], 2, receiver, at, 2, 3, 0];
        let requests = !is_bound && at % 4 != 0;
        crowd.claims.push(if requests { request } else { [0; 8] });
        if requests {
            crowd.requests[index] += 1;
            crowd.events.push(Event::Bound { at, receiver, receptor: receiver, direction: [0.0; 3], rank });
        }
    }
    crowd
}

fn id_of(at: u32) -> u32 {
    (at * 37 + 11) % 1_000_003
}

struct SelectionResult {
    moved: Vec<[f32; 4]>,
    claims: Vec<[u32; 8]>,
    bound: Vec<u32>,
    tallies: Vec<u32>,
    removed: u32,
}

fn buffers_of_three(gpu: &GpuDevice) -> RunBuffers {
    let mut model = model();
    model.species.truncate(1);
    model.reactions.clear();
    let kind = ReceiverKind::Receptors(vec![ReceptorType::new(1, 1.0, 1.0, [0])]);
    model.receivers = vec![Receiver { sees: vec![true], kind, ..Receiver::default() }; 3];
    RunBuffers::new(gpu.clone(), &Tables::new(&model, Key::new(1), 64), 0).expect("buffers")
}

/// Bytes of a receptor type.
const ROW: u64 = size_of::<ReceptorRow>() as u64;

fn choose(gpu: &GpuDevice, crowd: &Crowd) -> SelectionResult {
    let count = crowd.spheres.len() as u32;
    let mut buffers = buffers_of_three(gpu);
    let row = |(&[count, _], k): (&[u32; 2], u32)| ReceptorRow {
        count,
        tally: 6 + 2 * k,
        ..ReceptorRow::default()
    };
    let rows: Vec<ReceptorRow> = RECEPTORS.iter().zip(0..).map(row).collect();
    let event_rows: Vec<EventRow> =
        (0..3).map(|k| EventRow { receptor: k, tally: k, occupied: 3 + k, ..EventRow::default() }).collect();
    let tags: Vec<[u32; 2]> = (0..count).map(|at| [0, id_of(at)]).collect();
    let made: HashMap<&str, wgpu::Buffer> = [
        ("spheres", written(gpu, "spheres", bytemuck::cast_slice(&crowd.spheres))),
        ("moved", written(gpu, "moved", bytemuck::cast_slice(&crowd.spheres))),
        ("tags", written(gpu, "tags", bytemuck::cast_slice(&tags))),
        ("claims", written(gpu, "claims", bytemuck::cast_slice(&crowd.claims))),
        ("event_rows", written(gpu, "event_rows", &encoded(&event_rows))),
        ("receptors", written(gpu, "receptors", &encoded(&rows))),
        ("requesters", written(gpu, "requesters", &vec![0; 4 * count as usize])),
        ("control", buffers.buffer("control").clone()),
    ]
    .into();
    let head = ControlHeader { count, ..ControlHeader::default() };
    gpu.queue.write_buffer(&made["control"], 0, bytemuck::bytes_of(&head));
    let all = count.div_ceil(k::WORKGROUP_SIZE);
    let mut recorded = |stages: &[(&'static k::Kernel, u32)]| {
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        for &(kernel, groups) in stages {
            let stage = buffers.stage(kernel, Groups::Fixed(groups), |name| made[name].clone());
            stage.expect("a stage").encode(&mut encoder, groups);
        }
        encoder
    };
    let begin = recorded(&[(&k::RECEPTORS_RESET, 1), (&k::RECEPTORS_COUNT_BOUND, all)]);
    gpu.queue.submit([begin.finish()]);
    for (k, count) in crowd.requests.iter().enumerate() {
        gpu.queue.write_buffer(&made["receptors"], ROW * k as u64 + 8, bytemuck::bytes_of(count));
    }
    let encoder = recorded(&[
        (&k::RECEPTORS_SCAN_REQUESTS, 1),
        (&k::RECEPTORS_GROUP_REQUESTS, all),
        (&k::RECEPTORS_SELECT, 3),
    ]);
    let sources = [
        (&made["moved"], 16 * u64::from(count)),
        (&made["claims"], CLAIM_BYTES * u64::from(count)),
        (&made["receptors"], 3 * ROW),
        (&made["control"], size_of::<ControlHeader>() as u64 + 48),
    ];
    let read = read(gpu, encoder, &sources).expect("read");
    let receptors: Vec<[u32; 5]> = bytemuck::pod_collect_to_vec(&read[2]);
    let head: ControlHeader = bytemuck::pod_read_unaligned(&read[3][..size_of::<ControlHeader>()]);
    SelectionResult {
        moved: bytemuck::pod_collect_to_vec(&read[0]),
        claims: bytemuck::pod_collect_to_vec(&read[1]),
        bound: receptors.iter().map(|row| row[1]).collect(),
        tallies: bytemuck::pod_collect_to_vec(&read[3][size_of::<ControlHeader>()..]),
        removed: head.removed,
    }
}

#[test]
fn lowest_ranks_bind_to_free_receptors() {
    let Some(gpu) = device() else { return };
    let crowd = crowd(5_000);
    let Crowd { spheres, claims, events, requests: counts } = &crowd;
    let free = RECEPTORS.map(|[count, bound]| count - bound);
    let expected = rejected(requests(events, id_of), &free);
    assert!(counts[1] > free[1] && free[2] == 0 && expected.len() > 1000);

    let SelectionResult { moved, claims: after, bound, tallies, removed } = choose(&gpu, &crowd);
    assert_eq!(bound, RECEPTORS.map(|[_, bound]| bound));
    assert!(after.iter().all(|claim| claim[2] == 0));
    let stays = |event: &&Event| moved[event.at() as usize] == spheres[event.at() as usize];
    let mut rejected: Vec<u32> = events.iter().filter(stays).map(|event| id_of(event.at())).collect();
    rejected.sort_unstable();
    assert_eq!(rejected, expected);
    for event in events {
        let (at, Event::Bound { receiver, .. }) = (event.at() as usize, event) else { continue };
        let direction = f32::from_bits(claims[at][4]);
        // Devices may flush such numbers to zero.
        let is_bound = moved[at][3] == -2.0 - *receiver as f32 && (moved[at][0] - direction).abs() < 1e-30;
        assert!(is_bound || moved[at] == spheres[at], "{:?}", moved[at]);
    }
    let bound: Vec<u32> = (0..3).map(|k| counts[k].min(free[k])).collect();
    let requests: Vec<u32> = (0..3).flat_map(|k| [counts[k], counts[k] - bound[k]]).collect();
    assert_eq!((tallies, removed), ([&bound, &bound, &requests[..]].concat(), bound.iter().sum()));
}

#[test]
fn refused_requests_are_counted_as_on_the_cpu() {
    let Some(gpu) = device() else { return };
    let mut model = request_model(0.004);
    model.receivers[0].kind = ReceiverKind::Receptors(vec![
        ReceptorType::new(30, 2.0, 5.0, [0]),
        ReceptorType::new(2, 300.0, 100.0, [0]),
    ]);
    let mut expected = Simulation::new(model.clone(), 3, Algorithm::Auto).expect("a run");
    (0..12).for_each(|_| expected.step().expect("a step"));
    let mut run = GpuSimulation::new(model.clone(), 3, gpu, GpuOptions::default()).expect("a run");
    run.run(5).expect("steps");
    run.run(7).expect("steps");
    assert_eq!(run.requests(), &expected.requests);
    let warnings = run.requests().warnings(&model);
    assert!(warnings.len() == 1 && warnings == expected.requests.warnings(&model), "{warnings:?}");
}

#[test]
fn hits_and_hit_times_match_the_cpu() {
    let Some(gpu) = device() else { return };
    let includes = "#include params\nvar<private> params: Params;\n#include philox\n#include normal\n#include first_passage\n#include wall";
    let body = "let words = philox(vec4(k, 1u, 2u, 3u), vec2(4u, 5u));
        let more = philox(vec4(k, 2u, 2u, 3u), vec2(4u, 5u));
        let a = 2.0 * open_unit(words.x);
        let b = 2.0 * open_unit(words.y);
        let diffusion = ldexp(0.5, i32(k % 12u) - 5);
        let normal = normals(more).x;
        out[k] = bitcast<vec4<u32>>(vec4(hit_probability(0.75, a, b, diffusion),
            first_passage(vec2(a, b - 1.0), normal, open_unit(words.z)),
            reflected_at_wall(-0.5, 8.0, vec2(a - 0.5, b - 1.5), 0.7, words.w), normal));";
    let found = evaluate(&gpu, includes, body, 4096);
    let mut others = 0;
    for (k, found) in (0..).zip(found) {
        let words = philox([k, 1, 2, 3], [4, 5]);
        let [hit, time, end, normal] = found.map(f32::from_bits);
        let [a, b] = [2.0 * open_unit(words[0]), 2.0 * open_unit(words[1])];
        let diffusion = 0.5 * 2_f32.powi((k % 12) as i32 - 5);
        let expected = hit_probability(0.75, [a, b], diffusion);
        assert!((hit - expected).abs() <= 1e-5 * expected + 1e-9, "{k}: {hit} and not {expected}");
        let expected = first_passage([a, b - 1.0], normal, open_unit(words[2]));
        // A uniform number at the threshold may choose either root.
        others += u32::from((time - expected).abs() > 1e-5);
        let axis = Axis::Reflecting { low: -0.5, high: 8.0 };
        let expected = reflected(axis, [a - 0.5, b - 1.5], 0.7, words[3]).unwrap_or(b - 1.5);
        assert!((end - expected).abs() < 1e-5, "{k}: {end} and not {expected}");
    }
    assert!(others <= 2, "{others} of 4096 times differ");
}
