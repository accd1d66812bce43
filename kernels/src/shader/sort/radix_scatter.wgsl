// Moves keys and payloads to their sorted positions, stably. A tile is sorted in workgroup memory first, so that writes
// are coalesced. Loops over keys are unrolled in the text, so that values stay in registers with any compiler.
#include layout
#include thread

@group(0) @binding(0) var<uniform> digit_pass: RadixPass;
@group(0) @binding(1) var<storage, read> sort_counts: SortCounts;
@group(0) @binding(2) var<storage, read> keys: array<u32>;
@group(0) @binding(3) var<storage, read> payload: array<u32>;
// Keys per digit in earlier tiles, and in all tiles.
@group(0) @binding(4) var<storage, read> counts: array<u32>;
@group(0) @binding(5) var<storage, read> totals: array<u32>;
@group(0) @binding(6) var<storage, read_write> sorted_keys: array<u32>;
@group(0) @binding(7) var<storage, read_write> sorted_payload: array<u32>;
#include digit_pass

#include workgroup_scan
const ITEMS: u32 = #{RADIX_ITEMS}u;
const TILE: u32 = WORKGROUP_SIZE * ITEMS;
const NO_DIGIT: u32 = 256u;

// Ranking tables, later the sorted tile.
var<workgroup> scratch: array<atomic<u32>, #{RADIX_SCRATCH}>;
// Keys per digit; later the offset from the tile to the result.
var<workgroup> digits: array<u32, 256>;

#ifdef SUBGROUP_RANKING
// Each subgroup ranks its own part of the tile, with two 16-bit counters per word. A stable sort updates counters row
// after row, and only a barrier after each row orders updates of different lanes.
fn item_index(thread: Thread, item: u32) -> u32 {
    return thread.subgroup * thread.subgroup_size * ITEMS + item * thread.subgroup_size + thread.lane;
}

