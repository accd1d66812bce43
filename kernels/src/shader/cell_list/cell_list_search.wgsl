// Tests each sphere's first candidates, usually all. Blocks with more are deferred to `cell_list_search_overflow`.
#include cell_list_search read_write

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
