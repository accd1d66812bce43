// Takes `count` places in the list of pairs; the count goes on past the capacity, in 64 bits. Returns the first
// place, which is at or above the capacity when nothing may be written.
fn pairs_reserve(count: u32) -> u32 {
    let first = atomicAdd(&outcome.found_lo, count);
    if (first > 0xffffffffu - count) {
        atomicAdd(&outcome.found_hi, 1u);
        return 0xffffffffu;
    }
    return select(first, 0xffffffffu, atomicLoad(&outcome.found_hi) != 0u);
}

fn is_in_window(smaller: u32) -> bool {
    return smaller >= call.window_begin && smaller < call.window_end;
}

fn pair_write(place: u32, a: u32, b: u32) {
    if (place < call.pair_capacity) {
        pairs[place] = vec2(min(a, b), max(a, b));
    }
}
