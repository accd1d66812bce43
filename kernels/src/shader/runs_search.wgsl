// Pairs among entries of one cell, where the later entry is at most NEAR places after the earlier one, and the earlier
// one is active. Blocks with partners farther along their run are listed for `crowded_search`.
#include layout
#include place

@group(0) @binding(0) var<uniform> call: Call;
@group(0) @binding(1) var<storage, read> grid: Grid;
@group(0) @binding(2) var<storage, read> lengths: Lengths;
@group(0) @binding(3) var<storage, read> keys: array<u32>;
@group(0) @binding(4) var<storage, read> objects: array<u32>;
@group(0) @binding(5) var<storage, read> spheres: array<vec4<f32>>;
@group(0) @binding(6) var<storage, read_write> outcome: Outcome;
@group(0) @binding(7) var<storage, read_write> pairs: array<vec2<u32>>;
@group(0) @binding(8) var<storage, read_write> crowded: array<u32>;
#ifdef SPECIES
@group(0) @binding(9) var<storage, read> species: array<u32>;
@group(0) @binding(10) var<storage, read> table: array<f32>;
#endif
#include overlap
#include pairs
#include entry

const GROUP: u32 = 256u;

var<workgroup> block_runs: array<u32, 256>;
var<workgroup> block_objects: array<u32, 256>;
var<workgroup> block_spheres: array<vec4<f32>, 256>;
var<workgroup> group_hits: atomic<u32>;
var<workgroup> group_open: atomic<u32>;
var<workgroup> group_far: atomic<u32>;
// What becomes of a stretch of 32 partners: where its pairs begin, and whether some thread has partners beyond.
struct Stretch {
    first: u32,
    open: u32,
}

var<workgroup> stretch: Stretch;

fn object_at(entry: u32, block: u32) -> u32 {
    if (entry - block < GROUP) {
        return block_objects[entry - block];
    }
    return objects[entry];
}

fn is_entry_pair(object: u32, sphere: vec4<f32>, other_object: u32, other: u32, block: u32) -> bool {
    if (!is_owned(object, other_object) || !is_wanted(object, other_object)) {
        return false;
    }
    var other_sphere: vec4<f32>;
    if (other - block < GROUP) {
        other_sphere = block_spheres[other - block];
    } else {
        other_sphere = spheres[index_of(other_object)];
    }
#ifdef SPECIES
    return is_pair(sphere, other_sphere, species[index_of(object)], species[index_of(other_object)]);
#else
    return is_pair(sphere, other_sphere);
#endif
}

@compute @workgroup_size(256)
fn runs_search(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
#include place_builtins
) {
#include place_from_builtins
    let group = number_of_group(id, groups);
    let count = lengths.items;
    let block = group * GROUP;
    if (block >= count) {
        return;
    }
    let entry = block + place.lane;
    var open = entry < count;
    var run = 0u;
    var object = 0u;
    var sphere: vec4<f32>;
    if (place.lane == 0u) {
        atomicStore(&group_far, 0u);
        atomicStore(&group_hits, 0u);
        atomicStore(&group_open, 0u);
    }
    if (open) {
        run = run_of(keys[entry]);
        object = objects[entry];
        sphere = spheres[index_of(object)];
        block_runs[place.lane] = run;
        block_objects[place.lane] = object;
        block_spheres[place.lane] = sphere;
        open = !is_passive(keys[entry]);
    }
    workgroupBarrier();
    if (open && entry + NEAR + 1u < count && run_of(keys[entry + NEAR + 1u]) == run) {
        atomicStore(&group_far, 1u);
    }

    for (var near = 1u; near <= NEAR; near += 32u) {
        var hits = 0u;
        for (var k = 0u; k < 32u; k++) {
            if (!open) {
                break;
            }
            let other = entry + near + k;
            var same = other < count;
            if (same) {
                if (other - block < GROUP) {
                    same = block_runs[other - block] == run;
                } else {
                    same = run_of(keys[other]) == run;
                }
            }
            if (!same) {
                open = false;
            } else if (is_entry_pair(object, sphere, object_at(other, block), other, block)) {
                hits |= 1u << k;
            }
        }
        var before = 0u;
        if (hits != 0u) {
            before = atomicAdd(&group_hits, countOneBits(hits));
        }
        if (open) {
            atomicStore(&group_open, 1u);
        }
        workgroupBarrier();
        if (place.lane == 0u) {
            let total = atomicLoad(&group_hits);
            var first = 0u;
            if (total != 0u) {
                first = found_reserve(total);
            }
            stretch = Stretch(first, atomicLoad(&group_open));
            atomicStore(&group_hits, 0u);
            atomicStore(&group_open, 0u);
        }
        let settled = workgroupUniformLoad(&stretch);
        if (hits != 0u && settled.first < call.pair_capacity) {
            var at_pair = settled.first + before;
            for (; hits != 0u; hits &= hits - 1u) {
                let k = firstTrailingBit(hits);
                pair_write(at_pair, index_of(object), index_of(object_at(entry + near + k, block)));
                at_pair += 1u;
            }
        }
        if (settled.open == 0u) {
            break;
        }
    }
    if (place.lane == 0u && atomicLoad(&group_far) != 0u) {
        crowded[atomicAdd(&outcome.crowded, 1u)] = block;
        // Of the block's runs only the last goes on so far.
        let beyond = run_end(block_runs[GROUP - 1u], block + GROUP) - (block + NEAR + 1u);
        atomicMax(&outcome.crowded_tiles, (beyond + GROUP - 1u) / GROUP);
    }
}
