// Sorts second products by parents' ids: a stable radix sort by one workgroup, in an even number of passes.
#include control
#include running_sum

@group(0) @binding(0) var<storage, read_write> control: Control;
@group(0) @binding(1) var<storage, read_write> born_keys0: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read_write> born_keys1: array<vec2<u32>>;

const DIGIT_BITS: u32 = 3u;
const DIGITS: u32 = 8u;

var<workgroup> sizes: vec2<u32>;
// Indexed by digit and thread: the number of keys, then the index of the next one.
var<workgroup> digits: array<u32, 2048>;

fn key_at(pass_number: u32, k: u32) -> vec2<u32> {
    if ((pass_number & 1u) == 0u) {
        return born_keys0[k];
    }
    return born_keys1[k];
}

fn digit_of(key: vec2<u32>, pass_number: u32) -> u32 {
    let shift = DIGIT_BITS * pass_number;
    return select(0u, (key.x >> (shift & 31u)) & (DIGITS - 1u), shift < 32u);
}

@compute @workgroup_size(256)
fn born_sort(@builtin(local_invocation_index) local_index: u32) {
    if (local_index == 0u) {
        let count = min(atomicLoad(&control.born), arrayLength(&born_keys0));
        let bits = 32u - countLeadingZeros(control.next_id);
        let passes = (bits + 2u * DIGIT_BITS - 1u) / (2u * DIGIT_BITS) * 2u;
        sizes = vec2(select(0u, count, atomicLoad(&control.halted) == 0u), passes);
    }
    let all = workgroupUniformLoad(&sizes);
    let count = all.x;
    if (count == 0u) {
        return;
    }
    let chunk = (count + WORKGROUP_SIZE - 1u) / WORKGROUP_SIZE;
    let begin = min(local_index * chunk, count);
    let end = min(begin + chunk, count);
    for (var pass_number = 0u; pass_number < all.y; pass_number++) {
        for (var digit = 0u; digit < DIGITS; digit++) {
            digits[digit * WORKGROUP_SIZE + local_index] = 0u;
        }
        for (var k = begin; k < end; k++) {
            digits[digit_of(key_at(pass_number, k), pass_number) * WORKGROUP_SIZE + local_index] += 1u;
        }
        workgroupBarrier();
        var own = 0u;
        for (var j = 0u; j < DIGITS; j++) {
            own += digits[local_index * DIGITS + j];
        }
        var before = running_sum(own, local_index) - own;
        for (var j = 0u; j < DIGITS; j++) {
            let here = digits[local_index * DIGITS + j];
            digits[local_index * DIGITS + j] = before;
            before += here;
        }
        workgroupBarrier();
        for (var k = begin; k < end; k++) {
            let key = key_at(pass_number, k);
            let slot = digit_of(key, pass_number) * WORKGROUP_SIZE + local_index;
            let to = digits[slot];
            digits[slot] = to + 1u;
            if ((pass_number & 1u) == 0u) {
                born_keys1[to] = key;
            } else {
                born_keys0[to] = key;
            }
        }
        storageBarrier();
        workgroupBarrier();
    }
}
