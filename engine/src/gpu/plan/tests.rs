use super::*;
use crate::Error;

const LAVAPIPE: DeviceLimits = DeviceLimits {
    storage_binding: 128 << 20,
    buffer: (1 << 31) - 1,
    groups_per_dimension: 65_535,
    storage_buffers: 32,
    workgroup_memory: 32 << 10,
};
const H200: DeviceLimits = DeviceLimits { storage_binding: (1 << 31) - 4, buffer: 4_292_870_144, ..LAVAPIPE };

fn request(spheres: u32, pairs: u32) -> Request {
    Request {
        spheres,
        pairs,
        entries: 0,
        algorithm: Algorithm::ArrayGrid,
        has_species: false,
        periodic: false,
        columns: None,
        radix_sort_from: 1 << 19,
        max_tests: u64::MAX,
        deferred_parts: 1,
    }
}

#[test]
fn plans_fit_their_devices_or_say_why_not() {
    for limits in [LAVAPIPE, H200] {
        for spheres in [0, 1, 2, 255, 256, 257, 1 << 20, 4_000_000, 8 << 20, 100_000_000, u32::MAX] {
            match plan(&request(spheres, 1 << 20), &limits) {
                Ok(plan) => {
                    assert!(plan.buffers.iter().all(|(_, bytes)| (1..=limits.bytes()).contains(bytes)));
                    assert!(plan.entries >= spheres && u64::from(plan.entries) <= 8 * u64::from(spheres));
                    for dispatch in &plan.dispatches {
                        let [x, y] = flattened(dispatch.groups, &limits);
                        assert!(x <= 65_535 && y <= 65_535, "{dispatch:?}");
                        assert!(u64::from(x) * u64::from(y) >= u64::from(dispatch.groups));
                    }
                }
                Err(Error::LimitExceeded { needed, limit, .. }) => {
                    assert!(needed > limit, "{spheres}: {needed} {limit}");
                    assert!(u64::from(spheres) * 16 > limits.bytes(), "{spheres} should fit");
                }
                Err(other) => panic!("{spheres}: {other}"),
            }
        }
    }
}

/// Slabs depend on this number alone. All pairs are excluded, for which too many workgroups are refused.
#[test]
fn the_most_spheres_that_can_be_bound_can_be_searched() {
    for limits in [LAVAPIPE, H200, DeviceLimits { storage_binding: 8 << 20, ..LAVAPIPE }] {
        let most = u32::try_from(most_spheres(&limits)).expect("indices have 32 bits");
        let grids = Algorithm::GPU.iter().copied().filter(|&algorithm| algorithm != Algorithm::Naive);
        for (algorithm, periodic) in grids.flat_map(|algorithm| [(algorithm, false), (algorithm, true)]) {
            let request = Request { algorithm, periodic, has_species: true, ..request(most, 1) };
            plan(&request, &limits).unwrap_or_else(|error| panic!("{algorithm}, {limits:?}: {error}"));
        }
    }
}

/// A sphere may have all others as candidates.
#[test]
fn no_sphere_has_more_chunks_of_candidates_than_workgroups_can_be_dispatched() {
    let metal = DeviceLimits { storage_binding: 1 << 36, buffer: 1 << 36, ..H200 };
    let most = most_spheres(&metal);
    let later_chunks = (most - 1).div_ceil(k::CANDIDATES_PER_INVOCATION.into()) - 1;
    assert!(most > most_spheres(&H200) && later_chunks <= 65_535, "{later_chunks} chunks of {most} spheres");
    let request = Request { algorithm: Algorithm::CellList, ..request(most as u32 + 1, 1) };
    let error = plan(&request, &metal).expect_err("too many");
    assert!(matches!(error, Error::LimitExceeded { what: "the number of spheres", .. }), "{error}");
}

#[test]
fn four_million_spheres_have_capacity_for_all_entries_on_lavapipe() {
    assert_eq!(plan(&request(4_000_000, 1 << 20), &LAVAPIPE).expect("fits").entries, 32_000_000);
}

#[test]
fn a_pair_buffer_beyond_the_limit_is_refused() {
    let error = plan(&request(100, 1 << 25), &LAVAPIPE).expect_err("268 MB");
    assert!(matches!(error, Error::LimitExceeded { what: "the pair buffer", .. }), "{error}");
}

