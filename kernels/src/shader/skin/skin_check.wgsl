// Writes the rebuild's dispatch arguments, or zeros if the list is still valid.
#include layout
#include thread
#include skin

@group(0) @binding(0) var<uniform> params: SearchParams;
@group(0) @binding(1) var<uniform> skin: SkinParams;
@group(0) @binding(2) var<storage, read> count_source: array<u32>;
@group(0) @binding(3) var<storage, read_write> state: SkinState;
@group(0) @binding(4) var<storage, read> full_counts: array<u32>;
@group(0) @binding(5) var<storage, read_write> dispatch_counts: array<u32>;
@group(0) @binding(6) var<storage, read_write> dispatch: array<u32>;

const VALID: u32 = 0u;
const NO_LIST: u32 = 1u;
const INPUT_CHANGED: u32 = 2u;
const DISPLACEMENT: u32 = 3u;

var<workgroup> lapsed: u32;

@compute @workgroup_size(64)
fn skin_check(
#include thread_builtins
) {
#include thread_from_builtins
    if (thread.local_index == 0u) {
        let count = min(count_source[0], params.spheres);
        let moved = atomicLoad(&state.displacement);
        var why = select(DISPLACEMENT, VALID, moved <= bitcast<u32>(skin.limit_squared));
        why = select(why, INPUT_CHANGED, state.spheres != count || atomicLoad(&state.input_changed) != 0u);
        why = select(why, NO_LIST, state.is_complete == 0u);
        lapsed = why;
        state.rebuild_reason = why;
        state.age = select(0u, state.age + 1u, why == VALID);
        state.spheres = count;
        state.last_displacement = moved;
        atomicStore(&state.displacement, 0u);
        atomicStore(&state.input_changed, 0u);
        // Until the search ends, its candidates are no list.
        state.is_complete = select(0u, state.is_complete, why == VALID);
        if (why == VALID) {
            dispatch[0] = 0u;
            dispatch[1] = 0u;
            dispatch[2] = 0u;
        }
    }
    let is_rebuilt = workgroupUniformLoad(&lapsed) != VALID;
    let words = arrayLength(&full_counts);
    let rounds = (words + 63u) / 64u;
    for (var round = 0u; round < rounds; round++) {
        let word = round * 64u + thread.local_index;
        if (word < words) {
            dispatch_counts[word] = select(0u, full_counts[word], is_rebuilt);
        }
    }
}
