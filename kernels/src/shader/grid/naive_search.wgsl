// Each workgroup tests 256 spheres with some tiles, within the limit of loop iterations.
#include layout
#include thread
#include sphere

@group(0) @binding(0) var<uniform> params: SearchParams;
@group(0) @binding(1) var<storage, read> grid: Grid;
@group(0) @binding(2) var<storage, read> spheres: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> outcome: Outcome;
@group(0) @binding(4) var<storage, read_write> pairs: array<vec2<u32>>;
#ifdef SPECIES
@group(0) @binding(5) var<storage, read> species: array<u32>;
@group(0) @binding(6) var<storage, read> species_params: array<vec2<u32>>;
@group(0) @binding(7) var<storage, read> table: array<f32>;
#endif
#include effective_radius
#include overlap
#include reserve_by_subgroup
#include tile

const WORKGROUP_SIZE: u32 = 256u;

var<workgroup> tile_valid: array<atomic<u32>, 8>;

@compute @workgroup_size(256)
fn naive_search(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
#include thread_builtins
) {
#include thread_from_builtins
    let group = params.first_workgroup + workgroup_index(id, groups);
    let count = grid.spheres;
    let blocks = (count + WORKGROUP_SIZE - 1u) / WORKGROUP_SIZE;
    let rows = select(count, min(params.second_set_start, count), params.second_set_start != 0u);
    let row_blocks = (rows + WORKGROUP_SIZE - 1u) / WORKGROUP_SIZE;
    let workgroups_per_block = clamp(params.search_groups / max(row_blocks, 1u), 1u, max(blocks, 1u));
    let block = group / workgroups_per_block;
    let first_row = block * WORKGROUP_SIZE;
    if (block >= row_blocks || first_row >= params.window_end || first_row + (WORKGROUP_SIZE - 1u) < params.window_begin) {
        return;
    }
    let first_column = max(block, params.second_set_start / WORKGROUP_SIZE);
    var query: QuerySphere;
    query.object = first_row + thread.local_index;
    var is_query = false;
    if (query.object < rows && is_in_window(query.object)) {
        query.sphere = spheres[query.object];
        is_query = is_accepted(query.object, query.sphere);
#ifdef SPECIES
        query.species = min(species[query.object], params.species - 1u);
#endif
    }
    for (var iteration = 0u; iteration < blocks; iteration++) {
        let column = first_column + group % workgroups_per_block + iteration * workgroups_per_block;
        if (column >= blocks) {
            break;
        }
        workgroupBarrier();
        if (thread.local_index < 8u) {
            atomicStore(&tile_valid[thread.local_index], 0u);
        }
        workgroupBarrier();
        let other = column * WORKGROUP_SIZE + thread.local_index;
        if (other < count) {
            let sphere = spheres[other];
            tile[thread.local_index] = sphere;
#ifdef SPECIES
            tile_species[thread.local_index] = min(species[other], params.species - 1u);
#endif
            if (is_accepted(other, sphere)) {
                atomicOr(&tile_valid[thread.local_index / 32u], 1u << (thread.local_index % 32u));
            }
        }
        workgroupBarrier();
        // Partners in the block's own tile have larger indices; partners in the first tile of the second set belong to
        // this set.
        let of_second = max(params.second_set_start, column * WORKGROUP_SIZE) - column * WORKGROUP_SIZE;
        let begin = max(select(0u, thread.local_index + 1u, column == block), of_second);
        for (var first = 0u; first < WORKGROUP_SIZE; first += 32u) {
            let window = tile_window(first, begin, WORKGROUP_SIZE) & atomicLoad(&tile_valid[first / 32u]);
            var hits = 0u;
            if (is_query && window != 0u) {
                hits = tile_hits(query, first) & window;
            }
            if (any_in_subgroup(hits != 0u)) {
                var at_pair = pairs_reserve_by_subgroup(countOneBits(hits), thread);
                for (; hits != 0u; hits &= hits - 1u) {
                    if (at_pair >= params.pair_capacity) {
                        break;
                    }
                    let k = firstTrailingBit(hits);
                    pair_write(at_pair, query.object, column * WORKGROUP_SIZE + first + k);
                    at_pair += 1u;
                }
            }
        }
    }
}
