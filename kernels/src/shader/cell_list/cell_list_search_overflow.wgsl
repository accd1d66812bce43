// Tests later chunks of deferred blocks, one per workgroup, so that an overfull cell occupies the whole device.
#include cell_list_search read

fn is_refused() -> bool {
    return false;
}

var<workgroup> deferred_range: vec2<u32>;

@compute @workgroup_size(256)
fn cell_list_search_overflow(
    @builtin(workgroup_id) id: vec3<u32>,
#include thread_builtins
) {
#include thread_from_builtins
    if (thread.local_index == 0u) {
        deferred_range = vec2(atomicLoad(&outcome.deferred_begin), atomicLoad(&outcome.deferred_end));
    }
    let range = workgroupUniformLoad(&deferred_range);
    let block = range.x + id.y + id.z * MAX_GROUPS;
    if (block >= range.y) {
        return;
    }
    search_candidates(deferred[block], id.x + 1u, thread.local_index);
}
