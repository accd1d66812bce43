// Along a run, partners up to this many places away are found thread by thread, those beyond by tiles. As it is
// a block's length, at most one run of a block has partners beyond.
const NEAR: u32 = 256u;

fn index_of(object: u32) -> u32 {
    return object & 0x1fffffffu;
}

// Whether the cell of two entries is the one that reports their pair: on each axis the larger of their first
// cells. As both overlap the cell, that is where each axis has one that begins here.
fn is_owned(object: u32, other: u32) -> bool {
    return ((object | other) >> 29u) == 7u;
}

// Whether the call asks for the pair of two entries.
fn is_wanted(object: u32, other: u32) -> bool {
    return is_asked_for(index_of(object), index_of(other));
}

// What the keys of one cell's entries have in common.
fn run_of(key: u32) -> u32 {
    return key >> grid.passive;
}

// Passive entries are the last ones of their run, and pairs among them are found at a deeper level.
fn is_passive(key: u32) -> bool {
    return (key & grid.passive) != 0u;
}

// One past the last entry of this run, which begins at or before `begin`.
fn run_end(run: u32, begin: u32) -> u32 {
    var low = begin;
    var high = sort_counts.items;
    // A turn leaves half of them, or less.
    for (var turn = 32u - countLeadingZeros(high - min(low, high)); turn > 0u; turn--) {
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
