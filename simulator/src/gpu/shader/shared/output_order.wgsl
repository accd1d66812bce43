// The order of the detector's cells, which keeps neighbors close in memory, or the previous order.
struct OutputOrder {
    is_cell_order: u32,
}

fn output_index(k: u32, count: u32) -> u32 {
    if (output_order.is_cell_order == 0u || k >= count) {
        return k;
    }
    return order[k];
}
