// Scans a digit's counts in one workgroup per digit. With few tiles, the first workgroup has a digit per thread and no
// barrier.
#include layout
#include thread

@group(0) @binding(0) var<storage, read> sort_counts: SortCounts;
@group(0) @binding(1) var<storage, read_write> counts: array<u32>;
@group(0) @binding(2) var<storage, read_write> totals: array<u32>;

#include workgroup_scan
const ITEMS: u32 = 8u;
const SERIAL_TILES: u32 = 8u;

@compute @workgroup_size(256)
fn radix_scan(
    @builtin(workgroup_id) id: vec3<u32>,
#include thread_builtins
) {
#include thread_from_builtins
    let tiles = sort_counts.counters / 256u;
    if (tiles <= SERIAL_TILES) {
        if (id.x == 0u) {
            let first = thread.local_index * tiles;
            var before = 0u;
            for (var tile = 0u; tile < SERIAL_TILES; tile++) {
                if (tile < tiles) {
                    let next = counts[first + tile];
                    counts[first + tile] = before;
                    before += next;
                }
            }
            totals[thread.local_index] = before;
        }
        return;
    }
    let row = id.x * tiles;
    let rounds = (tiles + WORKGROUP_SIZE * ITEMS - 1u) / (WORKGROUP_SIZE * ITEMS);
    var carry = 0u;
    for (var round = 0u; round < rounds; round++) {
        let mine = (round * WORKGROUP_SIZE + thread.local_index) * ITEMS;
        var sum = 0u;
        for (var item = 0u; item < ITEMS; item++) {
            if (mine + item < tiles) {
                sum += counts[row + mine + item];
            }
        }
        var running = carry + workgroup_scan(sum, thread);
        carry += workgroup_sum();
        for (var item = 0u; item < ITEMS; item++) {
            if (mine + item < tiles) {
                let next = running + counts[row + mine + item];
                counts[row + mine + item] = running;
                running = next;
            }
        }
    }
    if (thread.local_index == 0u) {
        totals[id.x] = carry;
    }
}
