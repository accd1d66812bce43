// Binds particles to free receptors; if too few, those with the lowest keys. One workgroup per type.
#include control
#include candidate
#include event_rows
#include receptor

@group(0) @binding(0) var<storage, read_write> control: Control;
@group(0) @binding(1) var<storage, read> tags: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read> event_rows: array<EventRow>;
@group(0) @binding(3) var<storage, read_write> claims: array<Claim>;
@group(0) @binding(4) var<storage, read_write> receptors: array<Receptors>;
@group(0) @binding(5) var<storage, read> requesters: array<u32>;
@group(0) @binding(6) var<storage, read_write> moved: array<vec4<f32>>;

const DIGITS: u32 = 8u;

// Requests, free receptors, and the beginning of the type's list.
var<workgroup> numbers: vec3<u32>;
var<workgroup> digits: array<atomic<u32>, 256>;
// Known digits of the threshold key, and accepted requests with them.
var<workgroup> known: vec3<u32>;

fn key_of(at: u32) -> vec2<u32> {
    return vec2(atomicLoad(&claims[at].priority), tags[at].y);
}

fn is_up_to(key: vec2<u32>, last: vec2<u32>) -> bool {
    return key.x < last.x || (key.x == last.x && key.y <= last.y);
}

fn last_key(requests: u32, free: u32, first: u32, local_index: u32) -> vec2<u32> {
    if (local_index == 0u) {
        known = vec3(0u, 0u, free);
    }
    var mask = vec2(0u);
    for (var digit = 0u; digit < DIGITS; digit++) {
        atomicStore(&digits[local_index], 0u);
        let so_far = workgroupUniformLoad(&known);
        let shift = 24u - 8u * (digit & 3u);
        for (var iteration = 0u; iteration < requests / WORKGROUP_SIZE + 1u; iteration++) {
            let j = iteration * WORKGROUP_SIZE + local_index;
            if (j < requests) {
                let key = key_of(requesters[first + j]);
                if (all((key & mask) == so_far.xy)) {
                    let word = select(key.y, key.x, digit < 4u);
                    atomicAdd(&digits[(word >> shift) & 255u], 1u);
                }
            }
        }
        workgroupBarrier();
        if (local_index == 0u) {
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
fn receptors_select(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) local_index: u32) {
    let receptor = group.x;
    if (local_index == 0u) {
        let count = receptors[receptor].count;
        let free = count - min(count, atomicLoad(&receptors[receptor].bound));
        let requests = select(0u, atomicLoad(&receptors[receptor].requests), atomicLoad(&control.halted) == 0u);
        numbers = vec3(requests, free, receptors[receptor].first);
        atomicAdd(&control.tallies[receptors[receptor].tally], requests);
        atomicAdd(&control.tallies[receptors[receptor].tally + 1u], requests - min(requests, free));
    }
    let all_numbers = workgroupUniformLoad(&numbers);
    let requests = all_numbers.x;
    let free = all_numbers.y;
    let first = all_numbers.z;
    if (min(requests, free) == 0u) {
        return;
    }
    var last = vec2(0xffffffffu);
    if (requests > free) {
        last = last_key(requests, free, first, local_index);
    }
    for (var iteration = 0u; iteration < requests / WORKGROUP_SIZE + 1u; iteration++) {
        let j = iteration * WORKGROUP_SIZE + local_index;
        if (j >= requests) {
            break;
        }
        let at = requesters[first + j];
        if (is_up_to(key_of(at), last)) {
            let ligand = claims[at].product;
            moved[at] = as_bound(claims[at].sphere.xyz, ligand);
            atomicAdd(&control.tallies[event_rows[ligand].tally], 1u);
            atomicAdd(&control.tallies[event_rows[ligand].occupied], 1u);
            atomicAdd(&control.removed, 1u);
        }
    }
}
