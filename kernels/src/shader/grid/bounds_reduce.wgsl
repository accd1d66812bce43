#include layout
#include thread
#include sphere

@group(0) @binding(0) var<uniform> params: SearchParams;
@group(0) @binding(1) var<storage, read> grid: Grid;
@group(0) @binding(2) var<storage, read> spheres: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> bounds: Bounds;
@group(0) @binding(4) var<storage, read_write> outcome: Outcome;
#ifdef SPECIES
@group(0) @binding(5) var<storage, read> species: array<u32>;
@group(0) @binding(6) var<storage, read> species_params: array<vec2<u32>>;
#endif
#include effective_radius
#include float_order
#include subgroup_max

const WORKGROUP_SIZE: u32 = 256u;
const ITEMS: u32 = #{SPHERES_PER_THREAD}u;

var<workgroup> group_low: array<atomic<u32>, 3>;
var<workgroup> group_high: array<atomic<u32>, 3>;
var<workgroup> group_radius_min: atomic<u32>;
var<workgroup> group_radius_max: atomic<u32>;
var<workgroup> group_quarantined: atomic<u32>;

@compute @workgroup_size(256)
fn bounds_reduce(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
#include thread_builtins
) {
#include thread_from_builtins
    let group = workgroup_index(id, groups);
    let count = grid.spheres;
    let start = group * WORKGROUP_SIZE * ITEMS;
    if (start >= count) {
        return;
    }
    if (thread.local_index < 3u) {
        atomicStore(&group_low[thread.local_index], 0xffffffffu);
        atomicStore(&group_high[thread.local_index], 0u);
    }
    if (thread.local_index == 0u) {
        atomicStore(&group_radius_min, 0xffffffffu);
        atomicStore(&group_radius_max, 0u);
        atomicStore(&group_quarantined, 0u);
    }
    var low = vec3(0xffffffffu);
    var high = vec3(0u);
    var radius_min = 0xffffffffu;
    var radius_max = 0u;
    var quarantined = 0u;
    for (var item = 0u; item < ITEMS; item++) {
        let index = start + item * WORKGROUP_SIZE + thread.local_index;
        if (index >= count) {
            break;
        }
        let sphere = spheres[index];
        if (may_pair(index, sphere)) {
            let radius = effective_radius(index, sphere);
            let box = box_of(sphere, radius);
            low = min(low, to_sortable(box.low));
            high = max(high, to_sortable(box.high));
            radius_min = min(radius_min, bitcast<u32>(radius));
            radius_max = max(radius_max, bitcast<u32>(radius));
        } else if (!is_accepted(index, sphere)) {
            quarantined += 1u;
        }
    }
    workgroupBarrier();
    for (var axis = 0u; axis < 3u; axis++) {
        let lowest = ~max_in_subgroup(~low[axis]);
        let highest = max_in_subgroup(high[axis]);
        if (is_leader(thread)) {
            atomicMin(&group_low[axis], lowest);
            atomicMax(&group_high[axis], highest);
        }
    }
    let smallest = ~max_in_subgroup(~radius_min);
    let largest = max_in_subgroup(radius_max);
    if (is_leader(thread)) {
        atomicMin(&group_radius_min, smallest);
        atomicMax(&group_radius_max, largest);
    }
    if (quarantined != 0u) {
        atomicAdd(&group_quarantined, quarantined);
    }
    workgroupBarrier();
    if (thread.local_index == 0u) {
        atomicMin(&bounds.low_x, atomicLoad(&group_low[0]));
        atomicMin(&bounds.low_y, atomicLoad(&group_low[1]));
        atomicMin(&bounds.low_z, atomicLoad(&group_low[2]));
        atomicMax(&bounds.high_x, atomicLoad(&group_high[0]));
        atomicMax(&bounds.high_y, atomicLoad(&group_high[1]));
        atomicMax(&bounds.high_z, atomicLoad(&group_high[2]));
        atomicMin(&bounds.radius_min, atomicLoad(&group_radius_min));
        atomicMax(&bounds.radius_max, atomicLoad(&group_radius_max));
        let bad = atomicLoad(&group_quarantined);
        if (bad != 0u) {
            atomicAdd(&outcome.quarantined, bad);
        }
    }
}
