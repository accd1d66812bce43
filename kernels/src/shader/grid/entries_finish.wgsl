#include layout

@group(0) @binding(0) var<uniform> params: SearchParams;
@group(0) @binding(1) var<storage, read_write> outcome: Outcome;
@group(0) @binding(2) var<storage, read_write> sort_counts: SortCounts;

const TILE: u32 = 256u * #{RADIX_ITEMS}u;

@compute @workgroup_size(1)
fn entries_finish() {
    let wanted = atomicLoad(&outcome.entries_lo);
    let full = atomicLoad(&outcome.entries_hi) != 0u || wanted > params.entry_capacity;
    if (full) {
        atomicOr(&outcome.overflow, 2u);
    }
    let items = select(wanted, params.entry_capacity, full);
    sort_counts.items = items;
    sort_counts.counters = ((items + TILE - 1u) / TILE) * 256u;
}
