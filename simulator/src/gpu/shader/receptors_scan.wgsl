// Where the particles begin that come to each receiver's receptors, in the list of all that do.
#include control
#include receptor
#include running_sum

@group(0) @binding(0) var<storage, read_write> control: Control;
@group(0) @binding(1) var<storage, read_write> receptors: array<Receptors>;

// More than that to one receiver would take one invocation too long.
const MOST_BIDS: u32 = 1u << 20u;

@compute @workgroup_size(256)
fn receptors_scan(@builtin(local_invocation_index) lane: u32) {
    let count = arrayLength(&receptors);
    let share = (count + GROUP - 1u) / GROUP;
    let begin = min(lane * share, count);
    let end = min(begin + share, count);
    var own = 0u;
    for (var k = begin; k < end; k++) {
        let bids = atomicLoad(&receptors[k].bids);
        own += bids;
        if (bids > MOST_BIDS) {
            control.lacking_lo = bids;
            control.lacking_hi = 0u;
            control.frozen = TOO_MANY_BIDS;
        }
    }
    var before = running_sum(own, lane) - own;
    for (var k = begin; k < end; k++) {
        receptors[k].first = before;
        before += atomicLoad(&receptors[k].bids);
    }
}
