// Tests later chunks of candidates of deferred blocks, so that a single overfull cell keeps the whole device busy, and
// no invocation exceeds the loop iterations that devices allow.
#include cell_list_search read

const MAX_GROUPS: u32 = 65535u;

var<workgroup> deferred_range: vec2<u32>;

@compute @workgroup_size(256)
fn cell_list_search_overflow(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
#include thread_builtins
) {
#include thread_from_builtins
    if (thread.local_index == 0u) {
        deferred_range = vec2(atomicLoad(&outcome.deferred_begin), atomicLoad(&outcome.deferred_end));
        if (params.overflow_workgroups != 0u) {
            deferred_range = vec2(0u, atomicLoad(&outcome.deferred_blocks));
        }
    }
    let range = workgroupUniformLoad(&deferred_range);
    var block = range.x + id.y + id.z * MAX_GROUPS;
    var chunk = id.x + 1u;
    if (params.overflow_workgroups != 0u) {
        // The host dispatched a fixed number of workgroups for each block.
        let number = params.first_workgroup + workgroup_index(id, groups);
        block = number / params.overflow_workgroups;
        chunk = number % params.overflow_workgroups + 1u;
    }
    if (block >= range.y) {
        return;
    }
    search_candidates(deferred[block], chunk, thread.local_index);
}