#[test]
fn passes_follow_the_spheres() {
    let bits = [2, 1000, 65_535, 65_536, 1_000_000, 10_000_000, 16_777_216, u32::MAX].map(key_bits);
    assert_eq!(bits, [16, 16, 16, 24, 24, 24, 32, 32]);
}

#[test]
fn every_binding_has_a_resource_and_sort_passes_alternate() {
    let request = Request { has_species: true, periodic: true, ..request(10_000_000, 1) };
    let plan = plan(&request, &H200).expect("fits");
    let variant = k::Variant { species: true, periodic: true, ..k::Variant::default() };
    for dispatch in &plan.dispatches {
        let resources: Vec<_> =
            dispatch.kernel.bindings(variant).map(|b| plan.resource(dispatch, b.name)).collect();
        for (position, resource) in resources.iter().enumerate() {
            assert!(!resources[..position].contains(resource), "{dispatch:?} binds {resource:?} twice");
        }
    }
    let last = plan.dispatches.iter().rfind(|s| s.kernel == &k::RADIX_SCATTER).expect("sorts");
    let search = plan.dispatches.iter().find(|s| s.kernel == &k::RUNS_SEARCH_NEAR).expect("searches");
    assert_eq!(plan.resource(last, "sorted_keys"), plan.resource(search, "keys"));
}

#[test]
fn grid_without_capacity_for_an_entry_per_sphere_is_refused() {
    let small = DeviceLimits { storage_binding: 1 << 20, ..LAVAPIPE };
    assert!(matches!(plan(&request(1 << 20, 1), &small), Err(Error::LimitExceeded { .. })));
}

#[test]
fn no_invocation_exceeds_the_loop_iterations() {
    let sizes = (0..=24).flat_map(|k| [(1 << k) - 1, 1 << k, (1 << k) + 1, 3 << k >> 1]);
    for spheres in sizes.filter(|&n: &u32| n <= 1 << 24) {
        for limits in [LAVAPIPE, H200] {
            for &algorithm in Algorithm::GPU {
                let Ok(plan) = plan(&Request { algorithm, ..request(spheres, 1) }, &limits) else {
                    assert!(u64::from(spheres) * 16 > limits.bytes(), "{spheres} should fit");
                    continue;
                };
                for dispatch in &plan.dispatches {
                    let iterations = plan.iterations(dispatch);
                    assert!(
                        iterations <= k::MAX_LOOP_ITERATIONS.into(),
                        "{algorithm}, {spheres}: {iterations} in {dispatch:?}"
                    );
                }
                let tiles = plan.entries.div_ceil(k::WORKGROUP_SIZE);
                assert!(tiles.div_ceil(k::RUN_TILES) <= limits.groups_per_dimension);
            }
        }
    }
}

#[test]
fn periodic_spaces_take_a_copy_of_the_spheres_and_one_dispatch_more() {
    for algorithm in [Algorithm::Naive, Algorithm::ArrayGrid, Algorithm::EagerGrid, Algorithm::LazyGrid] {
        let [open, periodic] = [false, true].map(|periodic| {
            plan(&Request { algorithm, periodic, ..request(1_000_000, 1) }, &H200).expect("fits")
        });
        assert_eq!(periodic.bytes() - open.bytes(), 16_000_000, "{algorithm}");
        let reader = |plan: &Plan| plan.dispatches.iter().find(|s| s.kernel == &k::BOUNDS_REDUCE).cloned();
        let bound = |plan: &Plan| plan.resource(&reader(plan).expect("a dispatch"), "spheres");
        assert_eq!(bound(&open), Resource::Spheres);
        assert_eq!(bound(&periodic), Resource::Own(BufferId::Wrapped));
        assert_eq!(periodic.dispatches[1].kernel, &k::SPHERES_WRAP);
        let rest = periodic.dispatches.iter().filter(|dispatch| dispatch.kernel != &k::SPHERES_WRAP);
        assert!(rest.eq(&open.dispatches), "{algorithm}");
    }
}

