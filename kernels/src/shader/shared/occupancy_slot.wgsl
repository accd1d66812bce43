fn occupancy_slot(cell: u32) -> u32 {
    return cell & (params.occupancy_slots - 1u);
}
