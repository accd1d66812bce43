// How many spheres lie in each cell of level 0, where smaller ones may have to leave it.
#include layout
#include list
#include place
#include sphere

@group(0) @binding(0) var<uniform> call: Call;
@group(0) @binding(1) var<storage, read> list: List;
@group(0) @binding(2) var<storage, read> spheres: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> density: array<atomic<u32>>;
#ifdef SPECIES
@group(0) @binding(4) var<storage, read> species: array<u32>;
@group(0) @binding(5) var<storage, read> reach: array<vec2<u32>>;
#endif
#include reach
#include side
#include periods
#include image
#include list_cells
#include density_slot

@compute @workgroup_size(256)
fn density_count(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
#include place_builtins
) {
#include place_from_builtins
    let index = number_of_group(id, groups) * 256u + place.lane;
    if (list.is_dense != 0u && index < list.spheres) {
        let sphere = spheres[index];
        if (may_pair(index, sphere) && level_of(class_of(effective_radius(index, sphere))) != LISTED) {
            atomicAdd(&density[density_slot(cell_of(image_of(sphere).xyz, side_of(index) * LEVELS))], 1u);
        }
    }
}
