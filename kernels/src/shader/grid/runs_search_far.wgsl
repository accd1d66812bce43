// Finds pairs more than NEAR positions apart in one run. Each workgroup tests a deferred block with some later tiles,
// so that an overfull cell occupies the whole device.
#include runs_search read
#include reserve_by_subgroup
#include entry
#include far_tiles
#include tile

const WORKGROUP_SIZE: u32 = 256u;

var<workgroup> tile_firsts: atomic<u32>;
struct DeferredRange {
    begin: u32,
    end: u32,
    tiles: u32,
}

var<workgroup> group_range: DeferredRange;

fn owned_hits(object: u32, first: u32, hits: u32) -> u32 {
    var owned = 0u;
    for (var k = 0u; k < 32u; k++) {
        let other = tile_objects[first + k];
        owned |= select(0u, 1u << k, is_owned(object, other) && is_wanted(object, other));
    }
    return owned & hits;
}

@compute @workgroup_size(256)
fn runs_search_far(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
#include thread_builtins
) {
#include thread_from_builtins
    if (thread.local_index == 0u) {
        group_range = DeferredRange(
            atomicLoad(&outcome.deferred_begin),
            atomicLoad(&outcome.deferred_end),
            atomicLoad(&outcome.deferred_max_tiles),
        );
    }
    let range = workgroupUniformLoad(&group_range);
    let listed = range.begin + id.y + id.z * MAX_GROUPS;
    if (listed >= range.end) {
        return;
    }
    let per_workgroup = tiles_per_workgroup(range.end - range.begin, range.tiles);
    let block = deferred[listed];
    let run = run_of(keys[block + WORKGROUP_SIZE - 1u]);
    let start = block + NEAR + 1u;
    let end = run_end(run, block + WORKGROUP_SIZE);
    let first_column = start + id.x * per_workgroup * WORKGROUP_SIZE;
    let entry = block + thread.local_index;
    let is_query = run_of(keys[entry]) == run && !is_passive(keys[entry]) && entry + NEAR + 1u < end;
    var query: QuerySphere;
    query.object = objects[entry];
    query.sphere = spheres[index_of(query.object)];
#ifdef SPECIES
    query.species = species[index_of(query.object)];
#endif
    // If an object begins here on every axis, this cell owns all its pairs.
    let owns_all = is_owned(query.object, 0u) && asks_for_all(grid.spheres);
    for (var iteration = 0u; iteration < per_workgroup; iteration++) {
        let column = first_column + iteration * WORKGROUP_SIZE;
        if (column >= end) {
            break;
        }
        workgroupBarrier();
        if (thread.local_index == 0u) {
            atomicStore(&tile_firsts, 0u);
        }
        workgroupBarrier();
        if (column + thread.local_index < end) {
            let object = objects[column + thread.local_index];
            atomicOr(&tile_firsts, object);
            tile_objects[thread.local_index] = object;
            tile[thread.local_index] = spheres[index_of(object)];
#ifdef SPECIES
            tile_species[thread.local_index] = species[index_of(object)];
#endif
        }
        workgroupBarrier();
        // In the first tile, partners up to NEAR positions away are skipped; they end later for later threads.
        let begin = select(0u, thread.local_index, column == start);
        let finish = min(WORKGROUP_SIZE, end - column);
        // Objects that share several cells are skipped here in all except one.
        let query_owns = is_query && is_owned(query.object, atomicLoad(&tile_firsts));
        for (var first = 0u; first < WORKGROUP_SIZE; first += 32u) {
            let window = tile_window(first, begin, finish);
            var hits = 0u;
            if (query_owns && window != 0u) {
                hits = tile_hits(query, first) & window;
                if (hits != 0u && !owns_all) {
                    hits = owned_hits(query.object, first, hits);
                }
            }
            if (any_in_subgroup(hits != 0u)) {
                var at_pair = pairs_reserve_by_subgroup(countOneBits(hits), thread);
                for (; hits != 0u; hits &= hits - 1u) {
                    if (at_pair >= params.pair_capacity) {
                        break;
                    }
                    let k = firstTrailingBit(hits);
                    pair_write(at_pair, index_of(query.object), index_of(tile_objects[first + k]));
                    at_pair += 1u;
                }
            }
        }
    }
}
