// Each thread tests the partners in its run up to NEAR positions away. Tiles contain the later partners. NEAR is a
// block's length, so at most one run of a block has later partners.
const NEAR: u32 = #{NEAR}u;

fn index_of(object: u32) -> u32 {
    return object & 0x1fffffffu;
}

// Returns `true` if the cell of two entries reports their pair: on each axis it must be the larger of their first
// cells. Both overlap the cell, so it is if on each axis one of them begins there.
fn is_owned(object: u32, other: u32) -> bool {
    return ((object | other) >> 29u) == 7u;
}

fn is_wanted(object: u32, other: u32) -> bool {
    return is_asked_for(index_of(object), index_of(other));
}

fn run_of(key: u32) -> u32 {
    return key >> grid.passive;
}

// Passive entries are the last of their run; pairs among them are found at a deeper level.
fn is_passive(key: u32) -> bool {
    return (key & grid.passive) != 0u;
}

fn run_end(run: u32, begin: u32) -> u32 {
    var low = begin;
    var high = sort_counts.items;
    // Each iteration at least halves the range.
    for (var iteration = 32u - countLeadingZeros(high - min(low, high)); iteration > 0u; iteration--) {
        if (low >= high) {
            break;
        }
        let middle = low + (high - low) / 2u;
        if (run_of(keys[middle]) == run) {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    return low;
}
