// Threads test partners up to NEAR positions away; tiles contain later partners. NEAR is a block's length, so at most
// one run of a block has later partners.
const NEAR: u32 = #{NEAR}u;

fn index_of(object: u32) -> u32 {
    return object & 0x1fffffffu;
}

// The cell that reports a pair is on each axis the larger of both first cells. Both overlap this cell, so on each axis
// one must begin here.
fn is_owned(object: u32, other: u32) -> bool {
    return ((object | other) >> 29u) == 7u;
}

fn is_wanted(object: u32, other: u32) -> bool {
    return is_asked_for(index_of(object), index_of(other));
}

fn run_of(key: u32) -> u32 {
    return key >> grid.passive;
}

// Passive entries end their run; pairs among them are found at a deeper level.
fn is_passive(key: u32) -> bool {
    return (key & grid.passive) != 0u;
}

fn run_end(run: u32, begin: u32) -> u32 {
    var low = begin;
    var high = sort_counts.items;
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
