// The whole exclusive prefix scan if there are few values: one workgroup, of which each thread sums a stretch and
// spreads what comes before it.
#include layout
#include place

@group(0) @binding(0) var<storage, read> lengths: Lengths;
@group(0) @binding(1) var<storage, read_write> values: array<u32>;

#include group_scan

@compute @workgroup_size(256)
fn scan_once(
#include place_builtins
) {
#include place_from_builtins
    let stretch = (lengths.counters + GROUP - 1u) / GROUP;
    let begin = place.lane * stretch;
    let end = min(begin + stretch, lengths.counters);
    var sum = 0u;
    for (var index = begin; index < end; index++) {
        sum += values[index];
    }
    var running = group_scan(sum, place);
    for (var index = begin; index < end; index++) {
        let next = running + values[index];
        values[index] = running;
        running = next;
    }
}
