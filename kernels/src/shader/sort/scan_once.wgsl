#include layout
#include thread

@group(0) @binding(0) var<storage, read> sort_counts: SortCounts;
@group(0) @binding(1) var<storage, read_write> values: array<u32>;

#include workgroup_scan

@compute @workgroup_size(256)
fn scan_once(
#include thread_builtins
) {
#include thread_from_builtins
    let stretch = (sort_counts.counters + WORKGROUP_SIZE - 1u) / WORKGROUP_SIZE;
    let begin = thread.local_index * stretch;
    let end = min(begin + stretch, sort_counts.counters);
    var sum = 0u;
    for (var index = begin; index < end; index++) {
        sum += values[index];
    }
    var running = workgroup_scan(sum, thread);
    for (var index = begin; index < end; index++) {
        let next = running + values[index];
        values[index] = running;
        running = next;
    }
}
