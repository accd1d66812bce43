// Finds the pairs of each sphere with its first candidates, usually all. Blocks in which some sphere has more candidates
// are deferred to `cell_list_search_overflow`.
#include layout
#include cell_list
#include thread
#include sphere

@group(0) @binding(0) var<uniform> params: SearchParams;
@group(0) @binding(1) var<storage, read> cell_list: CellListLayout;
@group(0) @binding(2) var<storage, read> starts: array<u32>;
@group(0) @binding(3) var<storage, read> sorted: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> cells: array<u32>;
@group(0) @binding(5) var<storage, read> order: array<u32>;
@group(0) @binding(6) var<storage, read_write> outcome: Outcome;
@group(0) @binding(7) var<storage, read_write> pairs: array<vec2<u32>>;
@group(0) @binding(8) var<storage, read_write> deferred: array<u32>;
#ifdef SPECIES
@group(0) @binding(9) var<storage, read> sorted_species: array<u32>;
@group(0) @binding(10) var<storage, read> table: array<f32>;
#endif
#include overlap
#include pairs
#include cell_numbers
#include neighbor_cells
#include candidates

var<workgroup> most_candidates: atomic<u32>;

@compute @workgroup_size(256)
fn cell_list_search(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
#include thread_builtins
) {
#include thread_from_builtins
    let block = (params.first_workgroup + workgroup_index(id, groups)) * WORKGROUP_SIZE;
    if (block >= starts[cell_list.cells + 1u]) {
        return;
    }
    if (thread.local_index == 0u) {
        atomicStore(&most_candidates, 0u);
    }
    let rest = search_candidates(block, 0u, thread.local_index);
    if (rest != 0u) {
        atomicMax(&most_candidates, rest);
    }
    workgroupBarrier();
    if (thread.local_index == 0u) {
        let most = atomicLoad(&most_candidates);
        if (most != 0u) {
            deferred[atomicAdd(&outcome.deferred_blocks, 1u)] = block;
            atomicMax(&outcome.deferred_max_tiles, (most + params.candidates_per_invocation - 1u) / params.candidates_per_invocation);
        }
    }
}
