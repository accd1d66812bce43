// Last stage of a radix sort pass: moves each key and its payload to its place, keeping the order of equal digits.
// A tile is put in order in workgroup memory first, so that neighbours in memory are written together.
#include layout
#include place
#include digit_pass

@group(0) @binding(0) var<uniform> digit_pass: Pass;
@group(0) @binding(1) var<storage, read> lengths: Lengths;
@group(0) @binding(2) var<storage, read> keys: array<u32>;
@group(0) @binding(3) var<storage, read> payload: array<u32>;
// Exclusive prefixes of what `radix_count` counted.
@group(0) @binding(4) var<storage, read> places: array<u32>;
@group(0) @binding(5) var<storage, read_write> sorted_keys: array<u32>;
@group(0) @binding(6) var<storage, read_write> sorted_payload: array<u32>;

#include group_scan
const ITEMS: u32 = #{RADIX_ITEMS}u;
const TILE: u32 = GROUP * ITEMS;
const NO_DIGIT: u32 = 256u;

// Ranking tables first, the ordered tile afterwards.
var<workgroup> scratch: array<atomic<u32>, #{RADIX_SCRATCH}>;
// How many keys of a digit the tile has; then what to add to a place in the tile to get the place in the result.
var<workgroup> digits: array<u32, 256>;

fn digit_of(key: u32) -> u32 {
    return (key >> digit_pass.shift) & 255u;
}

#ifdef SUBGROUP_RANKING
// Each subgroup ranks a stretch of the tile of its own, with a table of 16-bit counters, two to a word. Threads
// of a subgroup follow each other's updates through the broadcast that ends every row.
fn item_index(place: Place, item: u32) -> u32 {
    return place.subgroup * place.subgroup_size * ITEMS + item * place.subgroup_size + place.lane_in_subgroup;
}

// Threads of the subgroup that have the same digit.
fn same_digit(digit: u32) -> vec4<u32> {
    var same = subgroupBallot(digit != NO_DIGIT);
    for (var bit = 0u; bit < 8u; bit++) {
        let is_set = (digit & (1u << bit)) != 0u;
        same &= subgroupBallot(is_set) ^ select(vec4(0xffffffffu), vec4(0u), is_set);
    }
    return same;
}

fn lanes_below(lane: u32) -> vec4<u32> {
    let at = vec4<i32>(i32(lane)) - vec4(0, 32, 64, 96);
    let partial = (vec4(1u) << vec4<u32>(clamp(at, vec4(0), vec4(31)))) - vec4(1u);
    return select(partial, vec4(0xffffffffu), at >= vec4(32));
}

fn ones(mask: vec4<u32>) -> u32 {
    let counts = countOneBits(mask);
    return counts.x + counts.y + counts.z + counts.w;
}

fn rank_items(place: Place, count: u32, item_keys: ptr<function, array<u32, ITEMS>>) -> array<u32, ITEMS> {
    let words = place.subgroups * 128u;
    for (var turn = 0u; turn < (words + GROUP - 1u) / GROUP; turn++) {
        let word = turn * GROUP + place.lane;
        if (word < words) {
            atomicStore(&scratch[word], 0u);
        }
    }
    workgroupBarrier();
    var ranks: array<u32, ITEMS>;
    let below = lanes_below(place.lane_in_subgroup);
    for (var item = 0u; item < ITEMS; item++) {
        let used = item_index(place, item) < count;
        let digit = select(NO_DIGIT, digit_of((*item_keys)[item]), used);
        let same = same_digit(digit);
        let rank = ones(same & below);
        let half = (digit & 1u) * 16u;
        var before = 0u;
        if (used && rank == 0u) {
            let word = place.subgroup * 128u + digit / 2u;
            before = (atomicAdd(&scratch[word], ones(same) << half) >> half) & 0xffffu;
        }
        let first = firstTrailingBit(same.x);
        var leader = first;
        if (same.x == 0u) {
            leader = 32u + firstTrailingBit(same.y);
        }
        ranks[item] = rank + subgroupShuffle(before, select(0u, leader, used));
    }
    workgroupBarrier();
    // Subgroups one after another; both halves of a word at once, as neither sum reaches 2^16.
    if (place.lane < 128u) {
        var running = 0u;
        for (var s = 0u; s < place.subgroups; s++) {
            let word = s * 128u + place.lane;
            let next = atomicLoad(&scratch[word]);
            atomicStore(&scratch[word], running);
            running += next;
        }
        digits[place.lane * 2u] = running & 0xffffu;
        digits[place.lane * 2u + 1u] = running >> 16u;
    }
    workgroupBarrier();
    for (var item = 0u; item < ITEMS; item++) {
        let digit = digit_of((*item_keys)[item]);
        let word = atomicLoad(&scratch[place.subgroup * 128u + digit / 2u]);
        ranks[item] += (word >> ((digit & 1u) * 16u)) & 0xffffu;
    }
    workgroupBarrier();
    return ranks;
}
#else
fn item_index(place: Place, item: u32) -> u32 {
    return item * GROUP + place.lane;
}

