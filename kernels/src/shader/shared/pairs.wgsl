#include reserve found

fn is_in_window(smaller: u32) -> bool {
    return smaller >= call.window_begin && smaller < call.window_end;
}

// Whether the call asks for all pairs, of either order of indices.
fn asks_for_all(spheres: u32) -> bool {
    return call.window_begin == 0u && call.window_end >= spheres && call.split == 0u;
}

// Whether the call asks for this pair: within its window and, of two sets, with one sphere of each.
fn is_asked_for(a: u32, b: u32) -> bool {
    let crosses = call.split == 0u || ((a < call.split) != (b < call.split));
    return crosses && is_in_window(min(a, b));
}

fn pair_write(place: u32, a: u32, b: u32) {
    if (place < call.pair_capacity) {
        pairs[place] = vec2(min(a, b), max(a, b));
    }
}
