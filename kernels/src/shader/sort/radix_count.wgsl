#include layout
#include thread

@group(0) @binding(0) var<uniform> digit_pass: RadixPass;
@group(0) @binding(1) var<storage, read> sort_counts: SortCounts;
@group(0) @binding(2) var<storage, read> keys: array<u32>;
@group(0) @binding(3) var<storage, read_write> counts: array<u32>;
#include digit_pass

const WORKGROUP_SIZE: u32 = 256u;
const ITEMS: u32 = #{RADIX_ITEMS}u;

var<workgroup> histogram: array<atomic<u32>, 256>;

@compute @workgroup_size(256)
fn radix_count(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
#include thread_builtins
) {
#include thread_from_builtins
    let group = workgroup_index(id, groups);
    let start = group * WORKGROUP_SIZE * ITEMS;
    if (start >= sort_counts.items) {
        return;
    }
    atomicStore(&histogram[thread.local_index], 0u);
    workgroupBarrier();
    for (var item = 0u; item < ITEMS; item++) {
        let index = start + item * WORKGROUP_SIZE + thread.local_index;
        if (index < sort_counts.items) {
            atomicAdd(&histogram[digit_of(keys[index])], 1u);
        }
    }
    workgroupBarrier();
    counts[thread.local_index * (sort_counts.counters / 256u) + group] = atomicLoad(&histogram[thread.local_index]);
}