fn same_digit(digit: u32) -> vec4<u32> {
    var same = subgroupBallot(digit != NO_DIGIT);
#repeat BIT 8
    same &= subgroupBallot((digit & (1u << #{BIT}u)) != 0u)
        ^ select(vec4(0xffffffffu), vec4(0u), (digit & (1u << #{BIT}u)) != 0u);
#end
    return same;
}

fn lanes_below(lane: u32) -> vec4<u32> {
    let at = vec4<i32>(i32(lane)) - vec4(0, 32, 64, 96);
    let partial = (vec4(1u) << vec4<u32>(clamp(at, vec4(0), vec4(31)))) - vec4(1u);
    return select(partial, vec4(0xffffffffu), at >= vec4(32));
}

// The mask is not empty.
fn lowest_lane(mask: vec4<u32>) -> u32 {
    let low = select(32u + firstTrailingBit(mask.y), firstTrailingBit(mask.x), mask.x != 0u);
    let high = select(96u + firstTrailingBit(mask.w), 64u + firstTrailingBit(mask.z), mask.z != 0u);
    return select(high, low, (mask.x | mask.y) != 0u);
}

fn ones(mask: vec4<u32>) -> u32 {
    let counts = countOneBits(mask);
    return counts.x + counts.y + counts.z + counts.w;
}

fn clear_tables(thread: Thread) {
    let words = thread.subgroups * 128u;
    for (var iteration = 0u; iteration < (words + WORKGROUP_SIZE - 1u) / WORKGROUP_SIZE; iteration++) {
        let word = iteration * WORKGROUP_SIZE + thread.local_index;
        if (word < words) {
            atomicStore(&scratch[word], 0u);
        }
    }
    workgroupBarrier();
}

// Returns the number of earlier keys with this digit in this part, and the digit in the upper half. All threads must
// call it.
fn rank_of(thread: Thread, key: u32, used: bool) -> u32 {
    let digit = select(NO_DIGIT, digit_of(key), used);
    let same = same_digit(digit);
    let rank = ones(same & lanes_below(thread.lane));
    let half = (digit & 1u) * 16u;
    var before = 0u;
    if (used && rank == 0u) {
        let word = thread.subgroup * 128u + digit / 2u;
        before = (atomicAdd(&scratch[word], ones(same) << half) >> half) & 0xffffu;
    }
    workgroupBarrier();
    return rank + subgroupShuffle(before, select(0u, lowest_lane(same), used)) + (digit << 16u);
}

// Replaces counts by the positions at which a subgroup's keys of each digit begin. Sums both halves of a word at once,
// because neither reaches 2^16. A barrier must precede it.
fn merge_tables(thread: Thread) {
    if (thread.local_index < 128u) {
        var total = 0u;
        for (var s = 0u; s < thread.subgroups; s++) {
            total += atomicLoad(&scratch[s * 128u + thread.local_index]);
        }
        digits[thread.local_index * 2u] = total & 0xffffu;
        digits[thread.local_index * 2u + 1u] = total >> 16u;
    }
    workgroupBarrier();
    let in_tile = workgroup_scan(digits[thread.local_index], thread);
    digits[thread.local_index] = in_tile;
    workgroupBarrier();
    if (thread.local_index < 128u) {
        var running = digits[thread.local_index * 2u] | (digits[thread.local_index * 2u + 1u] << 16u);
        for (var s = 0u; s < thread.subgroups; s++) {
            let word = s * 128u + thread.local_index;
            let next = atomicLoad(&scratch[word]);
            atomicStore(&scratch[word], running);
            running += next;
        }
    }
    workgroupBarrier();
}

fn place_in_tile(thread: Thread, ranked: u32) -> u32 {
    let word = atomicLoad(&scratch[thread.subgroup * 128u + (ranked >> 17u)]);
    return (ranked & 0xffffu) + ((word >> ((ranked >> 12u) & 16u)) & 0xffffu);
}
#else
fn item_index(thread: Thread, item: u32) -> u32 {
    return item * WORKGROUP_SIZE + thread.local_index;
}

fn clear_tables(thread: Thread) {
    for (var word = 0u; word < 8u; word++) {
        atomicStore(&scratch[word * WORKGROUP_SIZE + thread.local_index], 0u);
    }
    digits[thread.local_index] = 0u;
    workgroupBarrier();
}

// Threads set their bits in their digit's 256-bit mask; lower bits give the rank in the row.
fn rank_of(thread: Thread, key: u32, used: bool) -> u32 {
    let digit = digit_of(key);
    let own_word = thread.local_index / 32u;
    let own_bit = 1u << (thread.local_index % 32u);
    if (used) {
        atomicOr(&scratch[own_word * WORKGROUP_SIZE + digit], own_bit);
    }
    workgroupBarrier();
    var in_row = 0u;
    var total = 0u;
    var rank = 0u;
    if (used) {
        for (var word = 0u; word < 8u; word++) {
            let mask = atomicLoad(&scratch[word * WORKGROUP_SIZE + digit]);
            let below = select(select(0u, own_bit - 1u, word == own_word), 0xffffffffu, word < own_word);
            in_row += countOneBits(mask & below);
            total += countOneBits(mask);
        }
        rank = digits[digit] + in_row;
    }
    workgroupBarrier();
    if (used && in_row == 0u) {
        digits[digit] += total;
        for (var word = 0u; word < 8u; word++) {
            atomicStore(&scratch[word * WORKGROUP_SIZE + digit], 0u);
        }
    }
    workgroupBarrier();
    return rank + (digit << 16u);
}

fn merge_tables(thread: Thread) {
    let in_tile = workgroup_scan(digits[thread.local_index], thread);
    digits[thread.local_index] = in_tile;
    workgroupBarrier();
}

fn place_in_tile(thread: Thread, ranked: u32) -> u32 {
    return (ranked & 0xffffu) + digits[ranked >> 16u];
}
#endif

@compute @workgroup_size(256)
fn radix_scatter(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
#include thread_builtins
) {
#include thread_from_builtins
    let group = workgroup_index(id, groups);
    let start = group * TILE;
    if (start >= sort_counts.items) {
        return;
    }
    let count = min(TILE, sort_counts.items - start);
#repeat K #{RADIX_ITEMS}
    let from_#{K} = item_index(thread, #{K}u);
    var key_#{K} = 0u;
    if (from_#{K} < count) {
        key_#{K} = keys[start + from_#{K}];
    }
#end
    clear_tables(thread);
#repeat K #{RADIX_ITEMS}
    var ranked_#{K} = rank_of(thread, key_#{K}, from_#{K} < count);
#end
    merge_tables(thread);
#repeat K #{RADIX_ITEMS}
    ranked_#{K} = place_in_tile(thread, ranked_#{K});
#end
    workgroupBarrier();
#repeat K #{RADIX_ITEMS}
    if (from_#{K} < count) {
        atomicStore(&scratch[ranked_#{K}], key_#{K});
    }
#end
    let in_tile = digits[thread.local_index];
    let smaller = workgroup_scan(totals[thread.local_index], thread);
    digits[thread.local_index] = smaller + counts[thread.local_index * (sort_counts.counters / 256u) + group] - in_tile;
    workgroupBarrier();
#repeat K #{RADIX_ITEMS}
    var to_#{K} = 0u;
    if (#{K}u * WORKGROUP_SIZE + thread.local_index < count) {
        let key = atomicLoad(&scratch[#{K}u * WORKGROUP_SIZE + thread.local_index]);
        to_#{K} = digits[digit_of(key)] + #{K}u * WORKGROUP_SIZE + thread.local_index;
        sorted_keys[to_#{K}] = key;
    }
#end
    workgroupBarrier();
#repeat K #{RADIX_ITEMS}
    if (from_#{K} < count) {
        var carried = start + from_#{K};
        if (digit_pass.is_first == 0u) {
            carried = payload[start + from_#{K}];
        }
        atomicStore(&scratch[ranked_#{K}], carried);
    }
#end
    workgroupBarrier();
#repeat K #{RADIX_ITEMS}
    if (#{K}u * WORKGROUP_SIZE + thread.local_index < count) {
        sorted_payload[to_#{K}] = atomicLoad(&scratch[#{K}u * WORKGROUP_SIZE + thread.local_index]);
    }
#end
}
