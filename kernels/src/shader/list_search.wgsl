// Pairs of each sphere with the first of its candidates, which are mostly all. Blocks in which some sphere has more are
// listed for `shares_search`.
#include layout
#include list
#include place
#include sphere

@group(0) @binding(0) var<uniform> call: Call;
@group(0) @binding(1) var<storage, read> list: List;
@group(0) @binding(2) var<storage, read> starts: array<u32>;
@group(0) @binding(3) var<storage, read> sorted: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> cells: array<u32>;
@group(0) @binding(5) var<storage, read> order: array<u32>;
@group(0) @binding(6) var<storage, read_write> outcome: Outcome;
@group(0) @binding(7) var<storage, read_write> pairs: array<vec2<u32>>;
@group(0) @binding(8) var<storage, read_write> crowded: array<u32>;
#ifdef SPECIES
@group(0) @binding(9) var<storage, read> sorted_species: array<u32>;
@group(0) @binding(10) var<storage, read> table: array<f32>;
#endif
#include overlap
#include pairs
#include list_cells
#include walk
#include candidates

// Candidates of the sphere that has most, and spheres in its cell.
var<workgroup> most_candidates: atomic<u32>;

@compute @workgroup_size(256)
fn list_search(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
#include place_builtins
) {
#include place_from_builtins
    let block = number_of_group(id, groups) * GROUP;
    if (block >= starts[list.cells + 1u]) {
        return;
    }
    if (place.lane == 0u) {
        atomicStore(&most_candidates, 0u);
    }
    let rest = search_share(block, 0u, place.lane);
    if (rest != 0u) {
        atomicMax(&most_candidates, rest);
    }
    workgroupBarrier();
    if (place.lane == 0u) {
        let most = atomicLoad(&most_candidates);
        if (most != 0u) {
            crowded[atomicAdd(&outcome.crowded, 1u)] = block;
            atomicMax(&outcome.crowded_tiles, (most + call.share - 1u) / call.share);
        }
    }
}
