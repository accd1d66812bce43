// First of three stages of the exclusive prefix scan: the 64-bit sum of each tile.
#include layout
#include place

@group(0) @binding(0) var<storage, read> lengths: Lengths;
@group(0) @binding(1) var<storage, read> values: array<u32>;
@group(0) @binding(2) var<storage, read_write> sums: array<vec2<u32>>;

#include wide
const ITEMS: u32 = #{SCAN_ITEMS}u;

var<workgroup> tree: array<vec2<u32>, 256>;

@compute @workgroup_size(256)
fn scan_reduce(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
#include place_builtins
) {
#include place_from_builtins
    let group = number_of_group(id, groups);
    let start = group * 256u * ITEMS;
    if (start >= lengths.counters) {
        return;
    }
    var sum = vec2(0u);
    for (var item = 0u; item < ITEMS; item++) {
        let index = start + item * 256u + place.lane;
        if (index < lengths.counters) {
            sum = wide_add(sum, vec2(values[index], 0u));
        }
    }
    tree[place.lane] = sum;
    workgroupBarrier();
    for (var step = 128u; step > 0u; step /= 2u) {
        if (place.lane < step) {
            tree[place.lane] = wide_add(tree[place.lane], tree[place.lane + step]);
        }
        workgroupBarrier();
    }
    if (place.lane == 0u) {
        sums[group] = tree[0];
    }
}
