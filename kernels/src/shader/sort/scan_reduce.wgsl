#include layout
#include thread

@group(0) @binding(0) var<storage, read> sort_counts: SortCounts;
@group(0) @binding(1) var<storage, read> values: array<u32>;
@group(0) @binding(2) var<storage, read_write> sums: array<vec2<u32>>;

#include u64
const ITEMS: u32 = #{SCAN_ITEMS}u;

var<workgroup> tree: array<vec2<u32>, 256>;

@compute @workgroup_size(256)
fn scan_reduce(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
#include thread_builtins
) {
#include thread_from_builtins
    let group = workgroup_index(id, groups);
    let start = group * 256u * ITEMS;
    if (start >= sort_counts.counters) {
        return;
    }
    var sum = vec2(0u);
    for (var item = 0u; item < ITEMS; item++) {
        let index = start + item * 256u + thread.local_index;
        if (index < sort_counts.counters) {
            sum = u64_add(sum, vec2(values[index], 0u));
        }
    }
    tree[thread.local_index] = sum;
    workgroupBarrier();
    for (var step = 128u; step > 0u; step /= 2u) {
        if (thread.local_index < step) {
            tree[thread.local_index] = u64_add(tree[thread.local_index], tree[thread.local_index + step]);
        }
        workgroupBarrier();
    }
    if (thread.local_index == 0u) {
        sums[group] = tree[0];
    }
}
