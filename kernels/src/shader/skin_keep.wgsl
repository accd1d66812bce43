// Keeps where spheres are when candidates are found, larger by half the skin: what the search for candidates is given.
#include layout
#include place
#include sphere
#include skin

@group(0) @binding(0) var<uniform> call: Call;
@group(0) @binding(1) var<uniform> skin: Skin;
@group(0) @binding(2) var<storage, read> spheres: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> state: SkinState;
@group(0) @binding(4) var<storage, read_write> kept: array<vec4<f32>>;
#ifdef SPECIES
@group(0) @binding(5) var<storage, read> species: array<u32>;
@group(0) @binding(6) var<storage, read_write> kept_species: array<u32>;
#endif
#include image
#include widened

@compute @workgroup_size(256)
fn skin_keep(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
#include place_builtins
) {
#include place_from_builtins
    let index = number_of_group(id, groups) * 256u + place.lane;
    if (state.rebuilt != 0u && index < state.spheres) {
        let sphere = spheres[index];
        // What is not valid pairs with nothing.
        let image = image_of(sphere);
        kept[index] = select(vec4(0.0, 0.0, 0.0, -1.0), vec4(image.xyz, widened(sphere.w)), is_valid(sphere));
#ifdef SPECIES
        kept_species[index] = species[index];
#endif
    }
}
