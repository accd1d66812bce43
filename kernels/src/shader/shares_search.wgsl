// Pairs of the spheres of crowded blocks with further shares of their candidates, so that a single crowded cell keeps
// the whole device busy and no invocation takes more turns than some devices allow.
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
@group(0) @binding(8) var<storage, read> crowded: array<u32>;
#ifdef SPECIES
@group(0) @binding(9) var<storage, read> sorted_species: array<u32>;
@group(0) @binding(10) var<storage, read> table: array<f32>;
#endif
#include overlap
#include pairs
#include list_cells
#include walk
#include candidates

// Blocks of one layer of the dispatch.
const MAX_GROUPS: u32 = 65535u;

// The listed blocks that this part takes.
var<workgroup> part: vec2<u32>;

@compute @workgroup_size(256)
fn shares_search(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
#include place_builtins
) {
#include place_from_builtins
    if (place.lane == 0u) {
        part = vec2(atomicLoad(&outcome.crowded_begin), atomicLoad(&outcome.crowded_end));
        if (call.further_shares != 0u) {
            part = vec2(0u, atomicLoad(&outcome.crowded));
        }
    }
    let listed = workgroupUniformLoad(&part);
    var block = listed.x + id.y + id.z * MAX_GROUPS;
    var share = id.x + 1u;
    if (call.further_shares != 0u) {
        // So many workgroups for each block that there may be.
        let number = number_of_group(id, groups);
        block = number / call.further_shares;
        share = number % call.further_shares + 1u;
    }
    if (block >= listed.y) {
        return;
    }
    search_share(crowded[block], share, place.lane);
}
