// Clears what the call accumulates and settles how many spheres it has.
#include layout

@group(0) @binding(0) var<uniform> call: Call;
@group(0) @binding(1) var<storage, read> count_source: array<u32>;
@group(0) @binding(2) var<storage, read_write> bounds: Bounds;
@group(0) @binding(3) var<storage, read_write> grid: Grid;
@group(0) @binding(4) var<storage, read_write> outcome: Outcome;

@compute @workgroup_size(1)
fn call_begin() {
    let given = count_source[0];
    atomicStore(&bounds.low_x, 0xffffffffu);
    atomicStore(&bounds.low_y, 0xffffffffu);
    atomicStore(&bounds.low_z, 0xffffffffu);
    atomicStore(&bounds.high_x, 0u);
    atomicStore(&bounds.high_y, 0u);
    atomicStore(&bounds.high_z, 0u);
    atomicStore(&bounds.radius_min, 0xffffffffu);
    atomicStore(&bounds.radius_max, 0u);
    atomicStore(&bounds.depths, 0u);
    for (var depth = 0u; depth < 32u; depth++) {
        atomicStore(&bounds.descending[depth], 0u);
    }
    grid.spheres = min(given, call.spheres);
    atomicStore(&outcome.found_lo, 0u);
    atomicStore(&outcome.found_hi, 0u);
    atomicStore(&outcome.overflow, select(0u, 4u, given > call.spheres));
    atomicStore(&outcome.quarantined, 0u);
    atomicStore(&outcome.crowded, 0u);
    atomicStore(&outcome.crowded_tiles, 0u);
    atomicStore(&outcome.crowded_begin, 0u);
    atomicStore(&outcome.crowded_end, 0u);
    atomicStore(&outcome.is_sorted, 0u);
    atomicStore(&outcome.entries_lo, 0u);
    atomicStore(&outcome.entries_hi, 0u);
    atomicStore(&outcome.spheres, given);
}