#[test]
fn columns_take_rows_and_one_dispatch_more() {
    let columns = Some(ColumnLayout { first: [0, 1, 2, 5], stride: [8, 8, 8, 0] });
    for &algorithm in Algorithm::GPU {
        let [rows, columns] = [None, columns].map(|columns| {
            plan(&Request { algorithm, columns, ..request(100_000, 1) }, &H200).expect("fits")
        });
        assert_eq!(columns.bytes() - rows.bytes(), 1_600_000, "{algorithm}");
        assert_eq!(columns.dispatches[1..], rows.dispatches, "{algorithm}");
        assert_eq!(columns.resource(&rows.dispatches[0], "given"), Resource::Own(BufferId::Rows));
    }
    let config = crate::gpu::GpuConfig::default().columns(columns).algorithm(Algorithm::CellList);
    let call = Planner::new(config, H200).plan(1000).expect("fits");
    let size = |name: &str| call.buffers.iter().find(|buffer| buffer.name == name).map(|buffer| buffer.size);
    assert_eq!(
        ["x", "z", "r", "rows", "spheres"].map(size),
        [Some(4 * (8 * 999 + 1)), Some(4 * (2 + 8 * 999 + 1)), Some(24), Some(16_000), None]
    );
    let vast = Some(ColumnLayout { stride: [1 << 30; 4], ..ColumnLayout::default() });
    let error = plan(&Request { columns: vast, ..request(1000, 1) }, &H200).expect_err("4 TB");
    assert!(matches!(error, Error::LimitExceeded { what: "the sphere buffer", .. }), "{error}");
}

#[test]
fn all_pairs_of_too_many_spheres_are_refused() {
    let request = Request { algorithm: Algorithm::Naive, ..request(100_000_000, 1) };
    let error = plan(&request, &H200).expect_err("4.9 · 10¹¹ tiles");
    let Error::LimitExceeded { needed, limit, remedy, .. } = error else { panic!("{error}") };
    assert!(needed > limit && remedy.contains("array-grid"), "{needed} {limit}");
}

fn list(spheres: u32, periodic: bool) -> Plan {
    let request = Request { algorithm: Algorithm::CellList, periodic, ..request(spheres, 1) };
    plan(&request, &H200).expect("fits")
}

#[test]
fn a_cell_list_is_small_and_has_few_dispatches() {
    let measured = [2000, 10_000, 400_000, 1_000_000, 10_000_000, 100_000_000].map(|spheres| {
        let plan = list(spheres, false);
        (spheres, plan.bytes() / u64::from(spheres), plan.dispatches.len())
    });
    let expected = [
        (2000, 50, 5),
        (10_000, 45, 5),
        (400_000, 49, 12),
        (1_000_000, 42, 18),
        (10_000_000, 40, 18),
        (100_000_000, 38, 21),
    ];
    assert_eq!(measured, expected, "spheres, bytes of each, dispatches");
}

#[test]
fn reused_cells_take_fewer_dispatches_and_bytes() {
    let measured = [10_000, 30_000, 100_000, 1_000_000, 10_000_000, 100_000_000].map(|spheres| {
        let bytes = |plan: &Plan| plan.cost().traffic_bytes.map_or(0, |bytes| bytes / u64::from(spheres));
        let [whole, mut reusing] = [list(spheres, false), list(spheres, false)];
        reusing.reuse_layout();
        assert_eq!(whole.bytes(), reusing.bytes(), "the same buffers");
        (spheres, [whole.dispatches.len(), reusing.dispatches.len()], [bytes(&whole), bytes(&reusing)])
    });
    let expected = [
        (10_000, [5, 4], [268, 252]),
        (30_000, [8, 6], [280, 264]),
        (100_000, [12, 9], [285, 264]),
        (1_000_000, [18, 15], [184, 168]),
        (10_000_000, [18, 15], [181, 168]),
        (100_000_000, [21, 18], [200, 188]),
    ];
    assert_eq!(measured[..], expected, "spheres, dispatches and bytes of each");
}

