// Third stage of the scan: every value becomes the sum of those before it, in place; its low 32 bits where the
// sum is wider.
#include layout
#include place

@group(0) @binding(0) var<storage, read> lengths: Lengths;
@group(0) @binding(1) var<storage, read> sums: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read_write> values: array<u32>;

#include group_scan
const ITEMS: u32 = #{SCAN_ITEMS}u;

@compute @workgroup_size(256)
fn scan_spread(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
#include place_builtins
) {
#include place_from_builtins
    let group = number_of_group(id, groups);
    let start = group * GROUP * ITEMS;
    if (start >= lengths.counters) {
        return;
    }
    let mine = start + place.lane * ITEMS;
    var sum = 0u;
    for (var item = 0u; item < ITEMS; item++) {
        if (mine + item < lengths.counters) {
            sum += values[mine + item];
        }
    }
    var running = sums[group].x + group_scan(sum, place);
    for (var item = 0u; item < ITEMS; item++) {
        if (mine + item < lengths.counters) {
            let next = running + values[mine + item];
            values[mine + item] = running;
            running = next;
        }
    }
}
