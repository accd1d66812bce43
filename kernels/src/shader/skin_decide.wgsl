// Decides whether candidates are found anew: then the dispatches that do so have their workgroups, else none.
#include layout
#include place
#include skin

@group(0) @binding(0) var<uniform> call: Call;
@group(0) @binding(1) var<uniform> skin: Skin;
@group(0) @binding(2) var<storage, read> count_source: array<u32>;
@group(0) @binding(3) var<storage, read_write> state: SkinState;
// Workgroups of each dispatch, three words for each.
@group(0) @binding(4) var<storage, read> full: array<u32>;
@group(0) @binding(5) var<storage, read_write> gate: array<u32>;
// Those of a dispatch whose number an earlier one finds.
@group(0) @binding(6) var<storage, read_write> dispatch: array<u32>;

// Why candidates are found anew.
const KEPT: u32 = 0u;
const FIRST: u32 = 1u;
const CHANGED: u32 = 2u;
const MOVED: u32 = 3u;

var<workgroup> lapsed: u32;

@compute @workgroup_size(64)
fn skin_decide(
#include place_builtins
) {
#include place_from_builtins
    if (place.lane == 0u) {
        let count = min(count_source[0], call.spheres);
        let moved = atomicLoad(&state.moved);
        var why = select(MOVED, KEPT, moved <= bitcast<u32>(skin.usable));
        why = select(why, CHANGED, state.spheres != count || atomicLoad(&state.changed) != 0u);
        why = select(why, FIRST, state.is_complete == 0u);
        lapsed = why;
        state.rebuilt = why;
        state.age = select(0u, state.age + 1u, why == KEPT);
        state.spheres = count;
        state.moved_last = moved;
        atomicStore(&state.moved, 0u);
        atomicStore(&state.changed, 0u);
        if (why == KEPT) {
            dispatch[0] = 0u;
            dispatch[1] = 0u;
            dispatch[2] = 0u;
        }
    }
    let is_rebuilt = workgroupUniformLoad(&lapsed) != KEPT;
    let words = arrayLength(&full);
    let rounds = (words + 63u) / 64u;
    for (var round = 0u; round < rounds; round++) {
        let word = round * 64u + place.lane;
        if (word < words) {
            gate[word] = select(0u, full[word], is_rebuilt);
        }
    }
}
