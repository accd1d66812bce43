// Binds the particles that come to a receiver's receptors. Where free ones are too few, those of the lowest ranks have
// them, and of equal ranks those of the lowest ids. A workgroup for each receiver.
#include control
#include candidate
#include fate_rows
#include receptor

@group(0) @binding(0) var<storage, read_write> control: Control;
@group(0) @binding(1) var<storage, read> tags: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read> fates: array<Fate>;
@group(0) @binding(3) var<storage, read_write> claims: array<Claim>;
@group(0) @binding(4) var<storage, read_write> receptors: array<Receptors>;
@group(0) @binding(5) var<storage, read> bidders: array<u32>;
@group(0) @binding(6) var<storage, read_write> moved: array<vec4<f32>>;

const DIGITS: u32 = 8u;

// How many there are, how many receptors are free, and where their list begins.
var<workgroup> numbers: vec3<u32>;
// Of those whose key begins as the last one that is taken, how many have each next digit.
var<workgroup> digits: array<atomic<u32>, 256>;
// What is known of the key of the last one that is taken, and how many of those that begin so are taken.
var<workgroup> known: vec3<u32>;

// What they are ordered by.
fn key_of(at: u32) -> vec2<u32> {
    return vec2(atomicLoad(&claims[at].priority), tags[at].y);
}

fn is_up_to(key: vec2<u32>, last: vec2<u32>) -> bool {
    return key.x < last.x || (key.x == last.x && key.y <= last.y);
}

// The key of the last one that is taken, digit by digit from the highest on.
fn last_key(bids: u32, free: u32, first: u32, lane: u32) -> vec2<u32> {
    if (lane == 0u) {
        known = vec3(0u, 0u, free);
    }
    var mask = vec2(0u);
    for (var digit = 0u; digit < DIGITS; digit++) {
        atomicStore(&digits[lane], 0u);
        let so_far = workgroupUniformLoad(&known);
        let shift = 24u - 8u * (digit & 3u);
        for (var turn = 0u; turn < bids / GROUP + 1u; turn++) {
            let j = turn * GROUP + lane;
            if (j < bids) {
                let key = key_of(bidders[first + j]);
                if (all((key & mask) == so_far.xy)) {
                    let word = select(key.y, key.x, digit < 4u);
                    atomicAdd(&digits[(word >> shift) & 255u], 1u);
                }
            }
        }
        workgroupBarrier();
        if (lane == 0u) {
            var left = so_far.z;
            var found = 255u;
            for (var k = 0u; k < 256u; k++) {
                let here = atomicLoad(&digits[k]);
                if (left <= here) {
                    found = k;
                    break;
                }
                left -= here;
            }
            let bits = found << shift;
            known = vec3(so_far.xy | select(vec2(0u, bits), vec2(bits, 0u), digit < 4u), left);
        }
        mask |= select(vec2(0u, 255u << shift), vec2(255u << shift, 0u), digit < 4u);
        workgroupBarrier();
    }
    return workgroupUniformLoad(&known).xy;
}

@compute @workgroup_size(256)
fn receptors_choose(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let receiver = group.x;
    if (lane == 0u) {
        let count = receptors[receiver].count;
        let free = count - min(count, atomicLoad(&receptors[receiver].held));
        // Nobody where the run stands still.
        let bids = select(0u, atomicLoad(&receptors[receiver].bids), control.frozen == 0u);
        numbers = vec3(bids, free, receptors[receiver].first);
    }
    let all_numbers = workgroupUniformLoad(&numbers);
    let bids = all_numbers.x;
    let free = all_numbers.y;
    let first = all_numbers.z;
    if (min(bids, free) == 0u) {
        return;
    }
    var last = vec2(0xffffffffu);
    if (bids > free) {
        last = last_key(bids, free, first, lane);
    }
    for (var turn = 0u; turn < bids / GROUP + 1u; turn++) {
        let j = turn * GROUP + lane;
        if (j >= bids) {
            break;
        }
        let at = bidders[first + j];
        if (is_up_to(key_of(at), last)) {
            let fate = claims[at].product;
            moved[at] = as_held(claims[at].sphere.xyz, fate);
            atomicAdd(&control.tallies[fates[fate].tally], 1u);
            atomicAdd(&control.gone, 1u);
        }
    }
}
