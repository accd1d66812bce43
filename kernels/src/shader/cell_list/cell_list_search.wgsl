// Tests the first chunk of candidates, and defers blocks with more to `cell_list_search_overflow`. For few spheres,
// each chunk of a block has a workgroup here.
#include cell_list_search read_write

#ifdef REUSE
#include cell_list_reuse

fn is_refused() -> bool {
    return (atomicLoad(&outcome.overflow) & OVERFLOW_LAYOUT) != 0u;
}
#else
fn is_refused() -> bool {
    return false;
}
#endif

var<workgroup> most_candidates: atomic<u32>;

// With a single level, candidates are in at most 14 cells and in the cell of listed spheres.
const MOST_CELLS: u32 = 15u;

// Returns `true` if even the fullest cell has too few spheres for this chunk. Only `scan_once` stores their
// number, which is 0 after other scans.
fn is_past_last_chunk(chunk: u32) -> bool {
    let largest = starts[cell_list.cells + 2u];
    let is_known = cell_list.levels == 1u && largest != 0u;
    let most = select(0xffffffffu, MOST_CELLS * largest, is_known);
    return chunk >= params.chunks_per_block || most <= chunk * params.candidates_per_invocation;
}

@compute @workgroup_size(256)
fn cell_list_search(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
#include thread_builtins
) {
#include thread_from_builtins
    let number = params.first_workgroup + workgroup_index(id, groups);
    let blocks = (params.spheres + WORKGROUP_SIZE - 1u) / WORKGROUP_SIZE;
    let chunk = select(0u, number / max(blocks, 1u), params.chunks_per_block != 0u);
    let block = (number - chunk * blocks) * WORKGROUP_SIZE;
    if (block >= starts[cell_list.cells + 1u] || (chunk != 0u && is_past_last_chunk(chunk))) {
        return;
    }
    if (thread.local_index == 0u) {
        atomicStore(&most_candidates, 0u);
    }
    let rest = search_candidates(block, chunk, thread.local_index);
    if (rest != 0u && params.chunks_per_block == 0u) {
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
