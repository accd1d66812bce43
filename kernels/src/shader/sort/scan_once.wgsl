// Scans in place, in one workgroup. The largest value follows the last sum.
#include layout
#include thread

@group(0) @binding(0) var<storage, read> sort_counts: SortCounts;
@group(0) @binding(1) var<storage, read_write> values: array<vec4<u32>>;

#include workgroup_scan

var<workgroup> largest_value: atomic<u32>;

// Each thread loads 16 consecutive values at once: a warp reads whole lines.
const VECTORS: u32 = 4u;

@compute @workgroup_size(256)
fn scan_once(
#include thread_builtins
) {
#include thread_from_builtins
    if (thread.local_index == 0u) {
        atomicStore(&largest_value, 0u);
    }
    let vectors = (sort_counts.counters + 3u) / 4u;
    let rounds = (vectors + WORKGROUP_SIZE * VECTORS - 1u) / (WORKGROUP_SIZE * VECTORS);
    var running = 0u;
    var largest = vec4(0u);
    for (var round = 0u; round < rounds; round++) {
        let first = (round * WORKGROUP_SIZE + thread.local_index) * VECTORS;
        var sum = 0u;
#repeat K 4
        var before_#{K} = vec4(0u);
        if (first + #{K}u < vectors) {
            before_#{K} = values[first + #{K}u];
        }
#end
#repeat K 4
        largest = max(largest, before_#{K});
        before_#{K} = sum + vec4(
            before_#{K}.x,
            before_#{K}.x + before_#{K}.y,
            before_#{K}.x + before_#{K}.y + before_#{K}.z,
            before_#{K}.x + before_#{K}.y + before_#{K}.z + before_#{K}.w,
        );
        let start_#{K} = sum;
        sum = before_#{K}.w;
#end
        let start = running + workgroup_scan(sum, thread);
        running += workgroup_sum();
#repeat K 4
        if (first + #{K}u < vectors) {
            values[first + #{K}u] = start + vec4(start_#{K}, before_#{K}.xyz);
        }
#end
    }
    let most = max(max(largest.x, largest.y), max(largest.z, largest.w));
    workgroupBarrier();
    atomicMax(&largest_value, most);
    storageBarrier();
    workgroupBarrier();
    if (thread.local_index == 0u) {
        values[sort_counts.counters / 4u][sort_counts.counters % 4u] = atomicLoad(&largest_value);
    }
}
