// Finds each sphere's cell, here and nowhere else, counts the spheres of each cell, and gives each its place there.
#include layout
#include list
#include place
#include sphere

@group(0) @binding(0) var<uniform> call: Call;
@group(0) @binding(1) var<storage, read> list: List;
@group(0) @binding(2) var<storage, read> spheres: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> density: array<atomic<u32>>;
@group(0) @binding(4) var<storage, read_write> outcome: Outcome;
@group(0) @binding(5) var<storage, read_write> starts: array<atomic<u32>>;
// Cell of each sphere, and how many came to it before.
@group(0) @binding(6) var<storage, read_write> homes: array<vec2<u32>>;
#ifdef SPECIES
@group(0) @binding(7) var<storage, read> species: array<u32>;
@group(0) @binding(8) var<storage, read> reach: array<vec2<u32>>;
#endif
#include reach
#include side
#include periods
#include image
#include list_cells
#include home

@compute @workgroup_size(256)
fn homes_count(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
#include place_builtins
) {
#include place_from_builtins
    let index = number_of_group(id, groups) * 256u + place.lane;
    var crowd = 0u;
    if (index < list.spheres) {
        let home = home_of(index, spheres[index]);
        let before = atomicAdd(&starts[home.cell], 1u);
        homes[index] = vec2(home.cell, before);
        crowd = home.crowd;
        if (home.could_leave && before >= max(call.tau, atomicLoad(&outcome.densest))) {
            atomicMax(&outcome.densest, before + 1u);
        }
    }
    if (list.is_dense != 0u) {
        keep_crowd(crowd, place.lane);
    }
}
