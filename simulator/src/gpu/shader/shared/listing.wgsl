// The order in which a step leaves the particles: that of the detector's cells, where neighbours in space are neighbours in
// memory, or the one they had.
struct Listing {
    // 1 where the detector has such an order.
    is_listed: u32,
}

// The place of the particle that comes `k`-th.
fn listed(k: u32, count: u32) -> u32 {
    if (listing.is_listed == 0u || k >= count) {
        return k;
    }
    return order[k];
}
