// All rounds that are left, by one workgroup, which alone may wait for itself. By then few candidates are left. Where
// they are too many for the loops of one invocation the run freezes, and is repeated with more rounds before.
#include control
#include params
#include philox
#include normal
#include boundary
#include candidate
#include round

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> round: Round;
@group(0) @binding(2) var<storage, read_write> control: Control;
@group(0) @binding(3) var<storage, read> candidates: array<Candidate>;
@group(0) @binding(4) var<storage, read> rules: array<Rule>;
@group(0) @binding(5) var<storage, read_write> claims: array<Claim>;
@group(0) @binding(6) var<storage, read> left: array<u32>;
@group(0) @binding(7) var<storage, read> moved: array<vec4<f32>>;

#include claiming
#include settling

// Loop turns that one round takes for each candidate of a lane: four looks, one of them with a draw of ten rounds.
const TURNS: u32 = 32u;

// How many candidates are free, by round in turn, so that clearing one does not disturb who still reads the other.
var<workgroup> free: array<atomic<u32>, 2>;
// How many candidates there are, read once for all.
var<workgroup> listed: u32;

fn is_free_at(index: u32) -> bool {
    return is_free(candidates[index], rules[candidates[index].rule]);
}

fn wait() {
    storageBarrier();
    workgroupBarrier();
}

@compute @workgroup_size(256)
fn matching_finish(@builtin(local_invocation_index) lane: u32) {
    if (lane == 0u) {
        listed = atomicLoad(&control.left[round.source]);
    }
    let count = workgroupUniformLoad(&listed);
    let shares = count / GROUP + 1u;
    let rounds = params.turns / (TURNS * shares);
    if (lane < 2u) {
        atomicStore(&free[lane], 0u);
    }
    wait();
    for (var number = 0u; number < rounds; number++) {
        for (var share = 0u; share < shares; share++) {
            let k = share * GROUP + lane;
            if (k < count && is_free_at(left[k])) {
                clear(left[k]);
                atomicAdd(&free[number & 1u], 1u);
            }
        }
        wait();
        if (workgroupUniformLoad(&free[number & 1u]) == 0u) {
            return;
        }
        for (var share = 0u; share < shares; share++) {
            let k = share * GROUP + lane;
            if (k < count && is_free_at(left[k])) {
                propose(left[k]);
            }
        }
        if (lane == 0u) {
            atomicStore(&free[(number + 1u) & 1u], 0u);
        }
        wait();
        for (var share = 0u; share < shares; share++) {
            let k = share * GROUP + lane;
            if (k < count && is_free_at(left[k])) {
                break_tie(left[k]);
            }
        }
        wait();
        for (var share = 0u; share < shares; share++) {
            let k = share * GROUP + lane;
            if (k < count && is_free_at(left[k])) {
                settle(left[k]);
            }
        }
        wait();
    }
    if (lane == 0u) {
        control.frozen = ROUNDS_LEFT;
    }
}
