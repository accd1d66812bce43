// The counter of a cell of level 0. Cells that share one look more crowded than they are, to all who ask.
fn density_slot(cell: u32) -> u32 {
    return cell & (call.density_slots - 1u);
}
