// Brings the spheres into the order of their cells.
#include layout
#include list
#include place

@group(0) @binding(0) var<uniform> call: Call;
@group(0) @binding(1) var<storage, read> list: List;
@group(0) @binding(2) var<storage, read> spheres: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> order: array<u32>;
@group(0) @binding(4) var<storage, read_write> sorted: array<vec4<f32>>;
#ifdef SPECIES
@group(0) @binding(5) var<storage, read> species: array<u32>;
@group(0) @binding(6) var<storage, read_write> sorted_species: array<u32>;
#endif
#include put

@compute @workgroup_size(256)
fn spheres_gather(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
#include place_builtins
) {
#include place_from_builtins
    let position = number_of_group(id, groups) * 256u + place.lane;
    if (position >= list.spheres) {
        return;
    }
    put(position, order[position]);
}
