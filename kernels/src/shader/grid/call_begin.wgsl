#include layout

@group(0) @binding(0) var<uniform> params: SearchParams;
@group(0) @binding(1) var<storage, read> count_source: array<u32>;
@group(0) @binding(2) var<storage, read_write> bounds: Bounds;
@group(0) @binding(3) var<storage, read_write> grid: Grid;
@group(0) @binding(4) var<storage, read_write> outcome: Outcome;
#include outcome_begin

@compute @workgroup_size(1)
fn call_begin() {
    atomicStore(&bounds.low_x, 0xffffffffu);
    atomicStore(&bounds.low_y, 0xffffffffu);
    atomicStore(&bounds.low_z, 0xffffffffu);
    atomicStore(&bounds.high_x, 0u);
    atomicStore(&bounds.high_y, 0u);
    atomicStore(&bounds.high_z, 0u);
    atomicStore(&bounds.radius_min, 0xffffffffu);
    atomicStore(&bounds.radius_max, 0u);
    atomicStore(&bounds.depth_mask, 0u);
    for (var depth = 0u; depth < 32u; depth++) {
        atomicStore(&bounds.descending[depth], 0u);
    }
    grid.spheres = min(count_source[0], params.spheres);
    outcome_begin(0u, 0u);
}
