#include layout
#include thread

@group(0) @binding(0) var<storage, read> sort_counts: SortCounts;
@group(0) @binding(1) var<storage, read> sums: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read_write> values: array<u32>;

#include workgroup_scan
const ITEMS: u32 = #{SCAN_ITEMS}u;

@compute @workgroup_size(256)
fn scan_spread(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
#include thread_builtins
) {
#include thread_from_builtins
    let group = workgroup_index(id, groups);
    let start = group * WORKGROUP_SIZE * ITEMS;
    if (start >= sort_counts.counters) {
        return;
    }
    let mine = start + thread.local_index * ITEMS;
    var sum = 0u;
    for (var item = 0u; item < ITEMS; item++) {
        if (mine + item < sort_counts.counters) {
            sum += values[mine + item];
        }
    }
    var running = sums[group].x + workgroup_scan(sum, thread);
    for (var item = 0u; item < ITEMS; item++) {
        if (mine + item < sort_counts.counters) {
            let next = running + values[mine + item];
            values[mine + item] = running;
            running = next;
        }
    }
}
