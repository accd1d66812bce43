#include layout
#include thread

@group(0) @binding(0) var<uniform> params: SearchParams;
@group(0) @binding(1) var<storage, read> grid: Grid;
@group(0) @binding(2) var<storage, read> given: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read_write> wrapped: array<vec4<u32>>;

#include wrap

@compute @workgroup_size(256)
fn spheres_wrap(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
#include thread_builtins
) {
#include thread_from_builtins
    let index = workgroup_index(id, groups) * 256u + thread.local_index;
    if (index >= grid.spheres) {
        return;
    }
    let sphere = given[index];
    wrapped[index] = vec4(
        wrap(sphere.x, bitcast<u32>(params.period_x)),
        wrap(sphere.y, bitcast<u32>(params.period_y)),
        wrap(sphere.z, bitcast<u32>(params.period_z)),
        sphere.w,
    );
}
