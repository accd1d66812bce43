// See receiver_cells.rs.
struct NearbyReceivers {
    // In the table of events, or in the lists.
    begin: u32,
    end: u32,
    is_listed: bool,
}

fn list_word(k: u32) -> u32 {
    return scene_rows[trajectory.cells_at + k / 4u][k % 4u];
}

// May return receivers farther away than `distance`.
fn receivers_near(kind: SpeciesRow, point: vec3<f32>, distance: f32) -> NearbyReceivers {
    let every = NearbyReceivers(kind.events_begin, kind.decays_begin, false);
    let cells = trajectory.cells;
    if (kind.cell_lists == NOTHING || cells.counts.x == 0u || !(distance <= kind.search_distance + 3.0 * trajectory.max_displacement)) {
        return every;
    }
    let at = floor((point - cells.low) * cells.cells_per_length);
    let within = (at >= vec3(0.0)) & (at < vec3<f32>(cells.counts));
    if (!all(within)) {
        if (any(!within & (params.axes == vec3(2u)))) {
            return every;
        }
        return NearbyReceivers(0u, 0u, false);
    }
    let cell = vec3<u32>(at);
    let count = cells.counts.x * cells.counts.y * cells.counts.z;
    let k = kind.cell_lists * (count + 1u) + cell.x + cells.counts.x * (cell.y + cells.counts.y * cell.z);
    return NearbyReceivers(list_word(k), list_word(k + 1u), true);
}

fn event_at(near_receivers: NearbyReceivers, k: u32) -> u32 {
    if (near_receivers.is_listed) {
        return list_word(k);
    }
    return k;
}

// Bounds the distance of ends, and of a line that a vessel reflects, from the beginning.
fn path_extent(path: Path) -> f32 {
    let ends = max(length(path.end - path.before), length(minimum_image(path.after - path.before)));
    let line = select(path.free_end - path.before, path.drift, params.vessel_axis == NO_VESSEL);
    return max(ends, max(length(line), length(path.drift)));
}
