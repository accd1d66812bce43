#include reserve found

fn is_in_window(smaller: u32) -> bool {
    return smaller >= call.window_begin && smaller < call.window_end;
}

fn pair_write(place: u32, a: u32, b: u32) {
    if (place < call.pair_capacity) {
        pairs[place] = vec2(min(a, b), max(a, b));
    }
}