#[test]
fn a_cell_list_moves_few_bytes() {
    let moved = [400_000, 1_000_000, 10_000_000, 100_000_000].map(|spheres| {
        let cost = list(spheres, false).cost();
        assert_eq!(cost.working_bytes + cost.pair_bytes, list(spheres, false).bytes());
        cost.traffic_bytes.map(|bytes| bytes / u64::from(spheres))
    });
    assert_eq!(moved, [285, 184, 181, 200].map(Some), "of each sphere");
    let divided = Request { algorithm: Algorithm::CellList, max_tests: 1 << 28, ..request(1_000_000, 1) };
    let [whole, parts] =
        [list(1_000_000, false), plan(&divided, &H200).expect("fits")].map(|plan| plan.cost());
    assert!(parts.dispatches > whole.dispatches);
    assert_eq!(
        parts.traffic_bytes.map(|bytes| bytes / 1_000_000),
        Some(184),
        "the same for a divided search"
    );
    assert_eq!(plan(&request(1000, 1), &H200).expect("fits").cost().traffic_bytes, None);
}

#[test]
fn cell_list_is_sorted_by_counting_below_the_setting() {
    let kernels =
        |plan: &Plan| plan.dispatches.iter().map(|dispatch| dispatch.kernel.name).collect::<Vec<_>>();
    let (counted, sorted) = (kernels(&list((1 << 19) - 1, false)), kernels(&list(1 << 19, false)));
    assert!(counted.contains(&"cells_count") && !counted.contains(&"radix_scatter"), "{counted:?}");
    assert!(sorted.contains(&"radix_scatter") && !sorted.contains(&"cells_count"), "{sorted:?}");
    // The cells of a periodic axis form a ring, so no dispatch wraps the spheres.
    assert_eq!(list(1 << 19, true).dispatches, list(1 << 19, false).dispatches);
}

#[test]
fn keys_of_cells_have_digits_of_equal_width() {
    for (bits, shifts) in [(16, vec![0, 8]), (18, vec![0, 6, 12]), (25, vec![0, 7, 14, 21]), (0, vec![])] {
        let passes = digits(bits, true);
        assert_eq!(passes.iter().map(|pass| pass.shift).collect::<Vec<_>>(), shifts);
        let covered = passes.iter().fold(0, |covered, pass| covered | pass.mask << pass.shift);
        assert_eq!(covered, (1_u64 << bits) as u32 - 1, "{bits}");
    }
}

impl Plan {
    fn iterations(&self, dispatch: &Dispatch) -> u64 {
        // Loops over reads of one thread, over subgroups, and over 256 samples on three axes.
        const FIXED: u64 = 1024;
        let kernel = dispatch.kernel;
        if kernel == &k::NAIVE_SEARCH {
            let blocks = self.spheres.div_ceil(k::WORKGROUP_SIZE).max(1);
            let groups_per_block = (self.search_groups / blocks).clamp(1, blocks);
            u64::from(blocks.div_ceil(groups_per_block)) * u64::from(k::NAIVE_ITERATIONS_PER_TILE)
        } else if kernel == &k::RUNS_SEARCH_FAR {
            u64::from(k::RUN_TILES * k::RUN_ITERATIONS_PER_TILE + u32::BITS)
        } else if kernel == &k::SCAN_SPINE {
            let tiles = self.counters.div_ceil(k::SCAN_TILE);
            FIXED * u64::from(tiles.div_ceil(k::SCAN_TILE)) / 32
        } else if kernel == &k::RADIX_SCAN {
            let tiles = self.entries.max(self.spheres).div_ceil(self.tile.max(1));
            FIXED * u64::from(tiles.div_ceil(k::SCAN_TILE)) / 32
        } else if [&k::CELL_LIST_SEARCH, &k::CELL_LIST_SEARCH_OVERFLOW].contains(&kernel) {
            u64::from(self.candidates_per_invocation)
                + u64::from(2 * self.candidates_per_invocation * k::WORKGROUP_SIZE / 1024 * 5)
        } else if kernel == &k::ENTRIES_EMIT {
            // At each level eight cells, a scan over at most 64 subgroups, and eight entries.
            u64::from(k::DEPTHS) * (1 + 8 + 64 + 8)
        } else {
            FIXED
        }
    }
}

