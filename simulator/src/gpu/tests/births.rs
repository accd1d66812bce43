use super::*;
use crate::Decay;

#[test]
fn second_products_follow_in_the_order_of_their_parents() {
    let Some(gpu) = device() else { return };
    let mut model = model();
    model.logs_arrivals = true;
    let products = [Some(0), Some(1)];
    model.decays = vec![Decay { reactant: 0, products, rate: 1.0, ..Decay::default() }];
    let tables = Tables::new(&model, Key::new(1), 64);
    for (count, halted) in [(1, 0), (2, 0), (255, 0), (257, 0), (20_000, 0), (300, 1)] {
        let mut buffers = RunBuffers::new(gpu.clone(), &tables, 0).expect("buffers");
        let id = |k: u32| philox([k, 0, 0, 0], [8, 0])[0] & 0x7fff_0000 | k;
        let mut keys: Vec<[u32; 2]> = (0..count).map(|k| [id(k), k]).collect();
        let born: Vec<[u32; 8]> = (0..count).map(|k| [k, 1, 2, 3, 4, 5, 6, 7 + k % 3]).collect();
        let (survivors, events) = (3_u32, 2_u32);
        let head = ControlHeader {
            count: 9,
            alive: survivors + count,
            halted,
            step: 6,
            done: 7,
            born: count,
            born_at: survivors,
            born_id: 1 << 31,
            next_id: (1 << 31) + count,
            born_event: events,
            ..ControlHeader::default()
        };
        let rows = (survivors + count) as usize;
        let with = |name, bytes: &[u8]| written(&gpu, name, bytes);
        let made: std::collections::HashMap<&str, wgpu::Buffer> = [
            ("born", with("born", bytemuck::cast_slice(&born))),
            ("born_keys0", with("born_keys0", bytemuck::cast_slice(&keys))),
            ("born_keys1", with("born_keys1", &vec![0; 8 * count as usize])),
            ("spheres", with("spheres", &vec![0; 16 * rows])),
            ("tags", with("tags", &vec![0; 8 * rows])),
            ("events", with("events", &vec![0; 16 * (events + count) as usize])),
            ("params", buffers.buffer("params").clone()),
            ("control", buffers.buffer("control").clone()),
        ]
        .into();
        gpu.queue.write_buffer(&made["control"], 0, bytemuck::bytes_of(&head));
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        for (kernel, groups) in [(&k::BORN_SORT, 1), (&k::BORN_PLACE, count.div_ceil(k::WORKGROUP_SIZE))] {
            let stage = buffers.stage(kernel, Groups::Fixed(groups), |name| made[name].clone());
            stage.expect("a stage").encode(&mut encoder, groups);
        }
        let sources = [
            (&made["spheres"], 16 * rows as u64),
            (&made["tags"], 8 * rows as u64),
            (&made["events"], 16 * u64::from(events + count)),
        ];
        let read = read(&gpu, encoder, &sources).expect("read");
        let spheres: Vec<[u32; 4]> = bytemuck::pod_collect_to_vec(&read[0]);
        let tags: Vec<[u32; 2]> = bytemuck::pod_collect_to_vec(&read[1]);
        let logged: Vec<[u32; 4]> = bytemuck::pod_collect_to_vec(&read[2]);
        if halted == 1 {
            assert!(spheres.iter().flatten().chain(logged.iter().flatten()).all(|&word| word == 0));
            continue;
        }
        keys.sort_unstable();
        for (rank, &[parent, k]) in (0..).zip(&keys) {
            let at = (survivors + rank) as usize;
            assert_eq!(spheres[at], [k, 1, 2, 3], "{count}: {rank}");
            assert_eq!(tags[at], [7 + k % 3, (1 << 31) + rank], "{count}: {rank}");
            let entry = logged[(events + rank) as usize];
            assert_eq!(entry, [6, crate::gpu::layout::NOTHING, rank, parent], "{count}: {rank}");
        }
    }
}
