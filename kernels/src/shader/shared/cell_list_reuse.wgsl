#include outcome_clear

const OVERFLOW_LAYOUT: u32 = 32u;
// Above this occupancy of a cell, the call may need other cells.
const MAX_OCCUPANCY: u32 = 64u;

fn refuse_layout() {
    if ((atomicLoad(&outcome.overflow) & OVERFLOW_LAYOUT) == 0u) {
        atomicOr(&outcome.overflow, OVERFLOW_LAYOUT);
    }
}

fn max_occupancy_of(cell: u32) -> u32 {
    let limit = select(min(params.tau, MAX_OCCUPANCY), MAX_LISTED, cell == cell_list.cells);
    return select(limit, 0xffffffffu, cell > cell_list.cells);
}

fn reuse_outcome() {
    atomicAnd(&outcome.overflow, OVERFLOW_LAYOUT);
    outcome_clear(cell_list.spheres);
    atomicStore(&outcome.quarantined, 0u);
    atomicStore(&outcome.max_occupancy, 0u);
    atomicStore(&outcome.entries_lo, cell_list.spheres);
    atomicStore(&outcome.pairs_in_cell_order, params.pairs_in_cell_order);
    atomicStore(&outcome.dispatch_x, 0u);
    atomicStore(&outcome.dispatch_y, 1u);
    atomicStore(&outcome.dispatch_z, 1u);
}