/// Floats round at and above 2²⁴: for 83 333 332 spheres, 500 cells per axis are two more than requested.
#[test]
fn cell_list_has_counters_for_all_cells_of_the_device() {
    let limits = DeviceLimits { storage_binding: u32::MAX.into(), buffer: u32::MAX.into(), ..LAVAPIPE };
    let mut rounded = 0;
    for around in 200..=700_u32 {
        let cells = around.pow(3);
        for spheres in cells / 3 * 2 - 8..=cells / 3 * 2 + 8 {
            let request = Request { algorithm: Algorithm::CellList, ..request(spheres, 1) };
            let Ok(plan) = plan(&request, &limits) else { continue };
            let is_taken = (around * around) as f32 * around as f32 <= plan.cells as f32;
            assert!(!is_taken || cells + 2 <= plan.counters, "{spheres} spheres, {around} cells around");
            rounded += u32::from(is_taken && cells > plan.cells);
        }
    }
    assert!(rounded > 0, "no number is rounded");
}

#[test]
fn tiny_budgets_divide_each_search_and_nothing_else() {
    for &algorithm in Algorithm::GPU {
        for spheres in [10_000, 100_000] {
            let request = Request { algorithm, ..request(spheres, 1) };
            let whole = plan(&request, &LAVAPIPE).expect("fits");
            assert_eq!(whole.parts(), 1, "{algorithm}, {spheres}");
            let max_tests = 1 << 22;
            let parted = plan(&Request { max_tests, ..request }, &LAVAPIPE).expect("fits");
            assert!(parted.parts() > 2, "{algorithm}, {spheres}: {} parts", parted.parts());
            let mut groups = Vec::new();
            for dispatch in &parted.dispatches {
                match dispatch.first_group {
                    0 => groups.push((dispatch.kernel.name, dispatch.groups)),
                    first => {
                        let (name, before) = groups.last_mut().expect("a first part");
                        assert_eq!((*name, *before), (dispatch.kernel.name, first), "{algorithm}");
                        assert_eq!(dispatch.phase, GpuPhase::Search, "{algorithm}");
                        *before += dispatch.groups;
                    }
                }
            }
            let expected: Vec<_> = whole.dispatches.iter().map(|d| (d.kernel.name, d.groups)).collect();
            assert_eq!(groups, expected, "{algorithm}, {spheres}");
        }
    }
}

#[test]
fn deferred_parts_follow_the_outcome() {
    let request = Request { algorithm: Algorithm::CellList, max_tests: 1 << 27, ..request(1 << 20, 1) };
    let list = plan(&request, &H200).expect("fits");
    let outcome = |deferred_blocks, deferred_max_tiles| {
        let mut outcome = Outcome::default();
        (outcome.deferred_blocks, outcome.deferred_max_tiles) = (deferred_blocks, deferred_max_tiles);
        outcome
    };
    // A part has 2¹¹ tiles; a chunk of 2048 candidates has eight.
    for (blocks, chunks, parts) in [(0, 0, 0), (1, 1, 1), (256, 1, 1), (257, 1, 2), (4096, 512, 4096)] {
        assert_eq!(list.deferred_parts_for(&outcome(blocks, chunks)), parts, "{blocks}, {chunks}");
    }
    let request = Request { algorithm: Algorithm::ArrayGrid, deferred_parts: 3, ..request };
    let grid = plan(&request, &H200).expect("fits");
    assert_eq!(grid.deferred_parts_for(&outcome(4096, 1)), 2);
    let searches = grid.dispatches.iter().filter(|dispatch| dispatch.kernel == &k::RUNS_SEARCH_FAR).count();
    assert_eq!(searches, 3);
}

#[test]
fn candidates_are_tested_in_rows_within_the_budget() {
    let budget = |tests| WorkBudget { tests, row: 65_535 };
    assert_eq!(skin::candidate_parts(1 << 22, budget(5_000_000_000)), (1, 1 << 14));
    assert_eq!(skin::candidate_parts(1 << 22, budget(1 << 20)), (4, 1 << 12));
    assert_eq!(skin::candidate_parts(0, budget(1)), (1, 1));
    let [_, after] = skin::dispatches(10, false, 3, 100);
    let parts: Vec<_> = after.iter().filter(|dispatch| dispatch.indirect).collect();
    assert_eq!(
        parts.iter().map(|part| (part.args_index, part.first_group)).collect::<Vec<_>>(),
        [(0, 0), (1, 100), (2, 200)]
    );
}
