// First stage of a radix sort pass: how often each digit occurs in each tile, digit by digit.
#include layout
#include place

@group(0) @binding(0) var<uniform> digit_pass: Pass;
@group(0) @binding(1) var<storage, read> lengths: Lengths;
@group(0) @binding(2) var<storage, read> keys: array<u32>;
@group(0) @binding(3) var<storage, read_write> counts: array<u32>;
#include digit_pass

const GROUP: u32 = 256u;
const ITEMS: u32 = #{RADIX_ITEMS}u;

var<workgroup> histogram: array<atomic<u32>, 256>;

@compute @workgroup_size(256)
fn radix_count(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
#include place_builtins
) {
#include place_from_builtins
    let group = number_of_group(id, groups);
    let start = group * GROUP * ITEMS;
    if (start >= lengths.items) {
        return;
    }
    atomicStore(&histogram[place.lane], 0u);
    workgroupBarrier();
    for (var item = 0u; item < ITEMS; item++) {
        let index = start + item * GROUP + place.lane;
        if (index < lengths.items) {
            atomicAdd(&histogram[digit_of(keys[index])], 1u);
        }
    }
    workgroupBarrier();
    counts[place.lane * (lengths.counters / 256u) + group] = atomicLoad(&histogram[place.lane]);
}
