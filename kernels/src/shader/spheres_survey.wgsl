// What the spheres are like. Each workgroup takes every so many of them, so that few workgroups meet at the counters in
// memory.
#include layout
#include list
#include place
#include sphere

@group(0) @binding(0) var<uniform> call: Call;
@group(0) @binding(1) var<storage, read> count_source: array<u32>;
@group(0) @binding(2) var<storage, read> spheres: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> survey: Survey;
@group(0) @binding(4) var<storage, read_write> starts: array<u32>;
@group(0) @binding(5) var<storage, read_write> density: array<u32>;
#ifdef SPECIES
@group(0) @binding(6) var<storage, read> species: array<u32>;
@group(0) @binding(7) var<storage, read> reach: array<vec2<u32>>;
#endif
#include reach
#include side
#include ordered
#include subgroup_max
#include survey

@compute @workgroup_size(256)
fn spheres_survey(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
#include place_builtins
) {
#include place_from_builtins
    survey_spheres(number_of_group(id, groups) * 256u + place.lane, groups.x * groups.y * 256u, place);
}
