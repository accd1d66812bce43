// Stores the input of the search that builds the list, with radii plus half the skin.
#include layout
#include thread
#include sphere
#include skin

@group(0) @binding(0) var<uniform> params: SearchParams;
@group(0) @binding(1) var<uniform> skin: SkinParams;
@group(0) @binding(2) var<storage, read> spheres: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> state: SkinState;
@group(0) @binding(4) var<storage, read_write> reference: array<vec4<f32>>;
#ifdef SPECIES
@group(0) @binding(5) var<storage, read> species: array<u32>;
@group(0) @binding(6) var<storage, read_write> reference_species: array<u32>;
#endif
#include wrapped_sphere
#include inflated_radius

@compute @workgroup_size(256)
fn skin_store_reference(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
#include thread_builtins
) {
#include thread_from_builtins
    let index = workgroup_index(id, groups) * 256u + thread.local_index;
    if (state.rebuild_reason != 0u && index < state.spheres) {
        let sphere = spheres[index];
        // Invalid spheres never pair.
        let image = wrapped_sphere(sphere);
        reference[index] = select(vec4(0.0, 0.0, 0.0, -1.0), vec4(image.xyz, inflated_radius(sphere.w)), is_valid(sphere));
#ifdef SPECIES
        reference_species[index] = species[index];
#endif
    }
}
