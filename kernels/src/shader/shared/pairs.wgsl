#include reserve found

fn is_in_window(smaller: u32) -> bool {
    return smaller >= params.window_begin && smaller < params.window_end;
}

fn asks_for_all(spheres: u32) -> bool {
    return params.window_begin == 0u && params.window_end >= spheres && params.second_set_start == 0u;
}

fn is_asked_for(a: u32, b: u32) -> bool {
    let crosses = params.second_set_start == 0u || ((a < params.second_set_start) != (b < params.second_set_start));
    return crosses && is_in_window(min(a, b));
}

fn pair_write(position: u32, a: u32, b: u32) {
    if (position < params.pair_capacity) {
        pairs[position] = vec2(min(a, b), max(a, b));
    }
}
