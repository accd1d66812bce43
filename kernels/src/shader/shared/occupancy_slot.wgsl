// The counter of a cell of level 0. Cells that share one look more crowded than they are, to all who ask.
fn occupancy_slot(cell: u32) -> u32 {
    return cell & (params.occupancy_slots - 1u);
}
