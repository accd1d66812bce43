// No other kernel finds depths and cells, because rounding may differ between kernels.
#include layout
#include thread
#include sphere

@group(0) @binding(0) var<uniform> params: SearchParams;
@group(0) @binding(1) var<storage, read> grid: Grid;
@group(0) @binding(2) var<storage, read> spheres: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> bounds: Bounds;
@group(0) @binding(4) var<storage, read_write> cells: array<vec2<u32>>;
@group(0) @binding(5) var<storage, read_write> occupancy: array<atomic<u32>>;
#ifdef SPECIES
@group(0) @binding(6) var<storage, read> species: array<u32>;
@group(0) @binding(7) var<storage, read> species_params: array<vec2<u32>>;
#endif
#include effective_radius
#include cells
#include occupancy_add

const WORKGROUP_SIZE: u32 = 256u;

var<workgroup> group_depths: atomic<u32>;
var<workgroup> group_descending: array<atomic<u32>, 32>;

fn exponent_of(value: f32) -> i32 {
    return i32(bitcast<u32>(value) >> 23u) - 127;
}

// Returns the finest depth at which a widened box overlaps at most two cells per axis and has coordinates of at most 17
// bits.
fn depth_of(sphere: vec4<f32>, radius: f32) -> u32 {
    if (grid.split_policy == 0u) {
        return 0u;
    }
    let open = abs(clamp(sphere.xyz - grid.origin, vec3(-0x1p126), vec3(0x1p126))) * grid.inverse_edge;
    let offset = max(open, grid.ring_cells);
    let at = abs(sphere.xyz) * grid.inverse_edge;
    let distance = max(offset.x, max(offset.y, offset.z));
    let diameter = 2.0 * (radius * max(grid.inverse_edge.x, max(grid.inverse_edge.y, grid.inverse_edge.z)));
    let width = diameter + (diameter + distance + max(at.x, max(at.y, at.z))) * 0x1p-20;
    let finest = min(-1 - exponent_of(params.cell_ratio * width), 15 - exponent_of(distance));
    return u32(clamp(finest, 0, 31));
}

// Positions next to the origin become 0, so that no device flushes them.
fn scaled(position: vec3<f32>) -> vec3<f32> {
    let offset = clamp(position - grid.origin, vec3(-0x1p126), vec3(0x1p126));
    let high = vec3<f32>(grid.high) + vec3(0x1.f8p-1);
    let value = clamp(offset * grid.inverse_edge, vec3<f32>(grid.low), high);
    return select(value, vec3(0.0), abs(value) < vec3(0x1p-60));
}

fn cells_of(sphere: vec4<f32>, radius: f32) -> Cells {
    let depth = depth_of(sphere, radius);
    let box = box_of(sphere, radius);
    let scale = bitcast<f32>((127u + depth) << 23u);
    // Values from either side of the periodic boundary differ by rounding.
    let spare = grid.ring_cells * 0x1p-21;
    let first = vec3<i32>(floor((scaled(box.low) - spare) * scale));
    let last = vec3<i32>(floor((scaled(box.high) + spare) * scale));
    return gathered(Cells(first, clamp(last - first, vec3(0), vec3(1)), depth));
}

@compute @workgroup_size(256)
fn cells_find(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
#include thread_builtins
) {
#include thread_from_builtins
    let group = workgroup_index(id, groups);
    if (group * WORKGROUP_SIZE >= grid.spheres) {
        return;
    }
    if (thread.local_index == 0u) {
        atomicStore(&group_depths, 0u);
    }
    if (thread.local_index < 32u) {
        atomicStore(&group_descending[thread.local_index], 0u);
    }
    workgroupBarrier();
    let index = group * WORKGROUP_SIZE + thread.local_index;
    if (index < grid.spheres) {
        let sphere = spheres[index];
        var words = NO_CELLS;
        if (may_pair(index, sphere)) {
            let found = cells_of(sphere, effective_radius(index, sphere));
            words = cells_packed(found);
            if (grid.split_policy != 0u) {
                atomicOr(&group_depths, 1u << found.depth);
            }
            if (grid.split_policy == 1u) {
                atomicAdd(&group_descending[found.depth], 1u);
            }
            if (grid.split_policy == 2u) {
                let coarse = cells_at(found, 0u);
                for (var number = 0u; number < 8u; number++) {
                    if (has_cell(coarse, step_of(number))) {
                        occupancy_add(0u, coarse.first + step_of(number), found.depth == 0u);
                    }
                }
            }
        }
        cells[index] = words;
    }
    if (grid.split_policy == 0u) {
        return;
    }
    workgroupBarrier();
    if (thread.local_index == 0u) {
        atomicOr(&bounds.depth_mask, atomicLoad(&group_depths));
    }
    if (thread.local_index < 32u) {
        let count = atomicLoad(&group_descending[thread.local_index]);
        if (count != 0u) {
            atomicAdd(&bounds.descending[thread.local_index], count);
        }
    }
}
