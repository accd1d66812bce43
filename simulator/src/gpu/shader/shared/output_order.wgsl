// The order of particles after a step: the order of the detector's cells, in which neighbors in space are neighbors in
// memory, or the order before the step.
struct OutputOrder {
    // 1 if the detector provides the order of its cells.
    is_cell_order: u32,
}

fn output_index(k: u32, count: u32) -> u32 {
    if (output_order.is_cell_order == 0u || k >= count) {
        return k;
    }
    return order[k];
}
