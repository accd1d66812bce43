#include layout
#include thread

@group(0) @binding(0) var<storage, read> sort_counts: SortCounts;
@group(0) @binding(1) var<storage, read_write> sums: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read_write> total: vec2<u32>;

#include u64
const TILE: u32 = 256u * #{SCAN_ITEMS}u;
const ITEMS: u32 = 8u;

var<workgroup> scan: array<vec2<u32>, 512>;

@compute @workgroup_size(256)
fn scan_spine(
#include thread_builtins
) {
#include thread_from_builtins
    let tiles = sort_counts.counters / TILE + select(0u, 1u, sort_counts.counters % TILE != 0u);
    var carry = vec2(0u);
    let rounds = (tiles + 256u * ITEMS - 1u) / (256u * ITEMS);
    for (var round = 0u; round < rounds; round++) {
        let mine = (round * 256u + thread.local_index) * ITEMS;
        var sum = vec2(0u);
        for (var item = 0u; item < ITEMS; item++) {
            if (mine + item < tiles) {
                sum = u64_add(sum, sums[mine + item]);
            }
        }
        var front = 0u;
        scan[thread.local_index] = sum;
        workgroupBarrier();
        for (var step = 1u; step < 256u; step *= 2u) {
            var value = scan[front + thread.local_index];
            if (thread.local_index >= step) {
                value = u64_add(value, scan[front + thread.local_index - step]);
            }
            front = 256u - front;
            scan[front + thread.local_index] = value;
            workgroupBarrier();
        }
        var running = carry;
        if (thread.local_index > 0u) {
            running = u64_add(carry, scan[front + thread.local_index - 1u]);
        }
        carry = u64_add(carry, scan[front + 255u]);
        for (var item = 0u; item < ITEMS; item++) {
            if (mine + item < tiles) {
                let next = u64_add(running, sums[mine + item]);
                sums[mine + item] = running;
                running = next;
            }
        }
        workgroupBarrier();
    }
    if (thread.local_index == 0u) {
        total = carry;
    }
}
