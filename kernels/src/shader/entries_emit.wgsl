// One (cell, object) entry for every cell that a sphere's box overlaps. The object's cells are computed here
// and nowhere else; with the entry goes, per axis, whether the cell is the object's first.
#include layout
#include place
#include sphere

@group(0) @binding(0) var<uniform> call: Call;
@group(0) @binding(1) var<storage, read> grid: Grid;
@group(0) @binding(2) var<storage, read> spheres: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> outcome: Outcome;
@group(0) @binding(4) var<storage, read_write> keys: array<u32>;
@group(0) @binding(5) var<storage, read_write> objects: array<u32>;
#ifdef SPECIES
@group(0) @binding(6) var<storage, read> species: array<u32>;
@group(0) @binding(7) var<storage, read> reach: array<vec2<f32>>;
#endif
#include reach
#include group_scan

var<workgroup> group_first: u32;

fn entries_reserve(count: u32) -> u32 {
    let first = atomicAdd(&outcome.entries_lo, count);
    if (first > 0xffffffffu - count) {
        atomicAdd(&outcome.entries_hi, 1u);
        return 0xffffffffu;
    }
    return select(first, 0xffffffffu, atomicLoad(&outcome.entries_hi) != 0u);
}

fn cell_of(position: vec3<f32>) -> vec3<u32> {
    let offset = clamp(position - grid.origin, vec3(-0x1p126), vec3(0x1p126));
    let low = vec3<f32>(grid.low);
    let high = vec3<f32>(grid.high);
    return vec3<u32>(vec3<i32>(clamp(floor(offset * grid.inverse_edge), low, high)) - grid.low);
}

fn key_of(cell: vec3<u32>) -> u32 {
    let folded = cell & ((vec3(1u) << grid.bits) - vec3(1u));
    return folded.x | (folded.y << grid.bits.x) | (folded.z << (grid.bits.x + grid.bits.y));
}

@compute @workgroup_size(256)
fn entries_emit(at: Builtins) {
    let place = place_of(at);
    if (place.group * GROUP >= grid.spheres) {
        return;
    }
    let index = place.group * GROUP + place.lane;
    var first = vec3(0u);
    var last = vec3(0u);
    var count = 0u;
    if (index < grid.spheres) {
        let sphere = spheres[index];
        if (is_accepted(index, sphere)) {
            let box = box_of(sphere, effective_radius(index, sphere));
            first = cell_of(box.low);
            last = max(first, cell_of(box.high));
            let span = last - first + vec3(1u);
            count = span.x * span.y * span.z;
        }
    }
    let scan = group_scan(count, place);
    if (place.lane == 0u) {
        group_first = entries_reserve(scan.y);
    }
    workgroupBarrier();
    if (count == 0u || group_first >= call.entry_capacity) {
        return;
    }
    var at_entry = group_first + scan.x;
    for (var z = first.z; z <= last.z; z++) {
        for (var y = first.y; y <= last.y; y++) {
            for (var x = first.x; x <= last.x; x++) {
                if (at_entry >= call.entry_capacity) {
                    return;
                }
                let is_first = vec3(x, y, z) == first;
                keys[at_entry] = key_of(vec3(x, y, z));
                objects[at_entry] = index
                    | select(0u, 1u << 29u, is_first.x)
                    | select(0u, 1u << 30u, is_first.y)
                    | select(0u, 1u << 31u, is_first.z);
                at_entry += 1u;
            }
        }
    }
}
