// Counts spheres per finer cell inside overfull cells of the first level.
#include layout
#include thread

@group(0) @binding(0) var<uniform> params: SearchParams;
@group(0) @binding(1) var<storage, read> grid: Grid;
@group(0) @binding(2) var<storage, read_write> bounds: Bounds;
@group(0) @binding(3) var<storage, read> cells: array<vec2<u32>>;
@group(0) @binding(4) var<storage, read_write> occupancy: array<atomic<u32>>;
#include cells
#include occupancy_add

const WORKGROUP_SIZE: u32 = 256u;

var<workgroup> group_descending: array<atomic<u32>, 32>;

fn overfull_cells(coarse: Cells) -> u32 {
    var overfull = 0u;
    for (var number = 0u; number < 8u; number++) {
        let step = step_of(number);
        if (has_cell(coarse, step) && is_overfull(atomicLoad(&occupancy[occupancy_slot(0u, coarse.first + step)]))) {
            overfull |= 1u << number;
        }
    }
    return overfull;
}

@compute @workgroup_size(256)
fn levels_count(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
#include thread_builtins
) {
#include thread_from_builtins
    let group = workgroup_index(id, groups);
    if (group * WORKGROUP_SIZE >= grid.spheres || grid.split_policy != 2u) {
        return;
    }
    if (thread.local_index < 32u) {
        atomicStore(&group_descending[thread.local_index], 0u);
    }
    workgroupBarrier();
    let index = group * WORKGROUP_SIZE + thread.local_index;
    var words = NO_CELLS;
    if (index < grid.spheres) {
        words = cells[index];
    }
    let own = cells_unpacked(words);
    if (any(words != NO_CELLS) && own.depth != 0u) {
        let coarse = cells_at(own, 0u);
        let overfull = overfull_cells(coarse);
        var depths = depths_to(atomicLoad(&bounds.depth_mask), own.depth) & ~1u;
        if (overfull != 0u) {
            atomicAdd(&group_descending[own.depth], 1u);
        } else {
            depths = 0u;
        }
        for (; depths != 0u; depths &= depths - 1u) {
            let depth = firstTrailingBit(depths);
            let here = cells_at(own, depth);
            for (var number = 0u; number < 8u; number++) {
                let step = step_of(number);
                let cell = here.first + step;
                if (has_cell(here, step) && (overfull & (1u << parent_of(cell, depth, coarse))) != 0u) {
                    occupancy_add(depth, cell, depth == own.depth);
                }
            }
        }
    }
    workgroupBarrier();
    if (thread.local_index < 32u) {
        let count = atomicLoad(&group_descending[thread.local_index]);
        if (count != 0u) {
            atomicAdd(&bounds.descending[thread.local_index], count);
        }
    }
}