// Row by row: the threads with one digit set their bits in that digit's 256-bit mask; the bits below a thread's
// own are its rank.
fn rank_items(place: Place, count: u32, item_keys: ptr<function, array<u32, ITEMS>>) -> array<u32, ITEMS> {
    for (var word = 0u; word < 8u; word++) {
        atomicStore(&scratch[word * GROUP + place.lane], 0u);
    }
    digits[place.lane] = 0u;
    workgroupBarrier();
    var ranks: array<u32, ITEMS>;
    let own_word = place.lane / 32u;
    let own_bit = 1u << (place.lane % 32u);
    for (var item = 0u; item < ITEMS; item++) {
        let used = item_index(place, item) < count;
        let digit = digit_of((*item_keys)[item]);
        if (used) {
            atomicOr(&scratch[own_word * GROUP + digit], own_bit);
        }
        workgroupBarrier();
        var rank = 0u;
        var total = 0u;
        if (used) {
            for (var word = 0u; word < 8u; word++) {
                let mask = atomicLoad(&scratch[word * GROUP + digit]);
                let below = select(select(0u, own_bit - 1u, word == own_word), 0xffffffffu, word < own_word);
                rank += countOneBits(mask & below);
                total += countOneBits(mask);
            }
            ranks[item] = digits[digit] + rank;
        }
        workgroupBarrier();
        if (used && rank == 0u) {
            digits[digit] += total;
            for (var word = 0u; word < 8u; word++) {
                atomicStore(&scratch[word * GROUP + digit], 0u);
            }
        }
        workgroupBarrier();
    }
    return ranks;
}
#endif

@compute @workgroup_size(256)
fn radix_scatter(@builtin(workgroup_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, place: Place) {
    let group = number_of_group(id, groups);
    let start = group * TILE;
    if (start >= lengths.items) {
        return;
    }
    let count = min(TILE, lengths.items - start);
    var item_keys: array<u32, ITEMS>;
    for (var item = 0u; item < ITEMS; item++) {
        let index = item_index(place, item);
        if (index < count) {
            item_keys[item] = keys[start + index];
        }
    }
    var ranks = rank_items(place, count, &item_keys);

    let in_tile = group_scan(digits[place.lane], place);
    digits[place.lane] = in_tile;
    workgroupBarrier();
    for (var item = 0u; item < ITEMS; item++) {
        if (item_index(place, item) < count) {
            ranks[item] += digits[digit_of(item_keys[item])];
            atomicStore(&scratch[ranks[item]], item_keys[item]);
        }
    }
    workgroupBarrier();
    digits[place.lane] = places[place.lane * (lengths.counters / 256u) + group] - in_tile;
    workgroupBarrier();
    var targets: array<u32, ITEMS>;
    for (var item = 0u; item < ITEMS; item++) {
        let index = item * GROUP + place.lane;
        if (index < count) {
            let key = atomicLoad(&scratch[index]);
            targets[item] = digits[digit_of(key)] + index;
            sorted_keys[targets[item]] = key;
        }
    }
    workgroupBarrier();
    for (var item = 0u; item < ITEMS; item++) {
        let index = item_index(place, item);
        if (index < count) {
            atomicStore(&scratch[ranks[item]], payload[start + index]);
        }
    }
    workgroupBarrier();
    for (var item = 0u; item < ITEMS; item++) {
        let index = item * GROUP + place.lane;
        if (index < count) {
            sorted_payload[targets[item]] = atomicLoad(&scratch[index]);
        }
    }
}
