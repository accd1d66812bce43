// Finds pairs at most NEAR positions apart whose earlier entry is active. Defers blocks with farther partners to
// `runs_search_far`.
#include runs_search read_write
#include pairs
#include entry

const WORKGROUP_SIZE: u32 = 256u;

var<workgroup> block_runs: array<u32, 256>;
var<workgroup> block_objects: array<u32, 256>;
var<workgroup> block_spheres: array<vec4<f32>, 256>;
var<workgroup> group_hits: atomic<u32>;
var<workgroup> group_open: atomic<u32>;
var<workgroup> group_far: atomic<u32>;
struct PartnerChunk {
    first: u32,
    open: u32,
}

var<workgroup> partner_chunk: PartnerChunk;

fn object_at(entry: u32, block: u32) -> u32 {
    if (entry - block < WORKGROUP_SIZE) {
        return block_objects[entry - block];
    }
    return objects[entry];
}

fn is_entry_pair(object: u32, sphere: vec4<f32>, other_object: u32, other: u32, block: u32) -> bool {
    if (!is_owned(object, other_object) || !is_wanted(object, other_object)) {
        return false;
    }
    var other_sphere: vec4<f32>;
    if (other - block < WORKGROUP_SIZE) {
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
fn runs_search_near(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
#include thread_builtins
) {
#include thread_from_builtins
    let group = params.first_workgroup + workgroup_index(id, groups);
    let count = sort_counts.items;
    let block = group * WORKGROUP_SIZE;
    if (block >= count) {
        return;
    }
    let entry = block + thread.local_index;
    var open = entry < count;
    var run = 0u;
    var object = 0u;
    var sphere: vec4<f32>;
    if (thread.local_index == 0u) {
        atomicStore(&group_far, 0u);
        atomicStore(&group_hits, 0u);
        atomicStore(&group_open, 0u);
    }
    if (open) {
        run = run_of(keys[entry]);
        object = objects[entry];
        sphere = spheres[index_of(object)];
        block_runs[thread.local_index] = run;
        block_objects[thread.local_index] = object;
        block_spheres[thread.local_index] = sphere;
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
                if (other - block < WORKGROUP_SIZE) {
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
        if (thread.local_index == 0u) {
            let total = atomicLoad(&group_hits);
            var first = 0u;
            if (total != 0u) {
                first = found_reserve(total);
            }
            partner_chunk = PartnerChunk(first, atomicLoad(&group_open));
            atomicStore(&group_hits, 0u);
            atomicStore(&group_open, 0u);
        }
        let chunk = workgroupUniformLoad(&partner_chunk);
        if (hits != 0u && chunk.first < params.pair_capacity) {
            var at_pair = chunk.first + before;
            for (; hits != 0u; hits &= hits - 1u) {
                let k = firstTrailingBit(hits);
                pair_write(at_pair, index_of(object), index_of(object_at(entry + near + k, block)));
                at_pair += 1u;
            }
        }
        if (chunk.open == 0u) {
            break;
        }
    }
    if (thread.local_index == 0u && atomicLoad(&group_far) != 0u) {
        deferred[atomicAdd(&outcome.deferred_blocks, 1u)] = block;
        // Only the last run of a block extends that far.
        let far_entries = run_end(block_runs[WORKGROUP_SIZE - 1u], block + WORKGROUP_SIZE) - (block + NEAR + 1u);
        atomicMax(&outcome.deferred_max_tiles, (far_entries + WORKGROUP_SIZE - 1u) / WORKGROUP_SIZE);
    }
}
