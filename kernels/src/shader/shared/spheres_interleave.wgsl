#include layout
#include thread

struct ColumnLayout {
    first: vec4<u32>,
    stride: vec4<u32>,
}

@group(0) @binding(0) var<uniform> params: SearchParams;
@group(0) @binding(1) var<uniform> columns: ColumnLayout;
@group(0) @binding(2) var<storage, read> count_source: array<u32>;
@group(0) @binding(3) var<storage, read> x: array<f32>;
@group(0) @binding(4) var<storage, read> y: array<f32>;
@group(0) @binding(5) var<storage, read> z: array<f32>;
@group(0) @binding(6) var<storage, read> r: array<f32>;
@group(0) @binding(7) var<storage, read_write> rows: array<vec4<f32>>;

@compute @workgroup_size(256)
fn spheres_interleave(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
#include thread_builtins
) {
#include thread_from_builtins
    let index = workgroup_index(id, groups) * 256u + thread.local_index;
    if (index < min(count_source[0], params.spheres)) {
        let at = columns.first + index * columns.stride;
        rows[index] = vec4(x[at.x], y[at.y], z[at.z], r[at.w]);
    }
}
